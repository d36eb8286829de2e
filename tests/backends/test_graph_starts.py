"""Initial values of the batch: cheap ones where their fit is to be trusted, and never a higher J for it."""

from typing import Any

import gtsam
import numpy as np
import pytest

from driven import final
from grid_graphs import grid_graph, misstated
from random_logs import random_log
from slamduel.backends.graphs.batch import Batch
from slamduel.backends.graphs.distances import FEW, of_loops, of_sightings, unevenness
from slamduel.backends.graphs.first_values import by_headings
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Log, Map
from slamduel.core.se2 import Array, wrap
from slamduel.datasets import registry as datasets
from slamduel.datasets.cache import generator
from tiers import first_quick

NOISE = {
    "true": (1.0, 1.0),
    "large": (5.0, 5.0),
    "small": (0.5, 0.5),
    "large of loops": (1.0, 5.0),
    "large of motions": (5.0, 1.0),
}
"""Stated noise of motions and of loop closures, in the true one."""

NO_MAP = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)


def made(name: str, seed: int, **options: Any) -> Log:
    source = datasets.find(name)
    return source.make(source.options(**options), generator(name, seed)).log.identified()


def cost(log: Log, **options: Any) -> float:
    found = final("graph", log, joint_up_to=0, **options)
    return misfit(log, found.path, found.map).total


def forbidden(*_: object) -> None:
    raise AssertionError("a start in chunks was not needed")


# --- what is chosen


@pytest.mark.parametrize("wrong", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("noise", first_quick(NOISE, 2))
def test_it_never_ends_higher_than_from_chunks(noise: str, wrong: float) -> None:
    """Eight draws each, of good and bad odometry, with false loop closures, and noise stated well or badly."""
    for seed in range(8):
        log = misstated(grid_graph(seed, 200, turns=(1.0, 4.0)[seed % 2], wrong=wrong), *NOISE[noise])
        assert cost(log) <= cost(log, start="incremental") * (1 + 1e-6)


@pytest.mark.parametrize("noise", first_quick(NOISE, 1))
def test_a_share_of_pose_graphs_with_good_odometry_needs_no_chunks(noise: str, monkeypatch: pytest.MonkeyPatch) -> None:
    used = list[int]()
    start = Batch.start_by_chunks
    monkeypatch.setattr(Batch, "start_by_chunks", lambda self: (used.append(1), start(self)))
    for seed in range(8):
        cost(misstated(grid_graph(seed, turns=0.3), *NOISE[noise]))
    assert len(used) <= 2


def test_good_odometry_to_landmarks_needs_no_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Batch, "start_by_chunks", forbidden)
    for seed in range(8):
        cost(made("bailey", seed))


