"""The batch solver against dense and sparse Gauss-Newton and GTSAM, from every start, on every kind of log."""

import os
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

import plain_motions
from against_dense import KINDS, agrees, dense, of_kind
from batch_fit import Fit, fitted
from driven import NO_LOOPS, NO_SIGHTINGS, final
from random_logs import random_log
from slamduel.backends.api import Diverged, Solution
from slamduel.backends.common_options import LOSSES
from slamduel.backends.graphs import batch, graduated
from slamduel.backends.graphs.first_values import first_values
from slamduel.backends.graphs.gauss_newton import STILL
from slamduel.bench.measure.misfit import misfit, misfits
from slamduel.core.factors import Log, Map, Odometry, Prior, RangeBearing, Step
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets import registry as datasets
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.outliers import swapped
from tiers import first_quick

STARTS = ("auto", "headings", "incremental", "odometry")


def optimum(log: Log, **options: Any) -> Solution:
    return final("graph", log, **options)


def total(log: Log, solution: Solution) -> float:
    return misfit(log, solution.path, solution.map).total


def made(name: str, **options: Any) -> Log:
    source = datasets.find(name)
    return source.make(source.options(**options), generator(name, 3)).log.identified()


def shipped(kind: str, file: str) -> Log:
    return made(kind, path=gtsam.findExampleDataFile(file))


def recorded(name: str, **options: Any) -> Log:
    if "SLAMDUEL_DATA" not in os.environ:
        pytest.skip("SLAMDUEL_DATA is not set: no copy of published logs")
    return made(name, path=str(Path(os.environ["SLAMDUEL_DATA"]) / name), **options)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("seed", first_quick(range(15), 5))
def test_it_is_the_dense_optimum_with_all_covariances(seed: int, start: str) -> None:
    rng = np.random.default_rng(seed)
    sizes = int(rng.integers(3, 60)), int(rng.integers(3, 20))
    log = of_kind(KINDS[seed % 5], random_log(rng, *sizes, noise=0.5, blind=float(rng.uniform(0, 0.9))), rng)
    agrees(log, optimum(log, start=start))


@pytest.mark.parametrize("loss", first_quick(["cauchy", "huber", "geman-mcclure"]))
def test_with_a_loss_it_ends_where_reweighted_least_squares_do(loss: str) -> None:
    log, truth = random_log(np.random.default_rng(5), 60, 8, noise=0.3, blind=0.0)
    assert truth is not None
    wrong = swapped(log, truth, 0.05, np.random.default_rng(6)).log
    found = optimum(wrong, loss=loss)
    best = dense(wrong, found, 40, loss=loss, scale=LOSSES[loss])
    assert found.path == pytest.approx(best.path, abs=1e-5)
    assert found.map.xy == pytest.approx(np.array([best.xy[i] for i in found.map.ids.tolist()]), abs=1e-5)


# --- other solvers

SMALL = {
    "random": lambda: of_kind("loops", random_log(np.random.default_rng(1), 60, 12), np.random.default_rng(2)),
    "circle": lambda: made("circle", steps=150),
    "toy": lambda: shipped("g2o", "noisyToyGraph.txt"),
    "pose2example": lambda: shipped("g2o", "pose2example.txt"),
    "w100": lambda: shipped("toro", "w100.graph"),
    "example": lambda: shipped("gtsam", "example.graph"),
}


@pytest.mark.parametrize("name", SMALL)
def test_gtsam_finds_the_same_optimum_of_the_same_cost(name: str) -> None:
    """Levenberg-Marquardt with GTSAM's factors but for the motions', which are ours, from GTSAM's own optimum."""
    log = SMALL[name]()
    start = optimum(log, solver="gtsam")
    J, path, places = plain_motions.optimised(log, start.path, start.map)
    found = optimum(log)
    assert total(log, found) == pytest.approx(J, rel=1e-9)
    assert found.path[:, :2] == pytest.approx(path[:, :2], abs=1e-5)
    assert wrap(found.path[:, 2] - path[:, 2]) == pytest.approx(0, abs=1e-5)
    there = np.array([places[i] for i in found.map.ids.tolist()]).reshape(-1, 2)
    assert found.map.xy == pytest.approx(there, abs=1e-5)


LARGE = {
    "aruco-room": lambda: made("aruco-room"),
    "bailey": lambda: made("bailey"),
    "circle": lambda: made("circle"),
    "victoria-park": lambda: made("victoria-park"),
    "city 100": lambda: made("city", landmarks=100, steps=3000),
    "city 1000": lambda: made("city", landmarks=1000, steps=5000),
    "dlr": lambda: recorded("dlr"),
    "freiburg": lambda: recorded("freiburg"),
    **{f"mrclam {robot}": lambda robot=robot: recorded("mrclam", robot=robot) for robot in range(1, 6)},
    "cityTrees": lambda: shipped("gtsam", "cityTrees_reduced_1k.g2o"),
    "w100_30": lambda: shipped("gtsam", "w100_30.g2o"),
}

