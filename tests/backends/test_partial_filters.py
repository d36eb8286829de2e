"""The UKF and the invariant EKF on sightings of a range or a bearing alone, and on fixes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beacon_drives import BEACONS, BEARING, RANGE, Drive, drive
from dense_invariant import derivative
from dense_invariant_partial import DenseInvariantPartial, angle_near
from dense_partial import DenseUnscentedPartial
from slamduel.backends.gaussian import ekf
from slamduel.backends.invariant import _partial, invariant_ekf
from slamduel.backends.unscented import ukf
from slamduel.core.factors import Log, Map, RangeBearing, RelativePoses, Systematic
from slamduel.core.se2 import Array, between, compose, wrap

FILTERS: dict[str, Any] = {"ekf": ekf, "invariant-ekf": invariant_ekf, "ukf": ukf}
OURS = ("invariant-ekf", "ukf")
DRIVES: dict[str, dict[str, Any]] = {
    "ranges": {},
    "bearings": {"kinds": (BEARING,)},
    "both in turn": {"kinds": (RANGE, BEARING)},
    "ranges of unknown scale": {"scale_sd": 0.1},
    "ranges and positions": {"fix_every": 10},
    "bearings, positions and headings": {"kinds": (BEARING,), "fix_every": 7, "compass": True},
}


def run(name: str, log: Log) -> tuple[Any, Array, Array]:
    """The filter at the end, its path (n, 3) and covariances (n, 3, 3)."""
    build = FILTERS[name].build
    filter_ = build.make(log.prior, build.options(), np.random.default_rng(0))
    path, covs = [], []
    for step in log:
        path.append(filter_.step(step))
        covs.append(filter_.belief().cov)
    return filter_, np.array(path), np.array(covs)


def apart(a: Array, b: Array) -> float:
    """The largest difference of two paths, m or rad."""
    off = a - b
    off[:, 2] = wrap(off[:, 2])
    return float(np.abs(off).max())


@pytest.mark.parametrize("case", DRIVES)
def test_the_ukf_is_the_dense_one(case: str) -> None:
    """The same path and covariances, to what a prior variance 1e8 times the posterior one leaves of 16 digits."""
    log = drive(3, steps=120, **DRIVES[case]).log
    filter_, path, covs = run("ukf", log)
    dense = DenseUnscentedPartial(log)
    expected, theirs = dense.run(log)
    assert set(dense.at) == set(filter_.map().ids.tolist()) == {0, 1, 2, 3}
    assert apart(path, expected) < 2e-6
    np.testing.assert_allclose(covs, theirs, atol=1e-7)


@pytest.mark.parametrize("case", DRIVES)
def test_the_invariant_ekf_is_the_one_of_whole_matrices(case: str) -> None:
    log = drive(3, steps=90, **DRIVES[case]).log
    filter_, path, covs = run("invariant-ekf", log)
    dense = DenseInvariantPartial(log)
    for k, step in enumerate(log):
        assert np.abs(between(dense.step(step), path[k])).max() < 2e-6
        plain = dense.plain()
        theirs = (plain @ dense.cov @ plain.T)[np.ix_([1, 2, 0], [1, 2, 0])]
        np.testing.assert_allclose(covs[k], theirs, atol=1e-7)
    assert filter_.map().ids.tolist() == dense.ids
    assert len(dense.ids) == 4


@pytest.mark.parametrize("kind", [RANGE, BEARING])
@pytest.mark.parametrize("where", ["here", "kept", "here, of a fixed landmark", "kept, of a fixed landmark"])
def test_invariant_jacobians_are_the_derivatives(kind: int, where: str) -> None:
    """By the errors of the kept pose, the landmark, the present heading, scale and offset; all of the group's."""
    at = np.array([1.0, -2.0, 0.4, 4.0, 3.0, 0.07, 0.2])
    here, fixed = where.startswith("here"), "fixed" in where
    entries = np.array([*((-3, -2, -1) if here else (4, 5, 7)), *((-4, -4) if fixed else (0, 1)), 8, 9, -1])
    H = np.empty(8)
    there, expected = _partial.expectation(kind, at, entries, H)
    assert there

    def seen(error: Any) -> Any:
        heading, own = error[7] + (error[2] if here else 0.0), error[2] + (error[7] if here else 0.0)
        p = np.array([at[0] - own * at[1] + error[0], at[1] + own * at[0] + error[1]])
        f = at[3:5] if fixed else np.array([at[3] - heading * at[4] + error[3], at[4] + heading * at[3] + error[4]])
        x, y = f - p
        if kind == RANGE:
            return np.array([(1 + at[5] + error[5]) * np.sqrt(x * x + y * y) + at[6] + error[6]])
        return np.array([angle_near(y, x, np.arctan2(5.0, 3.0)) - at[2] - own])

    numerical = derivative(seen, 8)[0]
    turns = (numerical[2], 0.0) if here else (numerical[2], numerical[7])  # the present heading is one entry
    np.testing.assert_allclose(np.delete(H, [2, 7]), np.delete(numerical, [2, 7]), atol=1e-12)
    np.testing.assert_allclose((H[2] + H[7], 0.0) if here else (H[2], H[7]), turns, atol=1e-12)
    assert expected == pytest.approx(np.real(seen(np.zeros(8))[0]))


