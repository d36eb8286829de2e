"""Filters that keep poses for loop closures: against whole matrices, exact theory, and the batch optimum."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from dense_delayed import DelayedEkf, DelayedInvariantEkf, densest, relative, with_loops
from dense_invariant import derivative, hat
from driven import asking_changes_nothing, final, make, rmse
from laps import laps
from random_logs import random_log
from slamduel.backends.api import Diverged, Solution
from slamduel.backends.gaussian import _loops, _triangle, compressed
from slamduel.backends.gaussian.kept_poses import KeptPoses
from slamduel.backends.invariant import _invariant_loops
from slamduel.bench.check.small_logs import dead_reckoned
from slamduel.core.factors import Dataset, Log, RelativePoses
from slamduel.core.se2 import Array, Ints, between, compose, wrap
from tiers import first_quick

DENSE, COMPRESSED = 10**6, 0
GATE, LOOP_GATE = 0.99, 11.344866730144373
"""A probability, and its quantile of chi-square with 3 degrees of freedom, from a table."""


@pytest.fixture(autouse=True)
def small_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part so small that it is settled with the rest every few steps."""
    monkeypatch.setattr(compressed, "MOST", 15)
    monkeypatch.setattr(compressed, "KEPT", 4)


def both(seed: int, steps: int, landmarks: int = 8, share: float = 0.3, noise: float = 1.0) -> tuple[Log, Dataset]:
    rng = np.random.default_rng(seed)
    dataset = random_log(rng, steps, landmarks, radius=4.0, noise=noise)
    return with_loops(rng, dataset, share, noise=noise), dataset


def matched(log: Log, filters: list[Any], dense: DelayedEkf) -> None:
    """Path, beliefs, counts, map and, where all poses are kept, the solution."""
    for k, step in enumerate(log):
        expected = dense.step(step)
        for one in filters:
            pose, belief = one.step(step), one.belief()
            assert np.abs(pose[:2] - expected[:2]).max() < 1e-9, k
            assert abs(wrap(pose[2] - expected[2])) < 1e-9, k
            assert belief.cov == pytest.approx(dense.cov[:3, :3], abs=1e-9 * np.abs(dense.cov[:3, :3]).max()), k
            assert abs((belief.nis or 0.0) - dense.nis) <= 1e-6 * (1 + dense.nis), k
            counts = belief.nis_dof, belief.refused, belief.left_out
            assert counts == (dense.nis_dof, dense.refused, dense.left_out), k
    landmarks = [one for one in dense.ids if one >= 0]
    rows = np.array([3 + 2 * dense.ids.index(one) + i for one in landmarks for i in (0, 1)], np.int64)
    for one in filters:
        found = one.map()
        order = np.array([landmarks.index(i) for i in found.ids.tolist()], np.int64)
        at = rows.reshape(-1, 2)[order].ravel()
        assert len(found.ids) == len(landmarks)
        assert found.xy.ravel() == pytest.approx(dense.mean[at], abs=1e-8)
        assert found.cov == pytest.approx(dense.cov[np.ix_(at, at)], rel=1e-6, abs=1e-9)
        solution = one.finish()
        if len(dense.kept) < len(log):
            assert solution is None
            continue
        assert solution.map.cov == pytest.approx(found.cov, rel=1e-12)
        for k in range(len(log)):
            pose, cov = dense.pose(k)
            assert np.abs(between(pose, solution.path[k])).max() < 1e-8
            assert solution.cov[k] == pytest.approx(cov, abs=1e-8 * np.abs(cov).max())


@pytest.mark.parametrize(
    ("update", "jacobians"),
    first_quick(
        [
            ("joint", "ideal"), ("sequential", "standard"), ("sequential", "ideal"), ("joint", "standard"),
            ("sequential", "first-estimates"), ("joint", "first-estimates"),
        ],
        quick=2,
    ),
)  # fmt: skip
def test_it_is_the_delayed_state_filter_of_whole_matrices(update: str, jacobians: str) -> None:
    log, dataset = both(1, 120)
    assert len(log.loop_to) > 50
    truth = dataset.truth if jacobians == "ideal" else None
    dense = DelayedEkf(log.prior, together=update == "joint", jacobians=jacobians, truth=truth)
    filters = [
        make("ekf", log.prior, jacobians=jacobians, update=update, compress_above=above)
        for above in (DENSE, COMPRESSED)
    ]
    for one in filters:
        if truth is not None:
            assert one.tell(truth)
    matched(log, filters, dense)


