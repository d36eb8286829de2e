"""Ranges and bearings alone, fixes and constant errors in the batch solvers and iSAM2."""

from dataclasses import replace
from typing import Any

import gtsam
import numpy as np
import pytest

from driven import final
from random_logs import random_log
from slamduel.backends.api import Constant, Solution
from slamduel.backends.graphs.gtsam_parts import HEADING, fix_factors, part_factor
from slamduel.backends.late_places import Seen
from slamduel.bench.measure.misfit import lowest_near, misfit, partial_misfits
from slamduel.core.factors import Log, Systematic
from slamduel.core.fixes import Fixes, FixTable, residual
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, wrap

NAN, NONE = np.nan, Systematic()
MEASURED = ((0, 1, 2), (0, 1), (2,), (1, 2))
SAME_MODEL = 2e-4
"""m, rad; GTSAM's residual of a motion is another: see `graphs/graph.py`."""


def halves(log: Log) -> Log:
    """A log with each sighting as a range and a bearing, uncorrelated."""
    n, s = len(log), len(log.ids)
    var = np.diagonal(log.z_cov, axis1=1, axis2=2).ravel()
    parts = PartialTable.from_arrays(
        n, np.repeat(log.sighting_step, 2), np.repeat(log.ids, 2), np.tile((RANGE, BEARING), s), log.z.ravel(), var
    )
    none = np.zeros(n + 1, np.int64)
    return replace(log, sighting_first=none, ids=log.ids[:0], z=log.z[:0], z_cov=log.z_cov[:0], partial=parts)


def uncorrelated(log: Log) -> Log:
    return replace(log, z_cov=log.z_cov * np.eye(2))


def with_fixes(log: Log, poses: Array, rng: np.random.Generator, systematic: Systematic) -> Log:
    """Adds a fix of each kind at every fifth step."""
    step = np.arange(0, len(log), 5)
    arm = rng.normal(0, 0.5, (len(step), 2))
    z = np.array([residual(pose, np.zeros(3), one)[0] for pose, one in zip(poses[step], arm, strict=True)])
    z, cov = -z + rng.normal(0, 0.1, z.shape), np.tile(0.01 * np.eye(3), (len(step), 1, 1))
    cov[:, 0, 1] = cov[:, 1, 0] = 0.003
    for k in range(len(step)):
        missing = np.setdiff1d(range(3), MEASURED[k % 4])
        z[k, missing] = cov[k, missing] = cov[k, :, missing] = NAN
    fixes = FixTable.from_arrays(len(log), step, z, cov, arm)
    return replace(log, fixes=fixes, prior=log.prior._replace(systematic=systematic))


def drive(seed: int, systematic: Systematic = NONE) -> tuple[Log, Log]:
    """A log of whole sightings, and one with their halves and fixes."""
    rng = np.random.default_rng(seed)
    log, truth = random_log(rng, 40, 8, noise=0.1, blind=0.3)
    assert truth is not None
    log = uncorrelated(log)
    return log, with_fixes(halves(log), truth.poses, rng, systematic)


def off(a: Array, b: Array) -> float:
    between = a - b
    between[:, 2] = wrap(between[:, 2])
    return float(np.abs(between).max())


def total(log: Log, found: Solution) -> float:
    fit = misfit(log, found.path, found.map, found.constant)
    assert fit is not None
    return fit.total


@pytest.mark.parametrize(
    ("backend", "options"),
    [*(("graph", {"start": start}) for start in ("auto", "odometry", "incremental")), ("smoother", {})],
)
def test_both_halves_of_each_sighting_give_what_the_whole_ones_do(backend: str, options: dict[str, Any]) -> None:
    log, _ = drive(1)
    whole, parts = final("graph", log), final(backend, halves(log), **options)
    assert off(parts.path, whole.path) < 1e-6
    assert total(halves(log), parts) == pytest.approx(total(log, whole), rel=1e-9)
    assert whole.cov is not None
    assert np.abs(parts.cov - whole.cov).max() < 1e-9


@pytest.mark.parametrize("options", [{"gnc": True}, {"loss": "cauchy"}, {"loss": "huber"}])
def test_losses_and_rejection_weigh_partial_sightings(options: dict[str, Any]) -> None:
    log, _ = drive(1)
    parts = halves(log)
    assert parts.partial is not None
    z = parts.partial.z.copy()
    z[parts.partial.kind == RANGE] += 5.0 * (np.random.default_rng(0).random(len(log.ids)) < 0.1)
    wrong = replace(parts, partial=PartialTable.from_arrays(len(log), parts.partial.step, *_columns(parts, z)))
    right = final("graph", log).path
    assert off(final("graph", wrong, **options).path, right) < 0.3 * off(final("graph", wrong).path, right)


def _columns(log: Log, z: Array) -> tuple[Any, Any, Array, Array]:
    assert log.partial is not None
    return log.partial.ids, log.partial.kind, z, log.partial.var


ERRORS = [Systematic(), Systematic(0.05, 0.1, 0.2), Systematic(0.05, 0.0, 0.2, each=True), Systematic(range_offset=0.1)]


@pytest.mark.parametrize("systematic", ERRORS)
def test_fixes_and_constant_errors_end_at_the_least_j(systematic: Systematic) -> None:
    _, log = drive(2, systematic)
    found, rng = final("graph", log), np.random.default_rng(3)
    least = total(log, found)
    assert lowest_near(log, found.path, found.map, found.constant) == pytest.approx(least, rel=1e-9)
    for _ in range(20):
        path = found.path + rng.normal(0, 1e-4, found.path.shape)
        assert total(log, found._replace(path=path)) > least
    assert (found.constant is None) == (systematic == Systematic())