@pytest.mark.parametrize("scale", [0.01, 1.0, 2.5])
def test_what_is_chosen_does_not_depend_on_the_scale_of_all_noise(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to where all of it is stated a third of what it is; there it costs time alone."""
    log = misstated(grid_graph(1, turns=0.5), 1 / scale, 1 / scale)
    monkeypatch.setattr(Batch, "start_by_chunks", forbidden)
    cost(log)


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_bad_odometry_is_not_trusted(seed: int) -> None:
    """Huang's circle: dead reckoning leads to another minimum, thousands of times as high."""
    log = made("circle", seed, steps=800)
    assert cost(log) == pytest.approx(cost(log, start="incremental"), rel=1e-9)


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_few_loop_closures_tell_nothing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    log = grid_graph(seed, 120, share=0.03)
    assert len(log.loop_to) < FEW
    used = list[int]()
    start = Batch.start_by_chunks
    monkeypatch.setattr(Batch, "start_by_chunks", lambda self: (used.append(1), start(self)))
    assert cost(log) <= cost(log, start="incremental") * (1 + 1e-6)
    assert len(used) == 2 if len(log.loop_to) else 1


# --- the trust


def test_distances_of_one_distribution_are_even_whatever_their_scale() -> None:
    log = grid_graph(2, turns=0.3)
    best = final("graph", log)
    for scale in (0.01, 1.0, 2.0):
        assert unevenness(misstated(log, 1 / scale, 1 / scale), best.path, NO_MAP) < 1.0
    assert unevenness(misstated(log, 0.1, 0.1), best.path, NO_MAP) == np.inf
    assert unevenness(log.head(30).without_loops(), best.path[:30], NO_MAP) == 0.0


def test_distances_are_uneven_where_a_part_of_the_path_is_wrong() -> None:
    log = grid_graph(2, turns=0.3)
    path = final("graph", log).path.copy()
    path[-30:, :2] += 0.5
    assert unevenness(log, path, NO_MAP) > 1.0


def test_distances_are_those_that_j_is_the_sum_of() -> None:
    log = random_log(np.random.default_rng(3), 60, 9, noise=0.5, blind=0.0).log
    found = final("graph", log)
    assert misfit(log, found.path, found.map).sightings == pytest.approx(
        of_sightings(log, found.path, found.map).sum(), rel=1e-9
    )
    graph = grid_graph(0, 100)
    path = final("graph", graph).path
    assert len(of_loops(graph, path)) == len(graph.loop_to)


# --- headings


def test_headings_are_the_least_squares_of_motions_and_loops() -> None:
    log = grid_graph(4, 150)
    n, start = len(log), log.dead_reckoned()
    a, b = np.concatenate((np.arange(n - 1), log.loop_to)), np.concatenate((np.arange(1, n), log.loop_step))
    rows, sd = np.arange(len(a)), np.sqrt(np.concatenate((log.delta_cov[1:, 2, 2], log.loop_cov[:, 2, 2])))
    turned = np.concatenate((log.delta[1:, 2], log.loop_delta[:, 2]))
    A = np.zeros((len(a), n))
    A[rows, b], A[rows, a] = 1.0, -1.0
    off = np.linalg.lstsq(A[:, 1:] / sd[:, None], wrap(turned - start[b, 2] + start[a, 2]) / sd)[0]
    assert wrap(by_headings(log)[1:, 2] - start[1:, 2] - off) == pytest.approx(0, abs=1e-9)


def test_without_loops_they_are_those_of_dead_reckoning() -> None:
    log = grid_graph(4, 80).without_loops()
    path, reckoned = by_headings(log), log.dead_reckoned()
    assert path[:, :2] == pytest.approx(reckoned[:, :2], abs=1e-9)
    assert wrap(path[:, 2] - reckoned[:, 2]) == pytest.approx(0, abs=1e-9)


# --- GTSAM's


def of_steps(log: Log, path: Array) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The factors that are made step by step."""
    from slamduel.backends.graphs._gtsam import Factors, pose2

    factors = Factors(log.prior, at_once=True)
    graph, values = factors.prior()
    for k, step in enumerate(log):
        more, more_values = factors.step(k, step, pose2(path[k]))
        graph.push_back(more)
        values.insert(more_values)
    return graph, values


@pytest.mark.parametrize("kind", ["landmarks", "loops"])
def test_all_factors_at_once_are_those_of_the_steps(kind: str) -> None:
    from slamduel.backends.graphs._gtsam import Factors
    from slamduel.backends.graphs.gtsam_whole import whole

    made = random_log(np.random.default_rng(6), 50, 8, noise=0.5).log if kind == "landmarks" else grid_graph(6, 80)
    graph, values = whole(Factors(made.prior, at_once=True), made, made.dead_reckoned())
    other, others = of_steps(made, made.dead_reckoned())
    assert (graph.size(), values.size()) == (other.size(), others.size())
    assert values.equals(others, 1e-9)
    assert graph.error(values) == pytest.approx(other.error(others), rel=1e-9)


@pytest.mark.parametrize("linear", ["multifrontal-cholesky", "multifrontal-qr", "multifrontal-solver"])
@pytest.mark.parametrize("algorithm", ["levenberg-marquardt", "gauss-newton", "dogleg"])
def test_gtsam_s_optimizers_end_at_one_optimum(algorithm: str, linear: str) -> None:
    log = grid_graph(7, 120, turns=0.3)
    best = cost(log, solver="gtsam")
    assert cost(log, solver="gtsam", algorithm=algorithm, linear=linear) == pytest.approx(best, rel=1e-7)


@pytest.mark.parametrize("start", ["auto", "headings", "odometry", "incremental"])
def test_gtsam_ends_at_one_optimum_from_every_start(start: str) -> None:
    log = grid_graph(8, 120, turns=0.3)
    best = cost(log)
    assert best <= cost(log, solver="gtsam", start=start) <= best * 1.01  # another residual of motions


def test_gtsam_does_without_isam2_where_odometry_is_good(monkeypatch: pytest.MonkeyPatch) -> None:
    from slamduel.backends.graphs.gtsam_batch import GtsamBatch

    monkeypatch.setattr(GtsamBatch, "_smoothed", forbidden)
    cost(grid_graph(9, turns=0.3), solver="gtsam")
    with pytest.raises(AssertionError, match="not needed"):
        cost(made("circle", 3, steps=400), solver="gtsam")