SEVERAL = ("mrclam 3", "mrclam 5")
"""Logs with gross errors among the sightings: J has many minima, and undamped Gauss-Newton leads away from them."""


def sparse_optimum(log: Log, path: Array, landmarks: Map) -> Fit:
    """Gauss-Newton until nothing moves by more than a tenth of a micrometre."""
    fit = fitted(log, path, 2, landmarks)
    while fit.furthest > 1e-7:
        fit = fitted(log, fit.path, 2, Map(fit.ids, fit.xy, None))
    return fit


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_sparse_gauss_newton_from_gtsam_s_optimum_ends_there_too(name: str) -> None:
    """GTSAM's optimum is of another J. Where undamped Gauss-Newton leads away, its next step is none at least."""
    log = LARGE[name]()
    found = optimum(log)
    if name in SEVERAL:
        best = fitted(log, found.path, 1, found.map)
    else:
        start = optimum(log, solver="gtsam")
        best = sparse_optimum(log, start.path, start.map)
    assert total(log, found) == pytest.approx(best.cost, rel=1e-9)
    assert found.path[:, :2] == pytest.approx(best.path[:, :2], abs=1e-5)
    assert wrap(found.path[:, 2] - best.path[:, 2]) == pytest.approx(0, abs=1e-5)
    places = dict(zip(found.map.ids.tolist(), found.map.xy, strict=True))
    assert np.array([places[i] for i in best.ids.tolist()]).reshape(-1, 2) == pytest.approx(best.xy, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("file", "J"), [("w10000.graph", 289.833648), ("w20000.txt", 37.520941)])
def test_the_largest_pose_graphs_end_where_another_start_does(file: str, J: float) -> None:
    log = shipped("gtsam" if file.endswith("txt") else "toro", file)
    made = batch.Batch(log, 0, 0.0)
    made.start_by_chunks()
    assert made.fit(1e-13, 100).cost == pytest.approx(J, rel=1e-7)


def test_both_solvers_stand_next_to_one_another() -> None:
    """Two J, which differ to third order in the residuals of motions; their optima within a hundredth of an sd."""
    log = random_log(np.random.default_rng(20), 150, 15, noise=0.5).log
    ours, theirs = optimum(log), optimum(log, solver="gtsam")
    assert ours.cov is not None
    sd = np.sqrt(np.einsum("nii->ni", ours.cov))
    assert (np.abs(wrap(ours.path - theirs.path)) < 0.02 * sd).all()
    assert total(log, ours) <= total(log, theirs)
    assert ours.map.cov == pytest.approx(theirs.map.cov, rel=0.02, abs=1e-6)
    assert theirs.cov is None


# --- starts


def test_a_start_in_chunks_needs_no_odometry_to_speak_of() -> None:
    """On Huang's circle dead reckoning leads to another minimum, thousands of times as high."""
    log = made("circle")
    best, reckoned = total(log, optimum(log)), total(log, optimum(log, start="odometry"))
    assert best < 2 * (2 * len(log.ids))  # its mean is the number of residuals less that of unknowns
    assert reckoned > 10 * best


def test_chunks_go_on_from_steps_at_which_nothing_is_seen() -> None:
    """Chunks that end in the middle of a blind stretch: the next one begins where the motions lead from there."""
    motion = Odometry(np.array([0.5, 0.0, 0.3]), np.diag([1e-4, 1e-4, 1e-4]))
    z, z_cov = np.array([[3.0, 0.4], [2.0, -0.6]]), np.tile(np.diag([1e-3, 1e-3]), (2, 1, 1))
    sees = {k: RangeBearing(np.array([2 * k, 2 * k + 1]), z, z_cov) for k in (0, 150, 320, 333)}
    steps = [Step(float(k), motion if k else None, sees.get(k, NO_SIGHTINGS), NO_LOOPS) for k in range(400)]
    log = Log.from_steps("blind", Prior(np.zeros(3), 1e-6 * np.eye(3)), steps)
    made = batch.Batch(log, 0, 0.0)
    made.start_by_chunks()
    assert made.fit(1e-13, 5).cost == pytest.approx(0.0, abs=1e-12)  # nothing is seen twice: dead reckoning it is
    backend, reckoned = optimum(log), Log.from_steps("", log.prior, steps)
    assert between(backend.path[:-1], backend.path[1:]) == pytest.approx(reckoned.delta[1:], abs=1e-9)