@pytest.mark.parametrize("most", [1, 2, 12])
@pytest.mark.parametrize("landmarks", [0, 8])
def test_poses_that_are_no_longer_kept_are_left_out_of_the_state_exactly(most: int, landmarks: int) -> None:
    log, _ = both(2, 100, landmarks, share=0.5)
    dense = DelayedEkf(log.prior, most=most)
    filters = [make("ekf", log.prior, poses=most, compress_above=above) for above in (DENSE, COMPRESSED)]
    matched(log, filters, dense)
    assert len(dense.kept) == most


def test_the_gate_has_three_degrees_of_freedom_and_bears_wrong_loops() -> None:
    log, dataset = both(3, 120, share=0.5)
    rng, steps = np.random.default_rng(4), list(log)
    for k in range(20, 120, 9):
        wrong = rng.uniform(-3, 3, (1, 3))
        steps[k] = steps[k]._replace(loops=RelativePoses(np.array([k - 15]), wrong, 1e-3 * np.eye(3)[None]))
    bad = Log.from_steps("wrong", log.prior, steps)
    options: dict[str, Any] = {"gate": GATE, "gate_after": 0}
    dense = DelayedEkf(bad.prior, gate=-2 * np.log(1 - GATE), confirm=0, loop_gate=LOOP_GATE)
    matched(bad, [make("ekf", bad.prior, **options, compress_above=above) for above in (DENSE, COMPRESSED)], dense)
    truth = dataset.truth.poses
    clean, gated, plain = (
        rmse(final("ekf", on, **chosen).path, truth) for on, chosen in ((log, {}), (bad, options), (bad, {}))
    )
    assert gated < 1.5 * clean
    assert plain > 3 * clean


def test_many_loops_at_one_step_are_taken_in_passes() -> None:
    log, dataset = both(5, 60, share=0.0)
    steps, poses = list(log), dataset.truth.poses
    to = np.arange(50)
    delta = between(poses[to], poses[55]) + 0.01
    delta[:, 2] = wrap(delta[:, 2])
    steps[55] = steps[55]._replace(loops=RelativePoses(to, delta, np.tile(0.03**2 * np.eye(3), (50, 1, 1))))
    many = Log.from_steps("many", log.prior, steps)
    filters = [make("ekf", many.prior, compress_above=above) for above in (DENSE, COMPRESSED)]
    matched(many, filters, DelayedEkf(many.prior))
    invariant_agrees(many)


def invariant_agrees(log: Log) -> None:
    ours, dense = make("invariant-ekf", log.prior), DelayedInvariantEkf(log.prior)
    for step in log:
        pose, expected = ours.step(step), dense.step(step)
        assert np.abs(between(expected, pose)).max() < 1e-8
        belief, plain = ours.belief(), dense.plain()
        cov = (plain @ dense.cov @ plain.T)[np.ix_([1, 2, 0], [1, 2, 0])]
        assert belief.cov == pytest.approx(cov, abs=1e-8 * np.abs(cov).max())
        assert (belief.nis or 0.0) == pytest.approx(dense.nis + dense.loops_nis, rel=1e-6, abs=1e-8)
    plain, found, solution = dense.plain(), ours.map(), ours.finish()
    assert found.ids.tolist() == dense.ids
    assert found.xy == pytest.approx(dense.state[:2, 3:].T, abs=1e-8)
    assert found.cov == pytest.approx((plain @ dense.cov @ plain.T)[3:, 3:], abs=1e-8)
    for k in range(len(log)):
        pose, cov = dense.pose(k)
        assert np.abs(between(pose, solution.path[k])).max() < 1e-8
        assert solution.cov[k] == pytest.approx(cov, abs=1e-8 * np.abs(cov).max())


@pytest.mark.parametrize("landmarks", [0, 8])
def test_the_invariant_one_is_the_papers_with_elements_of_their_own_for_kept_poses(landmarks: int) -> None:
    log, _ = both(6, 100, landmarks)
    invariant_agrees(log)


@pytest.mark.parametrize("fixed", [True, False])
def test_the_invariant_one_on_a_given_map(fixed: bool) -> None:
    log, dataset = both(7, 60)
    known = dataset.truth.map
    half = known._replace(ids=known.ids[::2], xy=known.xy[::2])
    cov = None if fixed else 0.01 * np.eye(2 * len(half.ids))
    invariant_agrees(Log.from_steps("given", log.prior._replace(map=half._replace(cov=cov)), list(log)))


def test_the_invariant_one_drops_poses_as_the_other_does() -> None:
    """Dropping is exact in both: their estimates differ by linearisation alone, small where the noise is."""
    log, _ = both(8, 100, 0, share=0.5, noise=1e-3)
    ekf, invariant = (make(name, log.prior, poses=12) for name in ("ekf", "invariant-ekf"))
    for step in log:
        apart = between(ekf.step(step), invariant.step(step))
        mine, its = ekf.belief(), invariant.belief()
        assert np.abs(apart).max() < 1e-3 * np.sqrt(np.diag(mine.cov).max())
        assert mine.left_out == its.left_out
        assert its.cov == pytest.approx(mine.cov, abs=1e-3 * np.abs(mine.cov).max())


