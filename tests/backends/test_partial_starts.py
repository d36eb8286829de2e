"""The batch of logs with ranges alone: the least J, from dead reckoning that is far off, too."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
import pytest

from beacon_drives import drive
from driven import final
from slamduel.backends.api import Solution
from slamduel.backends.graphs import own_batch
from slamduel.backends.graphs.batch import Batch
from slamduel.backends.graphs.elsewhere import lowest
from slamduel.backends.graphs.graph_options import Options
from slamduel.backends.smoothing.valleys import here
from slamduel.backends.starting.placing import are_apart, placed, places
from slamduel.bench.measure.misfit import misfit
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log
from slamduel.core.partial import RANGE
from slamduel.core.se2 import Array, compose
from slamduel.datasets.formats.pose_graph import START

LEAST = {15: 35699.144503, 16: 7660.494749}
"""Of J of the dives in GTSAM's package: twice GTSAM's error."""

TENFOLD = 10.0
"""Times their noise by which motions of a start are off: by some 0.4 rad at the end of the first dive."""


def dive(number: int) -> Log:
    return load(f"goats[log={number}]")[0]


def optimum(log: Log, along: Array | None = None, start: str = "auto") -> Solution:
    return own_batch.optimum(log.prior, Options(start=start, joint_up_to=0), list(log), along)


def cost(log: Log, found: Solution) -> float:
    fit = misfit(log, found.path, found.map)
    assert fit is not None
    return fit.total


def perturbed(log: Log, seed: int, times: float = TENFOLD) -> Array:
    """A path (n, 3) by dead reckoning whose motions are off by `times` their noise."""
    rng, path = np.random.default_rng(seed), [log.prior.pose]
    for delta, cov in zip(log.delta[1:], log.delta_cov[1:], strict=True):
        path.append(compose(path[-1], delta + times * rng.multivariate_normal(np.zeros(3), cov)))
    return np.array(path)


# --- the dives


@pytest.mark.parametrize("number", LEAST)
def test_nine_of_ten_dives_from_a_start_that_is_far_off_end_at_the_least_j(number: int) -> None:
    log = dive(number)
    costs = np.array([cost(log, optimum(log, perturbed(log, seed), "odometry")) for seed in range(10)])
    assert costs.min() > LEAST[number] * (1 - 1e-6)
    assert (costs < LEAST[number] * (1 + 1e-6)).sum() >= 9


@pytest.mark.parametrize("number", LEAST)
def test_it_is_the_optimum_of_gtsams_own_factors_of_the_file(number: int) -> None:
    found = optimum(dive(number))
    graph, values = native(Path(gtsam.findExampleDataFile(f"goats_{number}.pyfg")), found)
    error = graph.error(values)
    assert 2 * error == pytest.approx(LEAST[number], rel=1e-6)
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-14)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, params)
    optimizer.optimize()
    assert error == pytest.approx(optimizer.error(), rel=1e-6)


def native(path: Path, found: Solution) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The file's rows as GTSAM's factors, with the prior of a log without one, and a solution as values."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, pose in enumerate(found.path):
        values.insert(gtsam.symbol("a", k), gtsam.Pose2(*pose))
    for landmark, xy in zip(found.map.ids.tolist(), found.map.xy, strict=True):
        values.insert(gtsam.symbol("l", landmark), xy)
    for row in path.read_text().splitlines():
        tag, *words = row.split()
        keys = [gtsam.symbol(word[0].lower(), int(word[1:])) for word in words if word[0] in "AL"]
        one, other = (*keys, 0, 0)[:2]
        numbers = [float(word) for word in words if word[0] not in "AL"]
        if tag == "EDGE_SE2":
            x, y, turn, *six = numbers[1:]
            cov = np.zeros((3, 3))
            cov[np.triu_indices(3)] = six
            noise = gtsam.noiseModel.Gaussian.Covariance(cov + np.triu(cov, 1).T)
            graph.add(gtsam.BetweenFactorPose2(one, other, gtsam.Pose2(x, y, turn), noise))
        elif tag == "EDGE_RANGE":
            noise = gtsam.noiseModel.Isotropic.Sigma(1, np.sqrt(numbers[2]))
            graph.add(gtsam.RangeFactor2D(one, other, numbers[1], noise))
    noise = gtsam.noiseModel.Gaussian.Covariance(START * np.eye(3))
    graph.add(gtsam.PriorFactorPose2(gtsam.symbol("a", 0), gtsam.Pose2(), noise))
    return graph, values


def mirrored(log: Log) -> Log:
    """All to the other side."""
    sign = np.array([1.0, -1.0, -1.0])
    delta, cov = sign * log.delta, log.delta_cov * np.outer(sign, sign)
    return replace(log, delta=delta, delta_cov=cov)


def renamed(log: Log) -> Log:
    """Ids the other way round."""
    assert log.partial is not None
    return replace(log, partial=replace(log.partial, ids=100 - log.partial.ids))


def turned(log: Log) -> Log:
    """Another start, in the world."""
    return replace(log, prior=log.prior._replace(pose=np.array([1000.0, -300.0, 2.0])))


@pytest.mark.parametrize("change", [mirrored, renamed, turned])
@pytest.mark.parametrize("number", LEAST)
def test_side_names_and_place_do_not_matter(number: int, change: Callable[[Log], Log]) -> None:
    log = change(dive(number))
    assert cost(log, optimum(log, perturbed(log, 1), "odometry")) == pytest.approx(LEAST[number], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2])
def test_three_solvers_agree_to_a_millimetre_on_plaza(number: int) -> None:
    log, _ = load(f"plaza[log={number}]")
    mine = final("graph", log, loss="cauchy", joint_up_to=0)
    for backend, options in (("graph", {"solver": "gtsam", "joint_up_to": 0}), ("isam2", {})):
        other = final(backend, log, loss="cauchy", **options)
        assert other.converged is not False
        assert np.hypot(*(other.path - mine.path)[:, :2].T).max() < 1e-3


# --- the parts


def test_a_straight_way_leaves_two_places_by_ranges_open() -> None:
    poses = np.column_stack((np.linspace(0, 5, 11), np.zeros((11, 2))))
    z = np.hypot(poses[:, 0] - 2, 3)
    found = places(poses, np.full(11, RANGE), z, np.full(11, 0.01))
    assert len(found) == 2
    np.testing.assert_allclose(sorted(one[1] for one in found), [-3, 3], atol=1e-6)
    np.testing.assert_allclose([one[0] for one in found], 2, atol=1e-6)
    assert are_apart(found[0], found[1], poses[-1])
    assert not are_apart(found[0], found[0] + 1e-3, poses[-1])


def test_a_ring_is_flat_before_a_landmark_starts() -> None:
    """Half a turn about a beacon 20 m away places it: roughly from the first ranges on, and for sure only later."""
    angle = np.linspace(0, 1.0, 200)
    poses = np.column_stack((20 * np.sin(angle), 20 * (1 - np.cos(angle)), angle))
    beacon = np.array([3.0, -19.0])
    z, kind = np.hypot(*(beacon - poses[:, :2]).T), np.full(200, RANGE)
    started = []
    for sd in (0.5, 0.01):
        found = [placed(poses[:k], kind[:k], z[:k], np.full(k, sd**2)) for k in range(2, 201)]
        sure = [one for one in found if one is not None and one.sure]
        assert sure
        started.append(len(found) - len(sure))
        for one in sure:
            spread = np.sqrt(np.linalg.eigvalsh(one.cov)[-1])
            away = np.hypot(*(poses[:, :2] - beacon).T).min()
            assert spread**2 / (2 * away) < 0.11 * sd
    assert started[0] > started[1]


def test_a_beacon_on_the_wrong_side_is_put_right() -> None:
    log = drive(0).log
    right = Batch(log, 0, 0.0)
    right.start_by_odometry()
    right.fit(1e-13, 100)
    path, landmarks = right.place()
    xy = landmarks.xy.copy()
    xy[0] = -3 * xy[0]
    wrong = Batch(log, 0, 0.0)
    wrong.start_at(path, landmarks._replace(xy=xy))
    wrong.fit(1e-13, 2)
    found = lowest(wrong, log.dead_reckoned(), lambda: Batch(log, 0, 0.0))
    found.fit(1e-13, 100)
    assert here(found.forest) == pytest.approx(here(right.forest), rel=1e-6)


def test_a_fit_without_a_landmark_beside_the_others_is_left_as_it_is() -> None:
    log = drive(1).log
    batch = Batch(log, 0, 0.0)
    batch.start_by_odometry()
    batch.fit(1e-13, 100)

    def refused() -> Batch:
        raise AssertionError("nothing was to be tried")

    assert lowest(batch, log.dead_reckoned(), refused) is batch
