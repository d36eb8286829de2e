"""Loop closures that a final path rejects, against those that are planted: whoever estimated the path, and how."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.special import chdtrc

from dense_fit import weight
from laps import laps
from slamduel.backends import registry
from slamduel.backends.common_options import LOSSES
from slamduel.backends.graphs.graduated import INLIER_LOOP
from slamduel.bench.measure.cell import Job, run_on
from slamduel.bench.measure.misfit import loop_misfits
from slamduel.bench.measure.rejected_loops import BEYOND, rejected_loops
from slamduel.core.factors import Dataset, Log
from slamduel.core.se2 import Array, Ints, compose, wrap
from slamduel.datasets.false_loops import planted
from tiers import first_quick

ROBUST = (("graph", {"loss": "cauchy"}), ("graph", {"gnc": True}), ("smoother", {"loss": "geman-mcclure"}))
COLUMNS = ("loops_rejected", "loop_precision", "loop_recall")


@cache
def made(seed: int, share: float) -> Dataset:
    """Laps of a block, of whose loops so many are false."""
    return planted(laps(np.random.default_rng(seed)), share, np.random.default_rng([seed, 1]))


def false_of(dataset: Dataset) -> Ints:
    assert dataset.truth is not None
    assert dataset.truth.false_loops is not None
    return dataset.truth.false_loops


def row(backend: str, dataset: Dataset, **options: Any) -> dict[str, Any]:
    """The columns of a cell."""
    given = replace(registry.find(backend).options(), **options)
    result = run_on(Job(backend, backend, given, 0, 8000), lambda: dataset.log, lambda: dataset.truth)
    assert result.status == "done", result.reason
    return {name: result.row[name] for name in COLUMNS if name in result.row}


def of(log: Log, dataset: Dataset, path: Array) -> dict[str, Any]:
    return rejected_loops(log, dataset.truth, path)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("seed", range(4))
def test_the_true_path_rejects_the_false_loops_and_hardly_another_one(seed: int, share: float) -> None:
    dataset = made(seed, share)
    false, count = len(false_of(dataset)), len(dataset.log.loop_to)
    found = of(dataset.log, dataset, dataset.truth.poses)
    assert found["loop_recall"] == 1
    assert found["loops_rejected"] - false <= 0.02 * count  # a correct one is beyond with a probability of 0.001
    assert found["loop_precision"] == false / found["loops_rejected"]


@pytest.mark.parametrize("seed", first_quick(range(5)))
@pytest.mark.parametrize("share", first_quick([0.1, 0.02, 0.3]))
@pytest.mark.parametrize(("backend", "options"), ROBUST)
def test_robust_backends_reject_the_false_ones_alone(
    backend: str, options: dict[str, Any], share: float, seed: int
) -> None:
    dataset = made(seed, share)
    found, false = row(backend, dataset, **options), len(false_of(dataset))
    assert found["loop_recall"] == 1
    assert found["loop_precision"] == false / found["loops_rejected"]
    assert found["loops_rejected"] - false <= 0.03 * len(dataset.log.loop_to)


@pytest.mark.parametrize("seed", first_quick(range(5)))
def test_a_plain_fit_is_drawn_by_false_loops_and_rejects_true_ones_with_them(seed: int) -> None:
    found = row("graph", made(seed, 0.1))
    assert found["loop_precision"] < 0.5
    assert found["loops_rejected"] > 2 * len(false_of(made(seed, 0.1)))


@pytest.mark.parametrize("seed", range(3))
def test_how_the_same_log_is_written_changes_nothing(seed: int) -> None:
    log, truth = dataset = made(seed, 0.1)
    path = row_path(dataset)
    expected = of(log, dataset, path)
    rng = np.random.default_rng(seed)
    elsewhere = compose(np.array([*rng.uniform(-500, 500, 2), rng.uniform(-3, 3)]), path)
    turned = path + np.array([0.0, 0.0, 2 * np.pi])
    assert of(log, dataset, elsewhere) == of(log, dataset, turned) == expected
    parts = [rng.permutation(np.arange(*ends)) for ends in zip(log.loop_first[:-1], log.loop_first[1:], strict=True)]
    order = np.concatenate(parts)  # of the loops of each step
    columns = {name: getattr(log, name)[order] for name in ("loop_to", "loop_delta", "loop_cov")}
    false = np.flatnonzero(np.isin(order, false_of(dataset)))
    assert rejected_loops(replace(log, **columns), truth._replace(false_loops=false), path) == expected
    feet = np.array([1 / 0.3048, 1 / 0.3048, 1.0])
    scaled = replace(log, loop_delta=log.loop_delta * feet, loop_cov=log.loop_cov * np.outer(feet, feet))
    assert of(scaled, dataset, path * feet) == expected


def row_path(dataset: Dataset) -> Array:
    """A path near the true one, off by what a smoother's is."""
    path = dataset.truth.poses.copy()
    path[:, :2] += 0.01 * np.sin(np.arange(len(path)))[:, None]
    path[:, 2] = wrap(path[:, 2] + 0.002 * np.cos(np.arange(len(path))))
    return path


def test_shares_are_blank_where_nothing_is_known_or_nothing_is_rejected() -> None:
    clean, dirty = laps(np.random.default_rng(3), noise=1.0), made(3, 0.1)
    path = clean.truth.poses
    assert {*rejected_loops(clean.log, clean.truth, path)} == {*rejected_loops(dirty.log, None, path)}
    assert {*rejected_loops(clean.log, None, path)} == {"loops_rejected"}
    none = clean.truth._replace(false_loops=np.zeros(0, np.int64))
    calm = replace(clean.log, loop_cov=100 * clean.log.loop_cov)
    assert rejected_loops(calm, none, path) == {"loops_rejected": 0}
    trusted = replace(dirty.log, loop_cov=1e6 * dirty.log.loop_cov)  # so that no path contradicts any of them
    assert rejected_loops(trusted, dirty.truth, path) == {"loops_rejected": 0, "loop_recall": 0.0}
    assert rejected_loops(clean.log.without_loops(), none, path) == {}


def test_a_backend_without_a_final_path_or_without_loops_has_no_columns() -> None:
    assert row("dead-reckoning", made(0, 0.1)) == {}
    assert row("fixed-lag", made(0, 0.1)) == {}


def test_losses_and_graduated_non_convexity_agree_that_such_a_loop_is_rejected() -> None:
    dataset = made(1, 0.1)
    assert BEYOND == INLIER_LOOP
    assert chdtrc(3, BEYOND) == pytest.approx(0.001, rel=1e-3)
    assert max(weight(loss, scale, BEYOND)[0] for loss, scale in LOSSES.items() if loss != "none") < 0.5
    far = loop_misfits(dataset.log, dataset.truth.poses) > BEYOND
    assert set(false_of(dataset).tolist()) <= set(np.flatnonzero(far).tolist())
