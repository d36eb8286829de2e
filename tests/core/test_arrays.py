"""Columns are taken without a copy where nobody else can write to them, and worked on in blocks to the same bits."""

import numpy as np
import pytest

from slamduel.core import arrays
from slamduel.core.arrays import even, frozen, frozen_ids, read_only, slices
from slamduel.core.factors import Log, Prior
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array


def test_a_read_only_array_of_its_own_memory_is_not_copied() -> None:
    numbers, ids = read_only(np.arange(4.0)), read_only(np.arange(4))
    assert frozen(numbers) is numbers
    assert frozen_ids(ids) is ids


@pytest.mark.parametrize("column", [np.arange(4.0), read_only(np.arange(8.0))[:4], np.arange(4.0, dtype=np.float32)])
def test_what_somebody_may_still_write_to_or_is_of_another_kind_is_copied(column: Array) -> None:
    copy = frozen(column)
    assert not np.shares_memory(copy, column)
    assert not copy.flags.writeable
    assert copy.dtype == np.float64
    assert copy.tolist() == column.tolist()


def test_a_log_keeps_its_numbers_whatever_becomes_of_the_arrays_that_were_given() -> None:
    z, cov = np.array([[1.0, 0.5]]), np.eye(2)[None] / 100
    given = np.array([0]), np.array([7]), z, cov
    prior = Prior(np.zeros(3), np.eye(3))
    log = Log.from_arrays("log", prior, np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3, 3)), *given)
    z[:], cov[:] = 9.0, 9.0
    assert log.z.tolist() == [[1.0, 0.5]]
    assert log.z_cov[0, 0, 0] == 0.01


@pytest.mark.parametrize("rows", [0, 1, 3, 4, 9])
def test_slices_cover_all_rows_once(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrays, "BLOCK", 3)
    assert [k for some in slices(rows) for k in range(some.start, some.stop)] == list(range(rows))


def test_covariances_are_symmetrised_and_judged_alike_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    root = rng.standard_normal((50, 2, 2))
    cov = root @ root.swapaxes(1, 2) + np.eye(2)
    cov[31, 0, 1] += 1e-14  # rounding
    cov[[7, 44]] *= -1  # not positive definite
    step, ids, z = np.arange(50), np.zeros(50, np.int64), np.full((50, 2), 1.0)
    motions = np.zeros((50, 3)), np.broadcast_to(np.eye(3), (50, 3, 3))
    prior = Prior(np.zeros(3), np.eye(3))

    def judged() -> tuple[bytes, list[tuple[str, int, str]]]:
        log = Log.from_arrays("log", prior, np.arange(50.0), *motions, step, ids, z, cov)
        return even(cov).tobytes(), [(one.table, one.row, one.message) for one in problems(log)]

    whole = judged()
    assert [row for _, row, _ in whole[1]] == [7, 44]
    monkeypatch.setattr(arrays, "BLOCK", 8)
    assert judged() == whole
