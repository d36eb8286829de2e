"""`smoother[keep=...]` on logs with loop closures: transfer to anchors, the path at the end, and honesty."""

import re
from typing import Any

import numpy as np
import pytest

from driven import aligned_error, final, make, run
from random_logs import random_covariance
from slamduel.backends.keeping import _condensed, _gradients, _located
from slamduel.backends.keeping import smoother as keeping
from slamduel.backends.keeping import way as way_module
from slamduel.backends.keeping.anchored import NOWHERE, Anchored, Anchors
from slamduel.backends.keeping.way import Way
from slamduel.backends.smoothing import _log
from slamduel.backends.smoothing._graph import LINKS, LOOP, NO_VARIABLE, STEP, A, B, Graph
from slamduel.backends.smoothing.arrays import made, with_rows
from slamduel.core.factors import Dataset, Odometry, RelativePoses
from slamduel.core.se2 import Array, Ints, between, compose, rotation, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.patrol.patrol import Options, patrol
from tiers import first_quick

FACTORS = 1e-6
"""Relative error of central differences with steps of 1e-6 in double precision, with room for curvature."""


STEP_LEFT = 1e-5
"""m, rad; of Gauss-Newton from where it ended: central differences of J's gradient are no better than this."""


DRAWN = 40
"""Times that covariances are drawn: the mean is off by less than five standard deviations of a mean of squares."""


def a_patrol(seed: int, steps: int, landmarks: int) -> Dataset:
    return patrol(Options(steps=steps, landmarks=landmarks, loops=5), np.random.default_rng(seed))


def jacobian(f: Any, at: Array) -> Array:
    return np.stack([(f(at + 1e-6 * e) - f(at - 1e-6 * e)) / 2e-6 for e in np.eye(len(at))], axis=1)


def whitened(a: Array, b: Array, delta: Array, cov: Array) -> Array:
    """The residual of a motion from a to b, by its definition."""
    e = between(a, b) - delta
    e[2] = wrap(e[2])
    return np.array(np.linalg.solve(np.linalg.cholesky(cov), e), np.float64)