def test_jacobians_of_a_loop_closure_are_the_derivatives() -> None:
    rng = np.random.default_rng(9)
    for _ in range(20):
        here, there = rng.uniform(-3, 3, (2, 3))
        H = np.empty((3, 6))
        z = np.array(_loops.relative(here, there[0], there[1], there[2], H))
        assert between(there, here) == pytest.approx(z, abs=1e-12)
        both = np.concatenate((here, there))
        expected = derivative(lambda d, at=both: relative(at[:3] + d[:3], at[3:] + d[3:]), 6)
        assert pytest.approx(expected, abs=1e-12) == H


def test_the_invariant_innovation_is_the_difference_of_errors_whatever_the_estimate() -> None:
    """By central differences of 1e-5, which are off by 1e-10 of third derivatives."""
    rng, step = np.random.default_rng(10), 1e-5
    for _ in range(10):
        here, there = rng.uniform(-3, 3, (2, 3))
        common = rng.uniform(-0.5, 0.5, 3)  # an error of both
        z = between(moved(common, there), moved(common, here))
        assert innovation(here, there, z)[0] == pytest.approx(np.zeros(3), abs=1e-9)
        exact = between(there, here)
        _, N = innovation(here, there, exact)
        for i, e in enumerate(step * np.eye(3)):
            of_error = [innovation(here, there, between(there, moved(sign * e, here)))[0] for sign in (1, -1)]
            of_noise = [innovation(here, there, exact + sign * e)[0] for sign in (1, -1)]
            assert (of_error[0] - of_error[1]) / (2 * step) == pytest.approx(e / step, abs=1e-7)
            assert (of_noise[0] - of_noise[1]) / (2 * step) == pytest.approx(N[:, i], abs=1e-7)


def innovation(here: Array, there: Array, z: Array) -> tuple[Array, Array]:
    N = np.empty((3, 3))
    return np.array(_invariant_loops.innovation(here, there[0], there[1], there[2], z, N)), N


def moved(xi: Array, pose: Array) -> Array:
    """exp(xi) times the pose, by whole matrices."""
    X = expm(hat(xi[[2, 0, 1]]))
    return compose(np.array([X[0, 2], X[1, 2], np.arctan2(X[1, 0], X[0, 0])]), pose)


@pytest.mark.parametrize("name", ["ekf", "invariant-ekf"])
def test_with_little_noise_the_kept_poses_are_the_batch_optimum(name: str) -> None:
    """The models' second order, path length times heading variance, is all that they may differ by."""
    log, _ = both(11, 120, noise=1e-3)
    ours, batch = final(name, log), final("graph", log)
    _, cov = dead_reckoned(log)
    bound = (1 + np.hypot(*log.delta[1:, :2].T).sum()) * cov[-1, 2, 2]
    sd = np.sqrt(batch.cov[:, 0, 0].max())
    assert bound < sd / 10
    assert np.abs(between(batch.path, ours.path)).max() < bound
    assert ours.cov == pytest.approx(batch.cov, abs=1e-2 * np.abs(batch.cov).max())
    assert np.abs(ours.map.xy[np.argsort(ours.map.ids)] - batch.map.xy[np.argsort(batch.map.ids)]).max() < bound


def test_the_unobservable_stays_so_with_first_estimates_and_in_the_group() -> None:
    """Kept poses seen from each other say nothing of where in the world they are: the heading gains nothing."""
    log, _ = both(12, 200, 0, share=1.0)
    vague = log.prior._replace(cov=np.diag([1.0, 1.0, 0.3]) ** 2)
    gained = {}
    for name, jacobians in (("ekf", "standard"), ("ekf", "first-estimates"), ("invariant-ekf", "")):
        backend = make(name, vague, **({"jacobians": jacobians} if jacobians else {}))
        for step in log:
            backend.step(step)
        gained[jacobians] = 1 - backend.finish().cov[0, 2, 2] / 0.09
    assert gained[""] < 1e-9
    assert gained["first-estimates"] < 1e-9
    assert gained["standard"] > 1e-6


