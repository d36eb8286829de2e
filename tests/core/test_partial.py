"""Partial sightings and fixes of a log: columns, views, digest, archive and checks."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from partial_logs import NAN, partial_log
from refusals import refused
from slamduel.backends.api import Builder
from slamduel.backends.given import given
from slamduel.backends.given import refused as refused_by
from slamduel.core import fixes
from slamduel.core.factors import UNKNOWN, Dataset, Log, Systematic
from slamduel.core.factors.check import problems
from slamduel.core.fixes import FixTable
from slamduel.core.mounting import Mounting
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.datasets import archive
from small_log import small_log


def partial_of(log: Log) -> PartialTable:
    assert log.partial is not None
    return log.partial


def fixes_of(log: Log) -> FixTable:
    assert log.fixes is not None
    return log.fixes


def test_a_step_has_its_own_rows() -> None:
    log = partial_log()
    for steps in (list(log), [log[k] for k in range(len(log))]):
        assert [step.partial.ids.tolist() for step in steps] == [[3], [12, 12], [], [], [UNKNOWN], [7]]
        assert [step.partial.kind.tolist() for step in steps][1] == [RANGE, BEARING]
        assert [len(step.fixes.z) for step in steps] == [1, 0, 2, 0, 0, 1]
        assert steps[2].fixes.z[1].tolist() == [0.5, -1.0, -2.0]


def test_the_prior_says_if_there_are_some() -> None:
    log = partial_log()
    assert log.prior.partial
    assert log.prior.fixes
    assert not log.without_partial().prior.partial
    assert not log.without_fixes().prior.fixes
    assert not small_log().prior.partial
    none = np.zeros(0, np.int64)
    empty = PartialTable.from_arrays(6, none, none, none, np.zeros(0), np.zeros(0))
    assert replace(small_log(), partial=empty).partial is None


def test_a_log_of_its_own_steps_is_the_same() -> None:
    log = partial_log()
    again = Log.from_steps(log.name, log.prior, list(log), log.notes)
    assert again.digest == log.digest


def test_the_first_steps_have_their_rows() -> None:
    log = partial_log().head(3)
    assert partial_of(log).z.tolist() == [1.5, 2.0, -0.4]
    assert fixes_of(log).step.tolist() == [0, 2, 2]
    assert partial_log().head(6).digest == partial_log().digest


def test_those_without_id_are_taken_out_with_the_others() -> None:
    log = partial_log().identified()
    assert partial_of(log).ids.tolist() == [3, 12, 12, 7]
    assert partial_of(log).step.tolist() == [0, 1, 1, 5]


@pytest.mark.parametrize(
    "change",
    [
        lambda log: log.without_partial(),
        lambda log: log.without_fixes(),
        lambda log: replace(log, partial=replace(log.partial, z=log.partial.z + 1e-15)),
        lambda log: replace(log, partial=replace(log.partial, kind=log.partial.kind[::-1].copy())),
        lambda log: replace(log, fixes=replace(log.fixes, arm=log.fixes.arm[::-1].copy())),
        lambda log: replace(log, prior=log.prior._replace(systematic=Systematic(range_scale=0.1))),
    ],
)
def test_the_digest_covers_them(change: Callable[[Log], Log]) -> None:
    assert change(partial_log()).digest != partial_log().digest


def test_a_log_without_them_has_the_digest_that_it_had() -> None:
    log = partial_log()
    plain = replace(log.without_partial().without_fixes(), prior=small_log().prior)
    assert plain.digest == small_log().digest


def test_an_archive_restores_them() -> None:
    log = partial_log()
    again = archive.unpacked(archive.packed(Dataset(log, None))).log
    assert again.digest == log.digest
    assert again.prior.systematic == log.prior.systematic
    assert not partial_of(again).z.flags.writeable


def test_a_mounting_needs_whole_sightings() -> None:
    refused("found sightings of a range or a bearing alone", partial_log().of_sensor, Mounting(0.1))


def test_a_good_log_has_no_problem() -> None:
    assert list(problems(partial_log())) == []


BAD_PARTIAL = {
    "a range below zero": ("z", 1, -2.0, "ranges", "range is -2.0, expected more than 0"),
    "a range that is NaN": ("z", 0, NAN, "ranges", "range is nan, expected a finite number"),
    "a bearing in degrees": ("z", 2, 45.0, "bearings", "bearing is 45.0, expected radians from -pi to pi"),
    "no variance": ("var", 4, 0.0, "ranges", "crr is 0.0, expected a variance, more than 0"),
    "an infinite variance": ("var", 3, np.inf, "bearings", "cbb is inf, expected a variance"),
    "another kind": ("kind", 3, 2, "ranges", "kind is 2, expected 0 for a range, or 1 for a bearing"),
    "a negative id": ("ids", 4, -3, "ranges", "id is -3, expected 0 to"),
    "one range twice": ("kind", 2, RANGE, "ranges", "the range of id 12 occurs twice in step 1, expected once"),
}


@pytest.mark.parametrize("case", BAD_PARTIAL)
def test_a_bad_partial_sighting_is_named(case: str) -> None:
    name, row, value, table, message = BAD_PARTIAL[case]
    log = partial_log()
    column = getattr(partial_of(log), name).copy()
    column[row] = value
    found = list(problems(replace(log, partial=replace(partial_of(log), **{name: column}))))
    assert (found[-1].table, found[-1].row) == (table, row)
    assert message in found[-1].message


BAD_FIXES = {
    "nothing measured": ("z", 1, (NAN, NAN, NAN), "x, y and heading are all missing, expected at least one of them"),
    "a position at infinity": ("z", 0, (np.inf, 2.0, NAN), "x is inf, expected a finite number"),
    "a heading in degrees": ("z", 1, (NAN, NAN, 90.0), "heading is 90.0, expected radians from -pi to pi"),
    "a position too far": ("z", 0, (1e12, 2.0, NAN), "expected metres, at most"),
    "a covariance of more": ("z", 0, (1.0, NAN, NAN), "the covariance does not fit, expected that of x and nothing"),
    "a covariance of less": ("z", 1, (1.0, NAN, 0.3), "the covariance does not fit, expected that of x, heading"),
    "no covariance": ("cov", 2, np.zeros((3, 3)), "not positive definite"),
    "an arm that is NaN": ("arm", 3, (NAN, 0.0), "arm_x is nan, expected a finite number"),
}


@pytest.mark.parametrize("case", BAD_FIXES)
def test_a_bad_fix_is_named(case: str) -> None:
    name, row, value, message = BAD_FIXES[case]
    log = partial_log()
    column = getattr(fixes_of(log), name).copy()
    column[row] = value
    found = list(problems(replace(log, fixes=replace(fixes_of(log), **{name: column}))))
    assert (found[0].table, found[0].row) == ("fixes", row)
    assert message in found[0].message


def test_rows_of_steps_that_do_not_exist_and_shapes_are_named() -> None:
    log = partial_log()
    partial = partial_of(log)
    beyond = PartialTable.from_arrays(6, partial.step + 2, partial.ids, partial.kind, partial.z, partial.var)
    found = [problem.message for problem in problems(replace(log, partial=beyond))]
    assert found == ["a row belongs to a step that does not exist, expected 0 to 5"]
    flat = replace(fixes_of(log), arm=np.zeros(4))
    assert "arm has shape (4,), expected (4, 2)" in [one.message for one in problems(replace(log, fixes=flat))]


def test_a_fix_expects_the_antenna_where_it_is() -> None:
    """Against numerical derivatives."""
    pose, arm = np.array([1.0, -2.0, 2.8]), np.array([0.4, -0.7])
    z = np.array([1.5, -2.5, -2.9])
    off, jacobian = fixes.residual(pose, z, arm)
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-6
        more, _ = fixes.residual(pose + step, z, arm)
        less, _ = fixes.residual(pose - step, z, arm)
        np.testing.assert_allclose(jacobian[:, i], (less - more) / 2e-6, atol=1e-9)
    c, s = np.cos(2.8), np.sin(2.8)
    np.testing.assert_allclose(off[:2], z[:2] - pose[:2] - [c * 0.4 + s * 0.7, s * 0.4 - c * 0.7])
    np.testing.assert_allclose(off[2], 2 * np.pi - 5.7)


def test_a_fix_of_a_part_has_no_information_of_the_rest() -> None:
    log = partial_log()
    off, jacobian = fixes.residual(np.zeros(3), fixes_of(log).z[3], fixes_of(log).arm[3])
    assert off[[0, 2]].tolist() == [0, 0]
    assert not jacobian[[0, 2]].any()
    np.testing.assert_allclose(fixes.information(fixes_of(log).cov[3]), np.diag([0, 5.0, 0]))
    whole = fixes.information(fixes_of(log).cov[2])
    np.testing.assert_allclose(whole @ fixes_of(log).cov[2], np.eye(3), atol=1e-12)


def test_a_backend_gets_what_it_takes() -> None:
    log = partial_log()

    def make(prior: object, options: object, rng: object) -> object:
        raise NotImplementedError

    takes: Builder = Builder(make, loops=True, partial=True, fixes=True)  # pyright: ignore[reportArgumentType]
    assert refused_by(takes, log) == ""
    took = given(takes, log)
    assert (took.loops, took.partial, took.fixes) == (0, 1, 0)
    assert partial_of(took.log).ids.tolist() == [3, 12, 12, 7]
    without = replace(takes, partial=False)
    assert "a range or a bearing alone" in refused_by(without, log)
    left = given(replace(without, leaves_out=("partial",)), log)
    assert left.partial == 5
    assert left.log.partial is None
    assert left.log.fixes is not None
    assert "positions or headings" in refused_by(replace(takes, fixes=False), log)
    blind = given(replace(takes, partial=False, fixes=False, sightings=False), log)
    assert (blind.partial, blind.fixes, blind.log.fixes) == (5, 4, None)