def a_way(rng: np.random.Generator, n: int, loops: int) -> tuple[Array, Array, Array, Ints, Array, Array]:
    """A path (n, 3), motions and loop closures that do not agree with it, and their covariances."""
    path = np.cumsum(rng.uniform([0.3, -0.2, -0.3], [0.8, 0.4, 0.5], (n, 3)), axis=0)
    path[:, 2] = wrap(path[:, 2])
    ends = np.stack((rng.integers(0, n // 2, loops), rng.integers(n // 2, n, loops)), axis=1)
    pairs = np.concatenate((np.stack((np.arange(n - 1), np.arange(1, n)), axis=1), ends))
    delta = between(path[pairs[:, 0]], path[pairs[:, 1]]) + 0.02 * rng.standard_normal((len(pairs), 3))
    covs = np.array([random_covariance(rng, [0.1, 0.2, 0.05]) for _ in pairs])
    return path, delta[: n - 1], covs[: n - 1], ends, delta[n - 1 :], covs[n - 1 :]


def test_poses_given_what_loops_lead_to_are_a_schur_complement() -> None:
    """A chain whose loop closures lead to poses that are known; those within it and from later steps are left out."""
    rng, n = np.random.default_rng(3), 9
    path, delta, covs, _, _, _ = a_way(rng, n, 1)
    ends = np.array([[0, 4], [0, 6], [4, 7], [5, 8]])  # the chain is steps 2 to 6
    loops = between(path[ends[:, 0]], path[ends[:, 1]]) + 0.02 * rng.standard_normal((4, 3))
    loop_covs = np.array([random_covariance(rng, [0.2, 0.1, 0.1]) for _ in ends])
    ends, loops = np.concatenate((ends, [[3, 5]])), np.concatenate((loops, between(path[3], path[5])[None]))
    loop_covs = np.concatenate((loop_covs, 0.01 * np.eye(3)[None]))
    g = made(0, 1.0)
    for table, rows in (("steps", n), ("variables", n), ("links", 2 * n)):
        g = with_rows(g, table, rows)
    pose, cov, last = path[0].copy(), 0.01 * np.eye(3), NO_VARIABLE
    for k in range(n):
        _log.move(g, np.concatenate((path[:1] if k == 0 else delta[k - 1 : k], covs[max(k - 1, 0)])), pose, cov)
        g.steps[k, 9:] = path[k]
        last = _log.add_pose_after(g, last, k)
    for (a, b), d, c in zip(ends.tolist(), loops, loop_covs, strict=True):
        assert _log.add_loop(g, int(g.at[a]), int(g.at[b]), d, c)

    def off(v: Array) -> Array:
        x = path.copy()
        x[2:7] = v.reshape(-1, 3)
        inside = [whitened(x[k - 1], x[k], delta[k - 1], covs[k - 1]) for k in range(3, 7)]
        return np.concatenate((*inside, *(whitened(x[0], x[b], loops[i], loop_covs[i]) for i, b in ((0, 4), (1, 6)))))

    J = jacobian(off, path[2:7].ravel())
    given = np.linalg.inv(J.T @ J)
    left, nothing = np.zeros((5, 3, 3)), np.zeros(0, np.int64)
    assert np.isfinite(_condensed.condense(g, 2, 6, nothing, False, True, np.zeros((0, 0)), np.zeros(0), left))
    for k in range(5):
        block = given[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert np.abs(left[k] - block).max() < 1e-5 * np.abs(block).max()

    def own(v: Array) -> Array:  # of step 4, between a loop closure to it and one from it
        return np.concatenate(
            (whitened(path[0], v, loops[0], loop_covs[0]), whitened(v, path[7], loops[2], loop_covs[2]))
        )

    by_four, found = jacobian(own, path[4]), np.zeros((3, 3))
    assert _located.own_covariance(g, int(g.at[4]), True, found)
    assert np.abs(found - np.linalg.inv(by_four.T @ by_four)).max() < 1e-5 * np.abs(found).max()
    assert not _located.own_covariance(g, int(g.at[2]), True, found)  # nothing but motions


def test_a_transferred_loop_closure_has_all_errors_once() -> None:
    """Against numerical derivatives of the anchor, the marginalised pose, and the measurement."""
    rng = np.random.default_rng(4)
    anchor, pose, delta = np.array([1.0, -2.0, 2.5]), np.array([1.4, -1.1, -0.7]), np.array([0.3, 0.2, 0.4])
    own, left, cov = (random_covariance(rng, [0.1, 0.2, 0.05]) for _ in range(3))
    anchors = Anchors(np.array([17]), np.array([5]), anchor[None], own[None])
    assert anchors.nearest(np.stack((pose, pose + 9)), 2.0).tolist() == [0, NOWHERE]
    anchored = Anchored()
    anchored.add(np.array([40, 41]), anchors, np.array([0, NOWHERE]), np.stack((pose, pose)), np.stack((left, left)))
    assert [anchored.anchor(step) for step in (39, 40, 41, 10**6)] == [NOWHERE, 17, NOWHERE, NOWHERE]
    there, found = anchored.transferred(40, delta, cov)
    assert np.abs(compose(anchor, there) - compose(pose, delta)).max() < 1e-12

    def measured(v: Array) -> Array:
        return compose(between(v[:3], v[3:6]), v[6:])

    J = jacobian(measured, np.concatenate((anchor, pose, delta)))
    parts = [J[:, 3 * i : 3 * i + 3] for i in range(3)]
    wanted = sum(P @ C @ P.T for P, C in zip(parts, (own, left, cov), strict=True))
    assert np.abs(found - wanted).max() < FACTORS * np.abs(found).max()
    loops = RelativePoses(np.array([40, 3, 41]), np.stack((delta, delta, delta)), np.stack((cov, cov, cov)))
    assert anchored.moved(loops, [True, False, True], True).to.tolist() == [3]  # landmarks locate the robot
    moved = anchored.moved(loops, [True, False, True], False)
    assert moved.to.tolist() == [17, 3]
    assert np.array_equal(moved.delta, np.stack((there, delta)))
    path, covs = np.zeros((42, 3)), np.zeros((42, 3, 3))
    path[17], covs[17] = anchor, own
    anchored.fill(np.array([40]), path, covs)
    assert np.abs(path[40] - pose).max() < 1e-12

    def placed(v: Array) -> Array:
        return compose(v[:3], v[3:])

    by_both = jacobian(placed, np.concatenate((anchor, between(anchor, pose))))
    relative = rotation(float(anchor[2])).T
    G = np.eye(3)
    G[:2, 2] = anchor[1] - pose[1], pose[0] - anchor[0]
    inside = relative @ (left + G @ own @ G.T) @ relative.T
    wanted = by_both[:, :3] @ own @ by_both[:, :3].T + by_both[:, 3:] @ inside @ by_both[:, 3:].T
    assert np.abs(covs[40] - wanted).max() < FACTORS * np.abs(wanted).max()


@pytest.mark.parametrize("held", [1, 12])
@pytest.mark.parametrize("lost", [None, 1.0])
def test_conjugate_gradients_end_where_a_dense_solution_does(held: int, lost: float | None) -> None:
    """With Cauchy's loss at the weights of the path; with poses inside of it that stay."""
    rng, n = np.random.default_rng(6), 24
    path, delta, covs, ends, loops, loop_covs = a_way(rng, n, 9)
    free = np.ones(n, np.bool_)
    free[rng.choice(n, held, replace=False)] = False
    settings = np.array([0.0 if lost is None else 2.0, lost or 1.0])
    pairs = np.concatenate((np.stack((np.arange(n - 1), np.arange(1, n)), axis=1), ends))
    deltas, all_covs = np.concatenate((delta, loops)), np.concatenate((covs, loop_covs))
    motions = np.column_stack((deltas, all_covs[:, *np.triu_indices(3)]))
    some = np.asarray(free[pairs[:, 0]] | free[pairs[:, 1]])
    a, b = np.ascontiguousarray(pairs[some].T)
    m, of_loops = len(a), int(np.count_nonzero(some[n - 1 :]))
    e, g, W, x = np.zeros((m, 3)), np.zeros((m, 2)), np.zeros((m, 6)), np.zeros((n, 3))
    assert _gradients.linearise(path, a, b, motions[some], of_loops, settings, e, g, W)
    D, E, r = np.zeros((n, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3))
    assert _gradients.chain(a, b, g, W, free, D, E)
    _gradients.pulled(a, b, e, g, W, free, r)
    assert 0 < _gradients.offsets(a, b, g, W, free, D, E, r, 1e-24, x) < 200

    dense, y = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    for k in range(m):
        G, P, cov = np.eye(3), np.zeros((3, 3 * n)), all_covs[some][k]
        G[:2, 2] = path[a[k], 1] - path[b[k], 1], path[b[k], 0] - path[a[k], 0]
        P[:, 3 * b[k] : 3 * b[k] + 3], P[:, 3 * a[k] : 3 * a[k] + 3] = np.eye(3), -G
        T = rotation(float(path[a[k], 2]))
        off = compose(path[a[k]], deltas[some][k]) - path[b[k]]
        off[2] = wrap(off[2])
        info = np.linalg.inv(T @ cov @ T.T)
        share = 1 + off @ info @ off / lost**2 if lost is not None and k >= m - of_loops else 1.0
        dense += P.T @ info @ P / share
        y += P.T @ info @ off / share
    rows = np.repeat(free, 3)
    exact = np.linalg.solve(dense[np.ix_(rows, rows)], y[rows])
    assert np.abs(x[free].ravel() - exact).max() < 1e-7 * np.abs(exact).max()
    assert np.array_equal(x[~free], np.zeros((held, 3)))
    whole = np.zeros((3 * n, 3 * n))
    units = np.eye(3 * m)
    for unit in units:  # draws are linear in the noise: the sum over all unit vectors is their covariance
        _gradients.drawn(a, b, g, W, free, unit.reshape(m, 3), r)
        whole += np.outer(r.ravel(), r.ravel())
    assert np.abs((whole - dense)[np.ix_(rows, rows)]).max() < 1e-9 * np.abs(dense).max()

    way = Way()
    for k in range(n):
        mine = ends[:, 1] == k
        odometry = Odometry(delta[k - 1], covs[k - 1]) if k else None
        way.add(odometry, RelativePoses(ends[mine, 0], loops[mine], loop_covs[mine]))
    factors = way.factors(free, settings)
    found = factors.smoothed(path)
    assert found is not None

    def at(v: Array) -> Array:
        moved = path.copy()
        moved[free] = v.reshape(-1, 3)
        return np.concatenate(
            [whitened(moved[i], moved[j], d, c) for (i, j), d, c in zip(pairs, deltas, all_covs, strict=True)]
        )

    v = found[free].ravel()
    J, r = jacobian(at, v), at(v)  # the true derivatives: there J is at its minimum
    weights = np.ones(len(r))
    if lost is not None:
        for k in range(n - 1, len(pairs)):
            weights[3 * k : 3 * k + 3] = 1 / (1 + r[3 * k : 3 * k + 3] @ r[3 * k : 3 * k + 3] / lost**2)
    step = np.linalg.solve(J.T @ (weights[:, None] * J), J.T @ (weights * r))
    assert np.abs(step).max() < STEP_LEFT
    exact = np.linalg.inv(J.T @ (weights[:, None] * J)).diagonal()
    draws = [factors.covariances(np.random.default_rng(seed)) for seed in range(DRAWN)]
    ratio = (
        np.mean(draws, axis=0)[free].diagonal(axis1=1, axis2=2).ravel()
        / exact
        * (way_module.DRAWS - 4)
        / way_module.DRAWS
    )
    assert np.abs(ratio - 1).max() < 5 * np.sqrt(2 / (DRAWN * way_module.DRAWS))
    assert np.array_equal(found[~free], path[~free])


def normalised(path: Array, cov: Array, truth: Array) -> float:
    off = path - truth
    off[:, 2] = wrap(off[:, 2])
    return float(np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off).mean() / 3)


def assert_consistent(backend: Any) -> None:
    """Frames of submaps have no loop closures, and are known no better than their landmarks allow."""
    g: Graph = backend._forest.g
    frames = [of.frame for of in backend.submaps]
    links = g.links[: g.state[LINKS]]
    assert np.count_nonzero(links[:, LOOP]) > 0
    assert not np.isin(links[links[:, LOOP] != 0][:, [A, B]], frames).any()
    covs = backend._forest.pose_covariances()
    for of in backend.submaps:
        cov = covs[g.variables[of.frame, STEP]]
        shared = np.linalg.eigvalsh(cov - of.own_at(g.values[of.frame]))
        assert shared[0] > -1e-9 * np.trace(cov)


@pytest.mark.slow
def test_no_covariance_of_a_long_way_is_void() -> None:
    """On a building where the frame of a submap is the place that many loop closures lead to."""
    made = patrol(Options(steps=20000, loops=5), generator("patrol", 4))
    assert made.truth is not None
    backend, _ = run("smoother", made.log, keep=20.0)
    assert_consistent(backend)
    end = backend.finish()
    assert end.cov is not None
    np.linalg.cholesky(end.cov)
    assert 0.5 < normalised(end.path.copy(), end.cov, made.truth.poses) < 2


@pytest.mark.parametrize("seeds", first_quick([range(1), range(1, 9)]))
def test_loop_closures_alone_end_at_the_optimum_and_are_honest(seeds: range) -> None:
    honest = list[float]()
    for seed in seeds:
        made = a_patrol(seed, 6000, 0)
        assert made.truth is not None
        backend, _ = run("smoother", made.log, keep=20.0)
        assert backend.held < 5500
        end, optimum = backend.finish(), final("graph", made.log)
        assert np.hypot(*(end.path - optimum.path)[:, :2].T).max() < 1e-3
        honest.append(normalised(end.path.copy(), end.cov, made.truth.poses))
    assert min(honest) > 0.2
    assert max(honest) < 3
    if len(seeds) >= 8:
        assert 0.5 < np.mean(honest) < 2


@pytest.mark.parametrize("seeds", first_quick([range(1), range(1, 9)]))
def test_loop_closures_beside_landmarks_leave_it_nearly_as_good_and_honest(seeds: range) -> None:
    errors, honest = list[Array](), list[float]()
    for seed in seeds:
        made = a_patrol(seed, 2500, 120)
        assert made.truth is not None
        backend, _ = run("smoother", made.log, keep=20.0)
        assert len(backend.submaps) > 0
        assert backend.held < 2400
        assert_consistent(backend)
        end, optimum = backend.finish(), final("graph", made.log)
        errors.append(np.log([aligned_error(one.path, made.truth.poses) for one in (end, optimum)]))
        assert end.cov is not None
        assert re.fullmatch(r"\d+ of \d+ loop closures, to marginalised steps, were left out", end.remark)
        np.linalg.cholesky(end.cov)  # all are positive definite
        honest.append(normalised(end.path.copy(), end.cov, made.truth.poses))
    bounded, exact = np.exp(np.mean(errors, axis=0))
    assert bounded < 1.1 * exact
    if len(seeds) >= 8:
        assert 0.5 < np.mean(honest) < 2


def test_what_it_holds_is_bounded_by_loop_closures_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeping, "VISITS", 1)
    made = a_patrol(0, 9000, 0)
    backend = make("smoother", made.log.prior, keep=20.0)
    held = list[int]()
    for step in made.log:
        backend.step(step)
        held.append(backend.held)
    assert max(held[4500:]) <= max(held[:4500]) < 2600
    g: Graph = backend._forest.g
    assert g.variables[: g.state[0], STEP].max() < backend.held


def test_nothing_changes_while_nothing_is_marginalised() -> None:
    """With loop closures, in a stretch that is longer than the way."""
    log = a_patrol(1, 900, 40).log
    (one, path), (other, there) = run("smoother", log, keep=1e6), run("smoother", log)
    assert path.tobytes() == there.tobytes()
    assert one.finish().path.tobytes() == other.finish().path.tobytes()