@pytest.mark.parametrize("name", first_quick(["ekf", "invariant-ekf"]))
def test_covariances_stay_positive_definite_through_thousands_of_loops(name: str) -> None:
    rng = np.random.default_rng(13)
    dataset = random_log(rng, 1000, 0)
    log = with_loops(rng, dataset, 1.0, noise=0.1)
    assert len(log.loop_to) > 1900
    solution = final(name, log, poses=0)
    assert np.array_equal(solution.cov, solution.cov.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(solution.cov)[:, 0].min() > 0
    off = between(dataset.truth.poses, solution.path)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.5


def test_the_whole_state_is_positive_definite() -> None:
    log, _ = both(14, 300, 5, share=1.0)
    backend = make("ekf", log.prior)
    for step in log:
        backend.step(step)
    whole, entries = backend._whole, backend._kept.entries
    P = whole.cov()
    landmarks = 2 * np.array([*backend._slot.values()])
    rows = np.concatenate((landmarks, landmarks + 1, entries[:, 0], entries[:, 0] + 1, entries[:, 1]))
    assert len(rows) == 3 * 300 + 2 * len(backend._slot)
    inner = P[np.ix_(rows, rows)]
    scale = np.sqrt(np.diag(inner))
    assert np.linalg.eigvalsh(inner / np.outer(scale, scale))[0] > 0


@pytest.mark.parametrize("name", ["ekf", "invariant-ekf"])
def test_a_log_without_loops_keeps_nothing(name: str) -> None:
    log = random_log(np.random.default_rng(15), 50, 6).log
    backend = make(name, log.prior)
    for step in log:
        backend.step(step)
    assert backend._kept is None
    assert backend.finish() is None
    other = make(name, log.prior._replace(loops=True))
    path = [other.step(step) for step in log]
    assert isinstance(other.finish(), Solution)
    again = make(name, log.prior)
    assert np.array([again.step(step) for step in log]) == pytest.approx(np.array(path), abs=1e-12)


@pytest.mark.parametrize(("name", "options"), [("ekf", {}), ("ekf", {"compress_above": 0}), ("invariant-ekf", {})])
def test_queries_change_nothing(name: str, options: dict[str, Any]) -> None:
    log, _ = both(16, 60)
    asking_changes_nothing(make(name, log.prior, **options), make(name, log.prior, **options), log)


@pytest.mark.parametrize(("name", "options"), [("ekf", {}), ("ekf", {"compress_above": 0}), ("invariant-ekf", {})])
def test_landmarks_alone_are_expected(name: str, options: dict[str, Any]) -> None:
    """What is expected is of the landmarks of the map, also with poses between them in the state."""
    log, _ = both(17, 60)
    backend = make(name, log.prior, **options)
    dense = DelayedEkf(log.prior)
    seen = 0
    for step in log:
        found = backend.expected(step.odometry, step.sightings, 1e9) if len(step.sightings.ids) else None
        if found is not None:
            on_map = {one for one in dense.ids if one >= 0}
            assert set(found.ids.tolist()) == on_map
            seen += len(on_map)
        backend.step(step)
        dense.step(step)
    assert seen > 100


def test_indefinite_covariances_end_it_with_the_step() -> None:
    log, _ = both(18, 30, 0, share=0.0)
    steps = list(log)
    steps[20] = steps[20]._replace(loops=RelativePoses(np.array([7]), np.zeros((1, 3)), -np.eye(3)[None]))
    bad = Log.from_steps("bad", log.prior, steps)
    for name in ("ekf", "invariant-ekf"):
        backend = make(name, bad.prior)
        for step in steps[:20]:
            backend.step(step)
        with pytest.raises(Diverged, match="loop closure to step 7 is not positive definite"):
            backend.step(steps[20])


def test_those_kept_are_spread_evenly() -> None:
    kept, none, steps = KeptPoses(20), RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3))), []
    pairs = 5
    for now in range(1000):
        if len(steps) == 20:
            steps.remove(densest(steps, now))
        steps.append(now)
        loops, pairs = kept.take(none, pairs)
        assert len(loops.to) == 0
        assert kept.kept == steps
    assert pairs == 5 + 20 + 10
    assert len(np.unique(np.concatenate((kept.entries[:, 0], kept.entries[:, 0] + 1, kept.entries[:, 1])))) == 60
    gaps: Ints = np.diff(steps)
    assert gaps[:-1].max() <= 4 * gaps[:-1].min()


@pytest.mark.parametrize("name", ["ekf", "invariant-ekf"])
def test_a_covariance_that_moves_as_it_grows_in_place_is_followed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one of 256 MB and more does: here of 8 MB, then 24 MB, after 339 poses, with memory taken right behind it."""
    log = laps(np.random.default_rng(0), count=5, every=20).log
    plain = final(name, log)
    monkeypatch.setattr(_triangle, "LARGE", 0)
    backend, behind = make(name, log.prior), list[Array]()
    for step in log:
        backend.step(step)
        behind.append(np.zeros(1 << 16))
    assert backend.finish().path.tobytes() == plain.path.tobytes()