@pytest.mark.parametrize("turned", [0.01, 0.1, 10.0])
def test_chunks_are_of_at_most_a_hundred_steps_and_turns_that_are_known(
    turned: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "TURNED", turned)
    log = random_log(np.random.default_rng(3), 350, 10).log
    ends = batch.chunks(log)
    assert ends[-1] == len(log)
    for first, end in zip([0, *ends], ends, strict=False):
        inside = log.delta_cov[max(first, 1) : end, 2, 2].sum()
        assert 1 <= end - first <= 100
        assert inside <= turned**2 * (1 + 1e-9) or end - first == 1
        further = log.delta_cov[max(first, 1) : end + 1, 2, 2].sum()
        assert end - first == 100 or end == len(log) or further > turned**2


def test_a_landmark_starts_at_the_mean_of_its_sightings_by_their_information() -> None:
    rng = np.random.default_rng(4)
    poses = rng.uniform(-3, 3, (40, 3))
    which = np.repeat([0, 1], 20)
    z = np.column_stack((rng.uniform(1, 5, 40), rng.uniform(-3, 3, 40)))
    root = rng.normal(size=(40, 2, 2)) * np.array([0.1, 0.02])[:, None]
    cov = root @ root.swapaxes(1, 2) + np.diag([1e-3, 1e-4])
    found = first_values(poses, z, cov, which, 2)
    for k in (0, 1):
        matrix, right = np.zeros((2, 2)), np.zeros(2)
        for pose, (r, b), C in zip(poses[which == k], z[which == k], cov[which == k], strict=True):
            c, s = np.cos(pose[2] + b), np.sin(pose[2] + b)
            J = np.array([[c, -r * s], [s, r * c]])
            W = np.linalg.inv(J @ C @ J.T)
            matrix += W
            right += W @ (pose[:2] + r * np.array([c, s]))
        assert found[k] == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)


# --- what is left out


def test_graduated_non_convexity_leaves_out_what_gtsam_s_does() -> None:
    log, truth = random_log(np.random.default_rng(30), 120, 12, noise=0.3, blind=0.0)
    assert truth is not None
    wrong = swapped(log, truth, 0.1, np.random.default_rng(1)).log
    ours, theirs = optimum(wrong, gnc=True), optimum(wrong, gnc=True, solver="gtsam")
    assert ours.path == pytest.approx(theirs.path, abs=1e-3)
    left_out = [misfits(wrong, solution.path, solution.map) for solution in (ours, theirs)]
    first, second = (distances > graduated.INLIER for distances in left_out if distances is not None)
    assert (first == second).all()
    assert (first == (wrong.ids != log.ids)).mean() > 0.99


@pytest.mark.parametrize("kind", ["joint", "fixed"])
def test_graduated_non_convexity_with_a_given_map(kind: str) -> None:
    rng = np.random.default_rng(31)
    made = random_log(rng, 80, 10, noise=0.3, blind=0.0)
    log = of_kind(kind, made, rng)
    assert made.truth is not None
    wrong = swapped(log, made.truth, 0.05, np.random.default_rng(1)).log
    ours, theirs = optimum(wrong, gnc=True), optimum(wrong, gnc=True, solver="gtsam")
    assert ours.path == pytest.approx(theirs.path, abs=1e-3)


# --- at the limits


def test_where_the_cost_is_flat_there_is_an_optimum_without_covariances() -> None:
    """A landmark that is sighted from its own place, where its bearing may be anything."""
    log = random_log(np.random.default_rng(26), 30, 5, noise=0.3).log
    steps = list(log)
    touched = RangeBearing(np.array([10**9]), np.zeros((1, 2)), np.diag([0.01, 0.1])[None])
    steps[10] = steps[10]._replace(sightings=touched)
    found = optimum(Log.from_steps("touched", log.prior, steps))
    assert np.isfinite(found.path).all()
    assert 10**9 in found.map.ids


@pytest.mark.parametrize("start", STARTS)
def test_what_cannot_be_solved_ends_with_a_sentence(start: str) -> None:
    steps = list(random_log(np.random.default_rng(9), 20, 5).log)
    flat = list(steps)
    flat[10] = flat[10]._replace(odometry=Odometry(np.zeros(3), np.zeros((3, 3))))
    with pytest.raises(Diverged, match="not positive definite"):
        optimum(Log.from_steps("flat", Prior(np.zeros(3), np.eye(3)), flat), start=start)
    bad = RangeBearing(np.array([1]), np.array([[np.nan, 0.0]]), np.eye(2)[None])
    steps[4] = steps[4]._replace(sightings=bad)
    with pytest.raises(Diverged):
        optimum(Log.from_steps("nan", Prior(np.zeros(3), np.eye(3)), steps), start=start)


def test_the_iterations_are_bounded() -> None:
    log = random_log(np.random.default_rng(10), 40, 8, noise=2.0).log
    made = batch.Batch(log, 0, 0.0)
    made.start_by_odometry()
    assert made.fit(1e-13, 1).iterations == 1
    rest = made.fit(1e-13, 100)
    assert 1 <= rest.iterations < 30
    assert made.fit(1e-13, 100).iterations == 1
    assert STILL < 1e-5