@pytest.mark.parametrize("systematic", ERRORS)
def test_constant_errors_that_are_not_given_are_those_of_least_j(systematic: Systematic) -> None:
    """In closed form, they are what the solver finds."""
    _, log = drive(2, systematic)
    found = final("graph", log)
    assert total(log, found._replace(constant=None)) == pytest.approx(total(log, found), rel=1e-9)
    worse = Constant(np.full(1, 0.01), np.full(1, 0.02), 0.1)
    assert total(log, found._replace(constant=worse)) > total(log, found)


@pytest.mark.parametrize("systematic", ERRORS)
@pytest.mark.parametrize(
    ("backend", "options"),
    [
        ("isam2", {"relinearize_threshold": 1e-4, "relinearize_skip": 1}),
        ("graph", {"solver": "gtsam"}),
        ("graph", {"solver": "gtsam", "start": "incremental"}),
        ("smoother", {}),
    ],
)
def test_the_others_find_the_same(backend: str, options: dict[str, Any], systematic: Systematic) -> None:
    _, log = drive(2, systematic)
    mine, other = final("graph", log), final(backend, log, **options)
    assert off(mine.path, other.path) < SAME_MODEL
    assert total(log, other) == pytest.approx(total(log, mine), rel=1e-5)
    if mine.constant is not None and other.constant is not None:
        assert other.constant.heading_offset == pytest.approx(mine.constant.heading_offset, abs=SAME_MODEL)


def test_a_scale_of_all_ranges_is_found() -> None:
    log, _ = drive(4)
    parts = halves(log)
    assert parts.partial is not None
    z = np.where(parts.partial.kind == RANGE, 1.1 * parts.partial.z, parts.partial.z)
    long = PartialTable.from_arrays(len(log), parts.partial.step, *_columns(parts, z))
    scaled = replace(parts, partial=long, prior=log.prior._replace(systematic=Systematic(range_scale=0.2)))
    found = final("graph", scaled)
    assert found.constant is not None
    assert found.constant.range_scale == pytest.approx([0.1], abs=0.02)
    assert found.constant.range_offset == pytest.approx([0.0], abs=1e-9)
    assert off(found.path, final("graph", log).path) < 0.05


def test_a_landmark_with_a_single_range_or_bearing_is_on_the_map() -> None:
    log, _ = drive(5)
    parts = halves(log)
    assert parts.partial is not None
    one = log.ids[log.ids != log.ids[0]][0]
    first = np.flatnonzero((parts.partial.ids == one) & (parts.partial.kind == BEARING))[0]
    kept = parts.partial.rows((parts.partial.ids != one) | (np.arange(len(parts.partial)) == first))
    single = replace(parts, partial=kept)
    for backend in ("graph", "isam2", "smoother"):
        found = final(backend, single)
        assert one in found.map.ids
        terms = partial_misfits(single, found.path, found.map, found.constant)
        assert terms is not None
        assert len(terms) == len(kept)


# --- GTSAM's factors in Python


def derivatives_agree(factor: gtsam.NonlinearFactor, values: gtsam.Values) -> None:
    graph = gtsam.NonlinearFactorGraph()
    graph.add(factor)
    keys = list(factor.keys())
    A, _ = graph.linearize(values).jacobian(gtsam.Ordering(keys))
    numeric = []
    for key in keys:
        for change in np.eye(3 if key == POSE else 2):
            moved = []
            for sign in (1e-6, -1e-6):
                by = gtsam.VectorValues()
                by.insert(key, sign * change)
                moved.append(graph.linearize(values.retract(by)).jacobian(gtsam.Ordering(keys))[1].ravel())
            numeric.append((moved[1] - moved[0]) / 2e-6)
    np.testing.assert_allclose(A, np.transpose(numeric), atol=1e-5)


POSE, LANDMARK, CONSTANT = gtsam.symbol("x", 0), gtsam.symbol("l", 0), gtsam.symbol("e", 0)


def values() -> gtsam.Values:
    out = gtsam.Values()
    out.insert(POSE, gtsam.Pose2(1.0, -2.0, 0.7))
    out.insert(LANDMARK, np.array([4.0, 1.5]))
    out.insert(CONSTANT, np.array([0.06, 0.2]))
    out.insert(HEADING, np.array([0.1, 0.0]))
    return out


def test_the_derivatives_of_a_range_with_constant_errors_are_the_numerical_ones() -> None:
    factor = part_factor(POSE, LANDMARK, CONSTANT, Seen(0, RANGE, 4.0, 0.25), lambda model: model)
    derivatives_agree(factor, values())


@pytest.mark.parametrize("turn", [None, HEADING])
@pytest.mark.parametrize("measured", MEASURED)
def test_the_derivatives_of_a_fix_are_the_numerical_ones(measured: tuple[int, ...], turn: int | None) -> None:
    z, cov = np.array([1.1, -1.9, 0.9]), 0.01 * np.eye(3)
    cov[0, 1] = cov[1, 0] = 0.003
    missing = np.setdiff1d(range(3), measured)
    z[missing] = cov[missing] = cov[:, missing] = NAN
    (factor,) = fix_factors(POSE, turn, Fixes(z[None], cov[None], np.array([[0.3, -0.2]])))
    derivatives_agree(factor, values())
