"""The patrol: the same round for days, what stands on its way, and what does not stay there."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, kstest

import slamduel
from drawn_errors import errors, known, seen
from refusals import refused
from slamduel.backends import registry as backends
from slamduel.bench.measure.nees import nees
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import check
from slamduel.core.se2 import Array, between, wrap
from slamduel.core.truth.check import check_truth
from slamduel.datasets.cache import generator
from slamduel.datasets.patrol.furniture import rearranged
from slamduel.datasets.patrol.in_view import NEAREST
from slamduel.datasets.patrol.patrol import DEPTH, SIZE, Options, patrol
from slamduel.datasets.patrol.people import CLEAR
from slamduel.datasets.patrol.rounds import TURNING, WANDERING, driven, places, rounds
from slamduel.datasets.worlds.floor_plan import Plan, floor_plan
from tiers import first_quick

ROUND = 356  # steps of a round of the building of seed 0


def made(seed: int = 0, **options: Any) -> Dataset:
    dataset = patrol(Options(**options), generator("patrol", seed))
    check(dataset.log, "patrol")
    assert dataset.truth is not None
    check_truth(dataset.log, dataset.truth, "patrol")
    return dataset


@pytest.fixture(scope="module")
def plain() -> Dataset:
    return made()


def plan(seed: int = 0) -> Plan:
    return floor_plan(*SIZE, DEPTH, generator("patrol", seed).spawn(1)[0])


def blocked(walls: Array, start: Array, end: Array) -> int:
    """How many walls the segment from `start` to `end` crosses."""
    a, b = walls[:, :2], walls[:, 2:]

    def side(p: Array, q: Array, r: Array) -> Array:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    apart = side(a, b, start) * side(a, b, end) < 0
    return int((apart & (side(start, end, a) * side(start, end, b) < 0)).sum())


def points(dataset: Dataset) -> Array:
    """(s, 2) where each sighting has its landmark, from the true pose."""
    log, truth = dataset
    assert truth is not None
    poses = truth.poses[log.sighting_step]
    bearing = poses[:, 2] + log.z[:, 1]
    return poses[:, :2] + log.z[:, :1] * np.stack((np.cos(bearing), np.sin(bearing)), axis=-1)


def test_every_round_is_the_same_but_for_where_the_robot_wanders(plain: Dataset) -> None:
    """Written independently: the poses of two rounds at the same times since they began."""
    path = rounds(plan(), 0.5, np.random.default_rng(0))
    t = path.period * np.array([0.1, 0.7, 0.1 + 1, 0.7 + 3, 0.1 + 1000])
    poses = driven(path, t, np.random.default_rng(1)).poses
    for one, other in ((0, 2), (0, 4), (1, 3)):
        assert np.abs(poses[one, :2] - poses[other, :2]).max() <= 2 * WANDERING
        assert abs(wrap(poses[one, 2] - poses[other, 2])) < 1e-9
    assert plain.log.notes["rounds"] == 1 + 1999 // ROUND
    before, after = (known(plain)[0].poses[k::ROUND] for k in (10, 11))
    assert np.abs(before - before[0])[:, :2].max() < 2 * WANDERING + 0.5
    assert np.hypot(*(after - before)[:, :2].T).max() < 0.51


def test_a_round_ends_where_it_began_and_goes_through_no_wall() -> None:
    for seed in range(3):
        building = generator("patrol", seed).spawn(1)[0]
        floor = floor_plan(*SIZE, DEPTH, building)
        path = rounds(floor, 0.5, building)
        np.testing.assert_allclose(places(path, np.array([0.0])), path.xy[:1])
        np.testing.assert_allclose(path.xy[-1], path.xy[0])
        assert np.cos(path.turned) == pytest.approx(1)
        way = places(path, np.linspace(0, path.period, 2000, endpoint=False))
        assert sum(blocked(floor.walls, *leg) for leg in itertools.pairwise(way)) == 0


def test_the_robot_is_no_faster_than_it_says() -> None:
    truth, _ = known(made(steps=1000, speed=1.0, interval=0.2))
    moved = between(truth.poses[:-1], truth.poses[1:])
    assert np.hypot(*moved[:, :2].T).max() < 0.2 * 1.01  # with its drift beside the round
    assert np.abs(moved[:, 2]).max() <= 0.2 * TURNING + 1e-9


def test_landmarks_are_on_walls_and_each_is_sighted(plain: Dataset) -> None:
    _, landmarks = known(plain)
    assert len(landmarks.ids) == 120
    assert plain.log.notes["landmarks sighted"] == len(np.unique(plain.log.ids)) == 120
    a, b = plan().walls[:, :2], plan().walls[:, 2:]
    for xy in landmarks.xy:
        share = np.clip(((xy - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0, 1)
        assert np.hypot(*(a + share[:, None] * (b - a) - xy).T).min() < 0.021


def test_what_is_sighted_is_near_and_hardly_ever_behind_a_wall(plain: Dataset) -> None:
    """The view is that from the middle of the round, and the robot may be 0.3 m beside it."""
    truth, landmarks = known(plain)
    poses = truth.poses[plain.log.sighting_step]
    away = np.hypot(*(landmarks.xy[plain.log.ids] - poses[:, :2]).T)
    assert away.min() >= NEAREST
    assert away.max() <= Options().reach
    some = range(0, len(away), 10)
    hidden = [blocked(plan().walls, poses[k, :2], landmarks.xy[plain.log.ids[k]]) > 0 for k in some]
    assert np.mean(hidden) < 0.06
    unseen = [k for k in range(0, 2000, 40) if len(plain.log[k].sightings.ids) < in_sight(plain, k) - 4]
    assert len(unseen) < 5


def in_sight(dataset: Dataset, k: int) -> int:
    """How many landmarks are near the robot at step k, with no wall in between."""
    truth, landmarks = known(dataset)
    pose = truth.poses[k, :2]
    away = np.hypot(*(landmarks.xy - pose).T)
    near = landmarks.xy[(away >= NEAREST) & (away <= Options().reach)]
    return sum(not blocked(plan().walls, pose, xy) for xy in near)


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_every_error_is_drawn_from_the_stated_covariance(seed: int) -> None:
    found = errors(made(seed))
    assert kstest(found.sightings_squared, chi2(2).cdf).pvalue > 1e-4
    assert kstest(found.motions_squared, chi2(3).cdf).pvalue > 1e-4


def final_nees(dataset: Dataset) -> float:
    """Of the exact smoother's poses."""
    log, truth = dataset
    assert truth is not None
    builder = backends.find("smoother")
    smoother = builder.make(log.prior, builder.options(), np.random.default_rng(0))
    for step in log:
        smoother.step(step)
    solution = smoother.finish()
    assert solution is not None
    assert solution.cov is not None
    return float(nees(solution.path, solution.cov, truth.poses).mean() / 3)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"landmarks": 0, "loops": 5}, {"loops": 20}])
