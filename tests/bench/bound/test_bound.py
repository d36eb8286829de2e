"""The bound is what is found by hand, by a dense inverse, and by the errors of estimators that are efficient."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import slamduel
from beacon_drives import BEACONS, Drive, drive
from dense_information import DenseInformation
from driven import aligned_error, final, run
from gyro_logs import small_gyro_log, with_gyro
from random_logs import random_log
from slamduel.bench.bound.bound import bound, no_bound
from slamduel.bench.bound.filtered import filtered
from slamduel.bench.bound.known_log import known_log
from slamduel.core.factors import UNKNOWN, Dataset, Log, Map, Prior, Systematic, Truth
from slamduel.core.fixes import FixTable
from slamduel.core.gyro import Bias, Gyro
from slamduel.core.partial import BEARING, RANGE
from slamduel.core.se2 import Array, between, wrap
from slamduel.core.truth.errors import rows_of
from small_log import small_log
from tiers import first_quick

PLACES = Map(np.arange(len(BEACONS)), BEACONS, None)


def truth_of(found: Drive) -> Truth:
    return Truth(found.log.t, found.path, PLACES)


def test_two_steps_by_hand() -> None:
    """Of x and y alike: 4 m^2 at first, 1 more by the motion, and a position with 5."""
    exact, nan = 1e-12, np.nan
    fix = FixTable.from_arrays(2, np.array([1]), np.array([[1, 0, nan]]), np.diag([5, 5, nan])[None] + 0 * nan_off())
    log = Log.from_arrays(
        "two",
        Prior(np.zeros(3), np.diag([4, 4, exact])),
        np.arange(2.0),
        np.array([[nan] * 3, [1, 0, 0]]),
        np.tile(np.diag([1, 1, exact]), (2, 1, 1)),
        *(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2))),
        fixes=fix,
    )
    found = bound(log, Truth(log.t, np.array([[0, 0, 0], [1, 0, 0.0]])))
    assert found is not None
    # before: 4; then (5 + 5)^-1 of 5 is left: 2.5; the first is 4 - 4^2 / 10 = 2.4 by all, its covariance with the
    # second 4 - 4 * 5 / 10 = 2; their mean's square is taken away by a shift
    origin = (np.sqrt(2 * (4 + 2.5) / 2), np.sqrt(2 * (2.4 + 2.5) / 2))
    shifted = (np.sqrt(2 * (6.5 - (6.5 + 4) / 2) / 2), np.sqrt(2 * (4.9 - (4.9 + 4) / 2) / 2))
    assert found == pytest.approx((*shifted, *origin), rel=1e-6)


def nan_off() -> Array:
    """NaN in the rows and columns that are not measured."""
    out = np.zeros((1, 3, 3))
    out[:, 2], out[:, :, 2] = np.nan, np.nan
    return out


WITH_SCALE: dict[str, Any] = {"scale_sd": 0.05}
KINDS: list[dict[str, Any]] = [
    WITH_SCALE,
    {"kinds": (BEARING,)},
    {"kinds": (RANGE, BEARING), "fix_every": 7, "compass": True},
]


@pytest.mark.parametrize("options", KINDS, ids=("ranges", "bearings", "all"))
def test_filter_and_smoother_are_the_dense_inverse(options: dict[str, Any]) -> None:
    made = drive(0, steps=24, **options)
    log, n = made.log, len(made.log)
    if options is not WITH_SCALE:
        log = replace(log, prior=log.prior._replace(systematic=Systematic(heading_offset=0.1)))
    online, joint = DenseInformation(log, made.path, PLACES).covariances()
    known = known_log(log, truth_of(made))
    assert known is not None
    weights = np.random.default_rng(0).normal(size=(2, n, 2))
    found = filtered(known, weights)
    assert found.cov == pytest.approx(online, rel=1e-4, abs=1e-9)
    stacked = np.zeros((2, len(joint)))
    for axis in (0, 1):
        stacked[:, axis : 3 * n : 3] = weights[:, :, axis]
    assert found.final == pytest.approx(np.einsum("ai,ij,aj->a", stacked, joint, stacked), rel=1e-4)
    whole = bound(log, truth_of(made))
    assert whole is not None
    squares = np.diagonal(joint)[: 3 * n].reshape(n, 3)[:, :2].sum()
    assert whole.final_origin == pytest.approx(np.sqrt(squares / n), rel=1e-6)


def test_loop_closures_whole_sightings_and_a_given_map_are_the_dense_inverse() -> None:
    log = small_log(1).identified()
    assert log.prior.map is not None
    ids = np.unique(np.concatenate((log.ids, log.prior.map.ids)))
    path = log.dead_reckoned()
    places = Map(ids, np.random.default_rng(3).normal(0, 4, (len(ids), 2)), None)
    known = known_log(log, Truth(log.t, path, places))
    assert known is not None
    assert len(known.log.loop_to)
    online, joint = DenseInformation(known.log, path, places).covariances()
    assert filtered(known, np.zeros((0, len(log), 2))).cov == pytest.approx(online, rel=1e-5, abs=1e-9)
    found = bound(log, Truth(log.t, path, places))
    assert found is not None
    squares = np.diagonal(joint)[: 3 * len(log)].reshape(-1, 3)[:, :2].sum()
    assert found.final_origin == pytest.approx(np.sqrt(squares / len(log)), rel=1e-5)


def turning(seed: int, steps: int = 24, **of_gyro: Any) -> tuple[Log, Truth]:
    """A drive with a gyro of which much hangs: its odometry does not tell the heading well."""
    rng = np.random.default_rng(seed)
    found, truth = with_gyro(random_log(rng, steps, 5, noise=0.3), rng, **of_gyro)[0]
    assert truth is not None
    return found, truth


def against_dense(log: Log, truth: Truth) -> None:
    """Covariances of filter and smoother, those of random sums, and the bounds are those of the dense inverse."""
    assert truth.map is not None
    n, weights = len(log), np.random.default_rng(0).normal(size=(2, len(log), 2))
    known = known_log(log, truth)
    assert known is not None
    online, joint = DenseInformation(known.log, truth.poses, truth.map).covariances()
    found = filtered(known, weights)
    np.testing.assert_allclose(found.cov, online, rtol=1e-4, atol=1e-9)
    stacked = np.zeros((2, len(joint)))
    for axis in (0, 1):
        stacked[:, axis : 3 * n : 3] = weights[:, :, axis]
    np.testing.assert_allclose(found.final, np.einsum("ai,ij,aj->a", stacked, joint, stacked), rtol=1e-4)
    whole = bound(log, truth)
    assert whole is not None
    for of_all, covs in ((whole.final_origin, joint), (whole.online_origin, online)):
        squares = np.diagonal(covs, axis1=-2, axis2=-1).ravel()[: 3 * n].reshape(n, 3)[:, :2].sum()
        assert of_all == pytest.approx(np.sqrt(squares / n), rel=1e-4)


@pytest.mark.parametrize("walk", [0.0, 5e-3])
@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_turns_by_a_gyro_are_the_dense_inverse(seed: int, walk: float) -> None:
    """Of each seed another treatment: a gyro at all steps, one that begins late, and one that pauses."""
    log, truth = turning(seed, every=5, walk=walk)
    assert log.gyro is not None
    rows = np.arange(len(log.gyro))
    kept = [rows >= 0, rows >= 9, (rows < 6) | (rows > 12)][seed % 3]
    against_dense(replace(log, gyro=log.gyro.rows(kept)), truth)


def test_turns_with_loops_a_map_and_fixes_are_the_dense_inverse() -> None:
    log = small_gyro_log().identified()
    assert log.prior.map is not None
    ids = np.unique(np.concatenate((log.ids, log.prior.map.ids)))
    places = Map(ids, np.random.default_rng(3).normal(0, 4, (len(ids), 2)), None)
    assert len(log.loop_to)
    against_dense(log, Truth(log.t, log.dead_reckoned(), places))
    made = drive(0, steps=24, scale_sd=0.05, fix_every=7, compass=True)
    gyrated, _ = with_gyro(Dataset(made.log, truth_of(made)), np.random.default_rng(1), every=6)
    against_dense(gyrated.log, truth_of(made))


def test_the_bound_with_turns_is_the_covariance_of_the_batch_at_the_truth() -> None:
    """Measurements that are what the truth makes of them have their optimum there, and the batch its covariance."""
    log, truth = turning(3, steps=40, every=8, walk=2e-3)
    gyro = log.gyro
    assert gyro is not None
    assert truth.map is not None
    at, places = truth.poses[log.sighting_step], truth.map.xy[rows_of(truth.map.ids, log.ids)]
    delta = between(truth.poses[:-1], truth.poses[1:])
    away = places - at[:, :2]
    z = np.column_stack((np.hypot(*away.T), wrap(np.arctan2(away[:, 1], away[:, 0]) - at[:, 2])))
    exact = replace(
        log,
        prior=log.prior._replace(pose=truth.poses[0]),
        delta=np.concatenate((log.delta[:1], delta)),
        z=z,
        gyro=Gyro.from_arrays(gyro.step, delta[:, 2], gyro.var, gyro.dt, gyro.walk, gyro.prior),
    )
    found, solved = bound(exact, truth), final("graph", exact)
    assert found is not None
    assert solved.cov is not None
    np.testing.assert_allclose(solved.path, truth.poses, atol=1e-7)
    squares = solved.cov[:, [0, 1], [0, 1]].sum()
    assert found.final_origin == pytest.approx(np.sqrt(squares / len(log)), rel=1e-5)


def test_a_gyro_lowers_the_bound_the_more_the_better_its_bias_is_known() -> None:
    log, truth = turning(5, steps=60, sd=1e-4)
    gyro = log.gyro
    assert gyro is not None

    def of(bias: float | None) -> Array:
        turns = None
        if bias is not None:
            turns = Gyro.from_arrays(gyro.step, gyro.turn, gyro.var, gyro.dt, bias=Bias(0.0, bias))
        found = bound(replace(log, gyro=turns), truth)
        assert found is not None
        return np.array((found.online_origin, found.final_origin))

    falling = [of(bias) for bias in (None, 0.1, 0.02, 0.0)]
    assert (np.diff(falling, axis=0) < 0).all()
    np.testing.assert_allclose(of(1e4), of(1e3), rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "end"), [("graph", "final"), ("ekf", "online")])
def test_estimates_with_turns_have_the_bound_over_seeds(name: str, end: str) -> None:
    """Means of squares over 60 logs, which hold to some seven in a hundred in the root."""
    ratios = list[float]()
    for seed in range(60):
        log, truth = turning(seed, steps=80, every=10)
        found = bound(log, truth)
        assert found is not None
        path = final(name, log).path if end == "final" else run(name, log)[1]
        ratios.append(aligned_error(path, truth.poses) / getattr(found, end))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1, abs=0.15)


def test_an_optimum_over_seeds_has_the_bound() -> None:
    """Means of squares over 60 logs, which hold to a tenth in the root."""
    ratios = list[float]()
    for seed in range(60):
        made = drive(seed, steps=60, kinds=(RANGE, BEARING))
        found = bound(made.log, truth_of(made))
        assert found is not None
        ratios.append(aligned_error(final("graph", made.log).path, made.path) / found.final)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
def test_a_filter_over_seeds_has_the_bound() -> None:
    ratios = list[float]()
    for seed in range(60):
        made = slamduel.load("matlab-report", seed=seed)
        found = bound(*made)
        assert found is not None
        assert made.truth is not None
        ratios.append(aligned_error(run("ekf", made.log)[1], made.truth.poses) / found.online)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1, abs=0.15)


def test_what_is_wrong_in_a_log_does_not_count() -> None:
    made = slamduel.load("circle[steps=60]")
    hidden = slamduel.load("circle[steps=60,ids=hidden]")
    assert bound(*hidden) == pytest.approx(bound(*made), rel=1e-9)


def test_a_gap_of_the_truth_is_filled_and_not_judged() -> None:
    made = drive(1, steps=60)
    whole, kept = truth_of(made), np.r_[:20, 30:60]
    some, all_of_it = bound(made.log, whole._replace(t=whole.t[kept], poses=whole.poses[kept])), bound(made.log, whole)
    assert some is not None
    assert all_of_it is not None
    assert some.final != all_of_it.final
    assert some.final == pytest.approx(all_of_it.final, rel=0.2)


def test_no_bound_without_what_it_takes() -> None:
    made = drive(0, steps=20)
    log, truth = made.log, truth_of(made)
    assert bound(log, None) is None
    assert bound(log, truth._replace(kind="reference")) is None
    assert bound(log, truth._replace(map=Map(PLACES.ids[1:], PLACES.xy[1:], None))) is None
    assert bound(replace(log, prior=log.prior._replace(start="unknown")), truth) is None
    assert bound(log, truth._replace(map=Map(np.arange(500), np.tile(PLACES.xy, (125, 1)), None))) is None
    assert log.partial is not None
    nameless = replace(log.partial, ids=np.where(log.partial.step == 3, UNKNOWN, log.partial.ids))
    assert bound(replace(log, partial=nameless), truth) is None
    assert bound(replace(log, partial=nameless), truth._replace(assigned_partial=log.partial.ids)) == bound(log, truth)
    at_robot = PLACES.xy.copy()
    at_robot[log.partial.ids[0]] = made.path[0, :2]
    assert bound(log, truth._replace(map=Map(PLACES.ids, at_robot, None))) is None


def test_the_reason_of_a_missing_bound_is_said() -> None:
    made = drive(0, steps=20)
    log, truth = made.log, truth_of(made)
    assert log.partial is not None
    nameless = replace(log.partial, ids=np.where(log.partial.step == 3, UNKNOWN, log.partial.ids))
    many = truth._replace(map=Map(np.arange(500), np.tile(PLACES.xy, (125, 1)), None))
    some = truth._replace(map=Map(PLACES.ids[1:], PLACES.xy[1:], None))
    said = {
        no_bound(log, truth): "",
        no_bound(log, None): "the true path is unknown",
        no_bound(log, truth._replace(map=None)): "the landmarks' places are unknown",
        no_bound(replace(log, prior=log.prior._replace(start="unknown")), truth): "the robot's start is unknown",
        no_bound(replace(log, partial=nameless), truth): "the true ids of sightings are unknown",
        no_bound(log, many): "there are too many landmarks, or poses that loop closures come back to",
    }
    assert all(found == expected for found, expected in said.items())
    assert len(said) == 6
    assert no_bound(log, some) == "the landmarks' places are unknown"