def test_a_motion_of_the_world_changes_no_invariant_jacobian() -> None:
    """Moved and turned with the world, kept pose and landmark are seen alike: the filter learns nothing of it."""
    at = np.array([1.0, -2.0, 0.4, 4.0, 3.0, 0.0, 0.0])
    for kind in (RANGE, BEARING):
        H = np.empty(8)
        _partial.expectation(kind, at, np.array([4, 5, 7, 0, 1, -4, -4, -1]), H)
        assert np.abs(H @ [[0, 0], [0, 0], [1, 0], [0, 0], [0, 0], [0, 0], [0, 0], [1, 0]]).max() < 1e-12
        assert abs(H[0] + H[3]) + abs(H[1] + H[4]) < 1e-12


@pytest.mark.parametrize("case", DRIVES)
@pytest.mark.parametrize("name", OURS)
def test_it_finds_the_beacons(name: str, case: str) -> None:
    """Within four standard deviations of each; no pose is kept when none waits."""
    made = drive(5, steps=400, **DRIVES[case])
    filter_, path, _ = run(name, made.log)
    found = filter_.map()
    assert sorted(found.ids.tolist()) == list(range(len(BEACONS)))
    for i, landmark in enumerate(found.ids.tolist()):
        off = found.xy[i] - BEACONS[landmark]
        own = found.cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        assert off @ np.linalg.solve(own, off) < 4**2
    assert np.hypot(*(path[-1, :2] - made.path[-1, :2])) < 0.3
    assert filter_.pairs <= len(BEACONS) + 2
    if "scale_sd" in DRIVES[case]:
        assert abs(filter_.range_errors[0] - made.scale) < 0.015
    else:
        assert filter_.range_errors is None


@pytest.mark.parametrize("case", [case for case in DRIVES if "scale" not in case])
@pytest.mark.parametrize("name", OURS)
def test_it_is_the_ekf_to_second_order(name: str, case: str) -> None:
    """A tenth of the noise leaves a hundredth of the difference, on a rough map; also without, where places are sharp.

    How sharp they are at a late start by one kind alone depends on when that is.
    """
    for known in (True, False) if case == "both in turn" else (True,):
        off = []
        for noise in (0.2, 0.02):
            log = drive(6, steps=150, noise=noise, **DRIVES[case]).log
            rough = BEACONS + noise * 0.05 * np.random.default_rng(1).standard_normal((4, 2))
            given = Map(np.arange(4), rough, noise**2 * 0.05**2 * np.eye(8)) if known else None
            log = replace(log, prior=log.prior._replace(cov=noise**2 * 1e-4 * np.eye(3), map=given))
            off.append(apart(run("ekf", log)[1], run(name, log)[1]))
        assert 1e-9 < off[1] < 0.015 * off[0]


@pytest.mark.parametrize("each", [False, True])
@pytest.mark.parametrize("name", OURS)
def test_all_constant_errors_are_those_of_the_ekf(name: str, each: bool) -> None:
    """Scale and offset of ranges, for all or each, and a compass' offset."""
    log = drive(4, steps=200, kinds=(RANGE, BEARING), fix_every=5, compass=True, noise=0.02).log
    assert log.partial is not None
    assert log.fixes is not None
    longer = np.where(log.partial.kind == RANGE, 1.05 * log.partial.z + 0.1, log.partial.z)
    turned = log.fixes.z + np.array([0.0, 0.0, 0.03])
    prior = log.prior._replace(systematic=Systematic(0.1, 0.3, 0.1, each))
    wrong = replace(log, prior=prior, partial=replace(log.partial, z=longer), fixes=replace(log.fixes, z=turned))
    expected, filter_ = run("ekf", wrong), run(name, wrong)
    assert apart(filter_[1], expected[1]) < 5e-3
    right = run(name, log)
    assert apart(filter_[1][-50:], right[1][-50:]) < 0.01
    if not each:
        assert filter_[0].range_errors == pytest.approx((0.05, 0.1), abs=0.02)


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("name", OURS)
def test_localisation_on_a_given_map(name: str, fixed: bool) -> None:
    """A map held fixed, outside of the state, does what one of little covariance does in it."""
    log = drive(7, steps=100, kinds=(RANGE, BEARING), noise=0.1).log
    maps = [Map(np.arange(4), BEACONS, cov) for cov in (None if fixed else 1e-2 * np.eye(8), 1e-12 * np.eye(8))]
    found = [run(name, replace(log, prior=log.prior._replace(map=one))) for one in maps]
    assert found[0][0].pairs == (0 if fixed else 4)
    if fixed:
        assert apart(found[0][1], found[1][1]) < 1e-5
        np.testing.assert_array_equal(found[0][0].map().xy, BEACONS)
    else:
        expected = run("ekf", replace(log, prior=log.prior._replace(map=maps[0])))
        assert apart(found[0][1], expected[1]) < 0.02


