"""Ranges and bearings alone, fixes and constant errors in the batch solvers, iSAM2, the smoother and fixed-lag."""

from dataclasses import replace
from typing import Any

import gtsam
import numpy as np
import pytest

from driven import final, run
from random_logs import random_log
from slamduel.backends.api import Constant, Solution
from slamduel.backends.graphs.gtsam_parts import HEADING, fix_factors, part_factor
from slamduel.backends.starting.late_places import Seen
from slamduel.backends.window import fixed_lag
from slamduel.bench.measure.misfit import lowest_near, misfit, partial_misfits
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log, Systematic
from slamduel.core.fixes import Fixes, FixTable, residual
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, wrap
from tiers import first_quick

NAN, NONE = np.nan, Systematic()
MEASURED = ((0, 1, 2), (0, 1), (2,), (1, 2))
SAME_MODEL = 2e-4
"""m, rad; GTSAM's residual of a motion is another: see `graphs/graph.py`."""
SAME_OPTIMUM = 1e-6
"""m, rad."""
ALL = {"lag": 1e9, "final_checks": 50}
"""A window that nothing leaves."""
ENDS = 0.05
"""Share of J by which `isam2` may end above the least, within its threshold."""
EXACT = {"relinearize_threshold": 1e-4, "relinearize_skip": 1}


def halves(log: Log, whole: Any = None) -> Log:
    """A log with each sighting as a range and a bearing, uncorrelated, except those that stay `whole` (s,)."""
    whole = np.zeros(len(log.ids), bool) if whole is None else whole
    n, some = len(log), ~whole
    var = np.diagonal(log.z_cov[some], axis1=1, axis2=2).ravel()
    step, ids, kind = np.repeat(log.sighting_step[some], 2), np.repeat(log.ids[some], 2), (RANGE, BEARING)
    parts = PartialTable.from_arrays(n, step, ids, np.tile(kind, some.sum()), log.z[some].ravel(), var)
    first = np.searchsorted(log.sighting_step[whole], np.arange(n + 1))
    left = {"sighting_first": first, "ids": log.ids[whole], "z": log.z[whole], "z_cov": log.z_cov[whole]}
    return replace(log, partial=parts, **left)


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
    [
        *(("graph", {"start": start}) for start in ("auto", "odometry", "incremental")),
        ("smoother", {}),
        ("fixed-lag", ALL),
    ],
)
def test_both_halves_of_each_sighting_give_what_the_whole_ones_do(backend: str, options: dict[str, Any]) -> None:
    log, _ = drive(1)
    whole, parts = final("graph", log), final(backend, halves(log), **options)
    assert off(parts.path, whole.path) < SAME_OPTIMUM
    assert total(halves(log), parts) == pytest.approx(total(log, whole), rel=1e-9)
    assert whole.cov is not None
    assert np.abs(parts.cov - whole.cov).max() < 1e-9


@pytest.mark.parametrize("lag", [0.5, 1.5])
@pytest.mark.parametrize("solver", ["own", "gtsam"])
def test_so_do_they_at_each_step_in_a_window(solver: str, lag: float) -> None:
    log, _ = drive(1)
    whole, parts = (run(f"fixed-lag by {solver}", one, lag=lag)[1] for one in (log, halves(log)))
    assert off(parts, whole) < 1e-9


@pytest.mark.parametrize("loss", ["none", "cauchy"])
@pytest.mark.parametrize("seed", range(3))
def test_the_window_eliminates_and_returns_in_any_order(seed: int, loss: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole and partial sightings of one landmark, some held back, and constant errors that are used now and then."""
    rng = np.random.default_rng(seed)
    monkeypatch.setattr(fixed_lag, "KEEP", int(rng.choice([0, 1, 3])))
    log, fixed = drive(seed, ERRORS[1 + seed])
    mixed = replace(halves(log, rng.random(len(log.ids)) < 0.5), fixes=fixed.fixes, prior=fixed.prior)
    found, best = final("fixed-lag", mixed, loss=loss, **ALL), final("smoother", mixed, loss=loss)
    assert off(found.path, best.path) < SAME_OPTIMUM
    assert np.abs(found.cov - best.cov).max() < 1e-5 * np.abs(best.cov).max()
    assert found.constant is not None
    order = np.argsort(found.map.ids)
    assert found.map.xy[order] == pytest.approx(best.map.xy[np.argsort(best.map.ids)], abs=SAME_OPTIMUM)


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
    ("backend", "options", "same"),
    [
        ("isam2", EXACT, SAME_MODEL),
        ("graph", {"solver": "gtsam"}, SAME_MODEL),
        ("graph", {"solver": "gtsam", "start": "incremental"}, SAME_MODEL),
        ("fixed-lag by gtsam", ALL | EXACT, SAME_MODEL),
        ("fixed-lag", ALL, SAME_OPTIMUM),
        ("smoother", {}, SAME_OPTIMUM),
    ],
)
def test_the_others_find_the_same(backend: str, options: dict[str, Any], same: float, systematic: Systematic) -> None:
    _, log = drive(2, systematic)
    mine, other = final("graph", log), final(backend, log, **options)
    assert off(mine.path, other.path) < same
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
    for backend in ("graph", "isam2", "smoother", "fixed-lag", "fixed-lag by gtsam"):
        found = final(backend, single)
        assert one in found.map.ids
        terms = partial_misfits(single, found.path, found.map, found.constant)
        assert terms is not None
        assert len(terms) == len(kept)


# --- GTSAM's factors in Python


@pytest.mark.parametrize(
    ("backend", "world", "seed"),
    first_quick(
        [(b, w, seed) for seed in range(4) for w in ("bearings_only=1", "ranges_only=1") for b in ("smoother", "isam2")]
    ),
)
def test_landmarks_that_never_start_are_part_of_the_optimum_at_the_end(backend: str, world: str, seed: int) -> None:
    """With wheels this bad some are never sure along the way; without their sightings J is up to 1.5 of the least."""
    log = load(f"circle[{world},steps=600]", seed).log
    found = final(backend, log)
    cost = misfit(log, found.path, found.map)
    least = lowest_near(log, found.path, found.map)
    assert cost is not None
    assert least is not None
    assert cost.total < (1 + ENDS) * least


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