def test_the_optimum_is_as_far_from_the_truth_as_it_says(options: dict[str, Any]) -> None:
    """The NEES of 30 logs: errors along a path hang together, so that that of one log is anywhere from 0.3 to 3."""
    found = [final_nees(made(seed, steps=700, **options)) for seed in range(30)]
    assert np.mean(found) == pytest.approx(1, abs=4 * np.std(found) / np.sqrt(len(found)))
    assert np.std(found) < 1


def test_a_log_is_made_again_and_a_seed_is_another_building(plain: Dataset) -> None:
    assert made().log.digest == plain.log.digest != made(1).log.digest
    assert not np.array_equal(plan(0).walls[:30], plan(1).walls[:30])


def test_a_longer_log_begins_with_the_shorter_one(plain: Dataset) -> None:
    """In what does not depend on the number of draws: the path of the rounds, and what is seen from it."""
    long, short = made(steps=2500, loops=9), plain
    assert np.abs(known(long)[0].poses[:1900, 2] - known(short)[0].poses[:1900, 2]).max() == 0
    np.testing.assert_array_equal(known(long)[1].xy, known(short)[1].xy)


def test_loops_are_between_rounds_and_true() -> None:
    log, truth = made(loops=5, loop_sd=0.02, loop_turn=0.005)
    assert truth is not None
    step, to = log.loop_step, log.loop_to
    assert (step % 5 == 0).all()
    assert step[0] >= ROUND
    assert len(step) == len(range(-(-(ROUND + 1) // 5) * 5, 2000, 5))
    assert (step - to).min() > ROUND - 2
    assert len(np.unique((step - to) // (ROUND - 1))) > 3  # to any earlier round
    right = between(truth.poses[to], truth.poses[step])
    assert np.hypot(*right[:, :2].T).max() < 2 * WANDERING * np.sqrt(2) + 0.26
    off = log.loop_delta - right
    off[:, 2] = wrap(off[:, 2])
    np.testing.assert_allclose(log.loop_cov, np.broadcast_to(np.diag([4e-4, 4e-4, 2.5e-5]), log.loop_cov.shape))
    assert kstest((off**2 / [4e-4, 4e-4, 2.5e-5]).sum(axis=1), chi2(3).cdf).pvalue > 1e-4


def test_loops_change_nothing_else_and_may_be_all_there_is(plain: Dataset) -> None:
    both, alone = made(loops=10).log, made(landmarks=0, loops=10).log
    for name in ("t", "delta", "ids", "z"):
        np.testing.assert_array_equal(getattr(both, name), getattr(plain.log, name))
    assert len(alone.ids) == 0
    assert len(alone.loop_to) == len(both.loop_to) > 100


def test_furniture_is_elsewhere_every_day_and_walls_are_not(plain: Dataset) -> None:
    dataset = made(furniture=0.3, day=2, sighting=1e-4)
    log, truth = dataset
    assert truth is not None
    assert truth.map is not None
    assert truth.moving is not None
    assert 20 <= len(truth.moving) <= 55
    day = np.arange(2000) // (2 * ROUND)  # nearly: a round is 356 steps and a bit
    found, sure = points(dataset), np.minimum(np.arange(2000) % (2 * ROUND), -np.arange(2000) % (2 * ROUND)) > 10
    for landmark in truth.map.ids.tolist():
        rows = np.flatnonzero((log.ids == landmark) & sure[log.sighting_step])
        where = [found[rows[day[log.sighting_step[rows]] == k]] for k in range(3)]
        for one in where:
            assert len(one) == 0 or np.ptp(one, axis=0).max() < 0.01
        middles = np.array([one.mean(axis=0) for one in where if len(one)])
        if landmark in truth.moving:
            assert np.abs(middles - truth.map.xy[landmark]).max() < 1.01
            assert len(middles) < 2 or np.abs(np.diff(middles, axis=0)).max() > 0.02
        else:
            np.testing.assert_allclose(middles, np.broadcast_to(truth.map.xy[landmark], middles.shape), atol=1e-3)
    first = plain.log.sighting_first[2 * ROUND - 5]
    again = made(furniture=0.3, day=2).log
    np.testing.assert_allclose(again.z[:first], plain.log.z[:first], atol=1e-12)  # on the first day
    np.testing.assert_array_equal(again.delta, plain.log.delta)


def test_a_larger_share_of_furniture_has_that_of_a_smaller_in_the_same_places() -> None:
    few, many = (made(furniture=share, day=1) for share in (0.1, 0.4))
    assert few.truth is not None
    assert many.truth is not None
    assert set(few.truth.moving.tolist()) < set(many.truth.moving.tolist())
    for landmark in few.truth.moving.tolist():
        np.testing.assert_array_equal(few.log.z[few.log.ids == landmark], many.log.z[many.log.ids == landmark])


def test_furniture_out_of_reach_is_not_sighted() -> None:
    dataset = made(furniture=1.0, day=1, furniture_moves=10.0)
    assert dataset.truth is not None
    poses = dataset.truth.poses[dataset.log.sighting_step]
    away = np.hypot(*(points(dataset) - poses[:, :2]).T)
    assert away.max() < Options().reach + 6 * 0.05
    assert len(dataset.log.ids) < 0.7 * len(made().log.ids)


def test_errors_of_sightings_stay_where_nothing_is_moved_far(plain: Dataset) -> None:
    """Equivalence: all are furniture that is moved by nothing."""
    log, truth = plain
    assert truth is not None
    day = np.arange(len(log)) // 500
    same, _ = rearranged(log, truth, 1.0, day, 0.0, 100.0, np.random.default_rng(0))
    np.testing.assert_allclose(same.z, log.z, atol=1e-12)
    np.testing.assert_array_equal(same.ids, log.ids)


@pytest.mark.parametrize("ids", ["unknown", "meeting"])
def test_people_are_sighted_in_the_corridor_and_are_nobody(plain: Dataset, ids: str) -> None:
    dataset = made(people=4, people_ids=ids)
    log, truth = dataset
    assert truth is not None
    assert truth.assigned is not None
    people = truth.assigned == UNKNOWN
    assert people.sum() == log.notes["sightings of people"] > 100
    np.testing.assert_array_equal(log.z[~people], plain.log.z)
    np.testing.assert_array_equal(log.ids[~people], plain.log.ids)
    poses, where = truth.poses[log.sighting_step[people]], points(dataset)[people]
    away = np.hypot(*(where - poses[:, :2]).T)
    assert away.min() > CLEAR - 6 * 0.05
    assert away.max() < Options().reach + 6 * 0.05
    ring = plan().ring
    (left, low), (right, top) = ring.min(axis=0), ring.max(axis=0)
    sides = np.stack((np.abs(where[:, 0] - left), np.abs(where[:, 0] - right), np.abs(where[:, 1] - low)))
    assert np.minimum(sides.min(axis=0), np.abs(where[:, 1] - top)).max() < 1.1
    if ids == "unknown":
        assert (log.ids[people] == UNKNOWN).all()
    else:
        names, first, count = np.unique(log.ids[people], return_index=True, return_counts=True)
        assert names.min() == 120
        assert 10 < len(names) < people.sum() / 2
        steps = log.sighting_step[people]
        for name in names.tolist():  # short-lived, without a gap, and no faster than people walk
            own = log.ids[people] == name
            assert (np.diff(steps[own]) == 1).all()
            assert np.hypot(*np.diff(where[own], axis=0).T).max(initial=0) < 1.3 * np.sqrt(2) + 0.6
        assert count.max() < 200
        assert len(first) == len(names)


def test_people_are_not_seen_through_walls() -> None:
    dataset = made(people=10, sighting=1e-4)
    assert dataset.truth is not None
    assert dataset.truth.assigned is not None
    rows = np.flatnonzero(dataset.truth.assigned == UNKNOWN)[::20]
    poses, where = dataset.truth.poses[dataset.log.sighting_step[rows], :2], points(dataset)[rows]
    assert sum(blocked(plan().walls, a, b) for a, b in zip(poses, where, strict=True)) == 0


def test_sightings_of_what_stays_fit_its_place_whatever_else_happens() -> None:
    log, truth = made(people=3, furniture=0.3, day=1, loops=9, clutter=0.2, wrong_ids=0.02, missing=0.1)
    assert truth is not None
    assert truth.assigned is not None
    assert truth.map is not None
    assert truth.moving is not None
    stays = (truth.assigned != UNKNOWN) & ~np.isin(truth.assigned, truth.moving)
    off = log.z[stays] - seen(truth.poses[log.sighting_step[stays]], truth.map.xy[truth.assigned[stays]])
    off[:, 1] = wrap(off[:, 1])
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(log.z_cov[stays]), off)
    assert kstest(squares, chi2(2).cdf).pvalue > 1e-4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"furniture": 0.1, "moving": 0.1}, r"option moving=0\.1: expected none beside furniture=0\.1"),
        ({"loops": 5, "kidnap": 900.0}, r"option kidnap=900: expected 0 beside loops"),
        ({"people": 5, "furniture": 0.1, "kidnap": 900.0}, r"expected 0 beside furniture and people"),
    ],
)
def test_options_that_contradict_each_other_are_refused(options: dict[str, Any], said: str) -> None:
    refused(said, made, **options)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("patrol[landmarks=0,map=foreign]", "option map=foreign: there is no landmark"),
        ("patrol[landmarks=0,map=surveyed]", "option map=surveyed: there is no landmark"),
        ("patrol[landmarks=0,loops=5,ranges_only=1]", "option ranges_only has no effect without landmarks"),
        ("patrol[landmarks=0,loops=5,bearings_only=0.5]", "option bearings_only has no effect without landmarks"),
        ("patrol[landmarks=0,loops=5,signature_sd=0.5]", "option signature_sd has no effect without landmarks"),
        ("patrol[false_loops=0.1]", "has no loop closures"),
        ("patrol[day=3]", "day"),
        ("patrol[steps=2000000]", "steps"),
        ("patrol[people_ids=meeting]", "people_ids"),
    ],
)
def test_bad_options_are_refused_in_a_sentence(text: str, said: str) -> None:
    refused(said, slamduel.load, text)


def test_options_of_all_worlds_apply() -> None:
    log, truth = slamduel.load(
        "patrol[steps=800,loops=5,false_loops=0.1,ids=0.2,ranges_only=0.2,gyro=0.1,people=2,slip_share=0.1]"
    )
    assert log.gyro is not None
    assert log.partial is not None
    assert truth is not None
    assert truth.false_loops is not None
    assert len(truth.false_loops) == round(0.1 * (len(log.loop_to) - len(truth.false_loops)))
    assert (log.ids == UNKNOWN).sum() > (truth.assigned == UNKNOWN).sum() > 0