def with_sightings(made: Drive) -> Log:
    """The drive with whole sightings of two marks, 7 and 8, from its middle on."""
    rng, steps = np.random.default_rng(1), list(made.log)
    marks = np.array([[3.0, 3.0], [-2.0, 6.0]])
    for k in range(60, len(steps)):
        d = marks - made.path[k, :2]
        z = np.column_stack((np.hypot(*d.T), wrap(np.arctan2(d[:, 1], d[:, 0]) - made.path[k, 2])))
        z += 0.02 * rng.standard_normal((2, 2))
        steps[k] = steps[k]._replace(sightings=RangeBearing(np.array([7, 8]), z, np.tile(4e-4 * np.eye(2), (2, 1, 1))))
    return Log.from_steps("mixed", made.log.prior, steps)


@pytest.mark.parametrize("name", OURS)
def test_whole_sightings_beside_partial_ones_and_what_is_expected_then(name: str) -> None:
    """Also after kept poses have left the state, and the numbers of landmarks are others."""
    made = drive(9, steps=200)
    log = with_sightings(made)
    build = FILTERS[name].build
    filter_ = build.make(log.prior, build.options(), np.random.default_rng(0))
    sizes = list[int]()
    for step in log:
        if len(step.sightings.ids):
            seen = filter_.expected(step.odometry, step.sightings, 50.0)
            found = filter_.map()
            assert set(seen.ids.tolist()) <= set(found.ids.tolist())
            if {7, 8} <= set(found.ids.tolist()):
                assert {7, 8} <= set(seen.ids.tolist())
        filter_.step(step)
        sizes.append(filter_.pairs)
    assert max(sizes) > 6
    assert sizes[-1] == 6
    assert sorted(filter_.map().ids.tolist()) == [0, 1, 2, 3, 7, 8]
    expected = run("ekf", log)[1]
    assert apart(run(name, log)[1], expected) < 0.1


def test_loop_closures_beside_late_starts() -> None:
    """The invariant EKF has both sorts of kept poses: at low noise it is the EKF, its smoothed path too."""
    made = drive(6, steps=120, kinds=(RANGE, BEARING), noise=0.02)
    steps, rng = list(made.log), np.random.default_rng(2)
    for k in range(30, 120, 10):
        delta = compose(between(made.path[k - 25], made.path[k]), 1e-4 * rng.standard_normal(3))
        steps[k] = steps[k]._replace(loops=RelativePoses(np.array([k - 25]), delta[None], 1e-8 * np.eye(3)[None]))
    log = Log.from_steps("loops", made.log.prior, steps)
    ours, theirs = (run(name, log) for name in ("invariant-ekf", "ekf"))
    assert apart(ours[1], theirs[1]) < 1e-3
    path, expected = ours[0].finish(), theirs[0].finish()
    assert apart(path.path, expected.path) < 1e-3
    ours_sd, theirs_sd = (np.sqrt(np.diagonal(one.cov, axis1=1, axis2=2)) for one in (path, expected))
    np.testing.assert_allclose(ours_sd, theirs_sd, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", DRIVES)
@pytest.mark.parametrize("name", OURS)
def test_it_is_consistent(name: str, case: str) -> None:
    """NEES of 20 drives within 0.5 to 2."""
    total = []
    for seed in range(20):
        made = drive(seed, steps=300, **DRIVES[case])
        _, path, covs = run(name, made.log)
        off = path - made.path
        off[:, 2] = wrap(off[:, 2])
        total.append(np.einsum("ni,ni->n", off, np.linalg.solve(covs, off[..., None])[..., 0])[1:].mean() / 3)
    assert 0.5 < np.mean(total) < 2
