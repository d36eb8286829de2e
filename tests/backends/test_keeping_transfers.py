"""`smoother[keep=...]`: what was measured at marginalised steps, transferred to held ones, by dense algebra."""

from typing import Any

import numpy as np
import pytest

from driven import aligned_error, final, rmse, run
from random_logs import random_covariance
from slamduel.backends.keeping.anchored import Anchors
from slamduel.backends.keeping.positions import WEAK, Positions, measured, moved_fixes
from slamduel.backends.keeping.transfers import MOVED, Moved, Transfers, link, transferred
from slamduel.backends.smoothing import _log
from slamduel.backends.smoothing._graph import (
    COVARIANCE,
    END,
    FIRST,
    FIX,
    LINKS,
    LOOP,
    MOTION,
    NO_VARIABLE,
    PART,
    Graph,
)
from slamduel.backends.smoothing._graph import A as LINK_A
from slamduel.backends.smoothing.arrays import made, with_rows
from slamduel.core.factors import Dataset
from slamduel.core.fixes import information
from slamduel.core.se2 import Array, between, compose, wrap
from slamduel.datasets.on_demand.fixes import with_fixes
from slamduel.datasets.patrol.patrol import Options as PatrolOptions
from slamduel.datasets.patrol.patrol import patrol
from slamduel.datasets.worlds.city import Options as CityOptions
from slamduel.datasets.worlds.city import city
from tiers import first_quick


def normalised(path: Array, cov: Array, truth: Array) -> float:
    """The mean NEES of a path, over its degrees of freedom."""
    e = path - truth
    e[:, 2] = wrap(e[:, 2])
    return float(np.einsum("ni,nij,nj->n", e, np.linalg.inv(cov), e).mean() / 3)


def jacobian(f: Any, at: Array) -> Array:
    return np.stack([(f(at + 1e-6 * e) - f(at - 1e-6 * e)) / 2e-6 for e in np.eye(len(at))], axis=1)


def poses_of(path: Array) -> Graph:
    """A graph whose poses, each a variable, are a path (n, 3)."""
    g, n = made(0, 1.0), len(path)
    for table, rows in (("steps", n), ("variables", n), ("links", 3 * n), ("sightings", 2 * n), ("fixed", 2 * n)):
        g = with_rows(g, table, rows)
    pose, cov, last = path[0].copy(), 0.01 * np.eye(3), NO_VARIABLE
    for k in range(n):
        motion = path[0] if k == 0 else between(path[k - 1], path[k])
        _log.move(g, np.concatenate((motion[None], 0.01 * np.eye(3))), pose, cov)
        g.steps[k, 9:] = path[k]
        last = _log.add_pose_after(g, last, k)
    return g


def anchored_at(g: Graph, row: int, pose: Array, own: Array) -> Anchors:
    return Anchors(np.array([row]), g.at[row : row + 1].copy(), pose[None], own[None])


def off(e: Array) -> Array:
    return np.array([e[0], e[1], wrap(e[2])])


def test_a_loop_closure_from_a_marginalised_pose_is_transferred_with_all_errors() -> None:
    """Against the optimum of the loop closure and the sightings, and numerical derivatives."""
    rng = np.random.default_rng(1)
    a, c, known = np.array([1.0, -2.0, 2.5]), np.array([3.2, -1.0, -0.4]), np.array([3.5, 0.1, 0.9])
    left, own, cov = (random_covariance(rng, [0.03, 0.05, 0.02]) for _ in range(3))
    z = between(a, known) + np.array([0.02, -0.03, 0.01])
    T = np.linalg.inv(np.linalg.cholesky(left))
    b = known.copy()
    for _ in range(20):  # where the sightings have it, and the loop closure as well
        D = jacobian(lambda x: np.concatenate((T @ off(x - known), _whitened(a, x, z, cov))), b)
        b -= np.linalg.lstsq(D, np.concatenate((T @ off(b - known), _whitened(a, b, z, cov))), rcond=None)[0]
    path = np.stack((a, c, b, b + 1))
    g = poses_of(path)
    assert _log.add_loop(g, int(g.at[0]), int(g.at[2]), z, cov)
    held = np.array([True, True, False, False])
    (moved,) = transferred(g, 2, 3, path, np.stack((left, left)), held, anchored_at(g, 1, c, own), 3.0)
    assert (moved.to, moved.by) == (0, 1)
    assert np.abs(off(moved.delta - compose(z, between(known, c)))).max() < 1e-3  # b's part is linear

    def way(v: Array) -> Array:
        return compose(v[:3], between(v[3:6], v[6:]))

    J = jacobian(way, np.concatenate((z, path[2], c)))
    parts = [J[:, 3 * i : 3 * i + 3] for i in range(3)]
    wanted = sum(P @ C @ P.T for P, C in zip(parts[:2], (cov, left), strict=True))
    assert np.abs(moved.cov - wanted).max() < 0.02 * np.abs(wanted).max()  # b has moved by what was taken back
    assert np.abs(moved.own - parts[2] @ own @ parts[2].T).max() < 0.02 * np.abs(moved.own).max()
    assert transferred(g, 2, 3, path, np.stack((left, left)), ~held, anchored_at(g, 1, c, own), 3.0) == []
    assert transferred(g, 2, 3, path, np.stack((left, left)), held, anchored_at(g, 1, c, own), 1.0) == []


def _whitened(a: Array, b: Array, z: Array, cov: Array) -> Array:
    return np.array(np.linalg.solve(np.linalg.cholesky(cov), off(between(a, b) - z)), np.float64)


def test_transfers_between_two_poses_are_one_link_that_has_the_pose_s_own_error_once() -> None:
    rng = np.random.default_rng(2)
    path = np.array([[0.0, 0.0, 0.1], [1.0, 0.2, 0.3], [2.0, 0.1, -0.2]])
    g, transfers = poses_of(path), Transfers()
    own = random_covariance(rng, [0.05, 0.03, 0.02])
    deltas = between(path[0], path[2]) + 0.02 * rng.standard_normal((4, 3))
    covs = [random_covariance(rng, [0.05, 0.06, 0.02]) for _ in deltas]
    found = np.zeros(3), np.zeros((3, 3))
    for delta, cov in zip(deltas, covs, strict=True):
        found = transfers.add(Moved(0, 2, delta, cov, own), (0, 2))
        link(g, int(g.at[0]), int(g.at[2]), *found)
    W = [np.linalg.inv(cov) for cov in covs]
    mean = np.linalg.solve(sum(W), sum(w @ d for w, d in zip(W, deltas, strict=True)))
    assert np.abs(found[0] - mean).max() < 1e-12
    assert np.abs(found[1] - np.linalg.inv(sum(W)) - own).max() < 1e-12
    of = g.links[: g.state[LINKS]]
    (k,) = np.flatnonzero(of[:, LOOP] == MOVED)
    assert of[k, LINK_A] == g.at[0]
    assert np.abs(g.linked[k, MOTION : MOTION + 3] - mean).max() < 1e-12
    assert np.abs(g.linked[k, COVARIANCE : COVARIANCE + 6] - found[1][np.triu_indices(3)]).max() < 1e-12
    assert len(transfers) == 1


def fixed_poses(rng: np.random.Generator, path: Array) -> Graph:
    """A position by an antenna that is not at the body's origin, and a heading, at each pose of a path."""
    g, n = poses_of(path), len(path)
    nan = np.nan
    for k in range(n):
        v = int(g.at[k])
        cov = np.full((3, 3), nan)
        cov[:2, :2] = random_covariance(rng, [0.5, 0.8])
        heading = np.full((3, 3), nan)
        heading[2, 2] = 0.02
        for i, (C, arm) in enumerate(((cov, [0.3, -0.2]), (heading, [0.0, 0.0]))):
            row = 2 * k + i
            z = path[k] + rng.normal(0, 0.3, 3) * [1, 1, 0.1]
            g.fixed[row] = np.concatenate((z, information(C)[np.triu_indices(3)], arm))
            g.sightings[row, PART] = FIX - row
        g.variables[v, FIRST], g.variables[v, END] = 2 * k, 2 * k + 2
    return g


def information_of(row: Array) -> Array:
    """(3, 3) of a row of `fixed`."""
    half = np.zeros((3, 3))
    half[np.triu_indices(3)] = row[3:9]
    return half + half.T - np.diag(half.diagonal())


def residual(row: Array, pose: Array) -> Array:
    """Whitened: what is measured alone."""
    W = information_of(row)
    some = W.diagonal() > 0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    at = pose + np.array([c * row[9] - s * row[10], s * row[9] + c * row[10], 0.0])
    return np.array(np.linalg.cholesky(W[np.ix_(some, some)]).T @ off(at - row[:3])[some], np.float64)


def test_positions_of_marginalised_poses_tell_of_a_held_one_what_elimination_would() -> None:
    """Held pose c, and its place by the landmarks m; the marginalised poses are fixed to m but for their own errors."""
    rng = np.random.default_rng(3)
    path = np.array([[4.0, 1.0, 0.4], [4.6, 1.5, 0.9], [5.2, 2.0, -0.3]])
    g = fixed_poses(rng, path)
    own, left = random_covariance(rng, [0.03, 0.04, 0.02]), np.array([random_covariance(rng, [0.03] * 3) for _ in "ab"])
    rows = g.fixed.copy()

    def off_all(v: Array) -> Array:
        c, m = path[0] + v[:3], path[0] + v[3:6]
        out = [residual(rows[0], c), np.linalg.solve(np.linalg.cholesky(own), off(c - m))]
        for k in (1, 2):
            e = v[3 + 3 * k : 6 + 3 * k]
            b = compose(m, between(path[0], path[k])) + e
            out += [np.linalg.solve(np.linalg.cholesky(left[k - 1]), e), residual(rows[2 * k], b)]
            out.append(residual(rows[2 * k + 1], b))
        return np.array(np.concatenate(out), np.float64)

    # the poses are where the sightings and their own fixes have them
    start = np.zeros(12)
    for k in (1, 2):
        T = np.linalg.inv(np.linalg.cholesky(left[k - 1]))
        both = rows[2 * k : 2 * k + 2]

        def with_own(e: Array, k: int = k, T: Array = T, both: Array = both) -> Array:
            return np.concatenate((T @ e, *(residual(row, path[k] + e) for row in both)))

        D = jacobian(with_own, np.zeros(3))
        start[3 + 3 * k : 6 + 3 * k] = -np.linalg.lstsq(D, with_own(np.zeros(3)), rcond=None)[0]
    J, r = jacobian(off_all, np.zeros(12)), off_all(np.zeros(12))
    H, h = J.T @ J, -J.T @ r
    rest = np.linalg.solve(H[3:, 3:], np.column_stack((H[3:, :3], h[3:])))
    wanted, side = H[:3, :3] - H[:3, 3:] @ rest[:, :3], h[:3] - H[:3, 3:] @ rest[:, 3]
    wanted[2, 2] += WEAK**-2
    there = path.copy()
    for k in (1, 2):
        there[k] += start[3 + 3 * k : 6 + 3 * k]
    moved, lost = moved_fixes(g, 1, 2, there, left, anchored_at(g, 0, path[0], own), 3.0)
    assert (len(moved), lost) == (4, 0)
    assert moved_fixes(g, 1, 2, there, left, anchored_at(g, 0, path[0], own), 0.1) == ([], 4)
    positions = Positions()
    for one in moved:
        positions.add(g, one, 0, path[0])
    assert measured(g, int(g.at[0])).tolist() == [0, 1]
    row, W = g.fixed[0], information_of(g.fixed[0])
    # one pose's fixes are linearised where the others' have it: the two differ by products of offsets
    assert np.abs(W - wanted).max() < 0.02 * np.abs(wanted).max()
    assert np.abs(W @ off(row[:3] - path[0]) - side).max() < 0.05 * np.abs(side).max()


def a_patrol(seed: int, steps: int) -> Dataset:
    return patrol(PatrolOptions(steps=steps, loops=5), np.random.default_rng(seed))


def a_city(seed: int, steps: int = 3000) -> Dataset:
    options = CityOptions(landmarks=300, steps=steps, gps=2.0, gps_sd=1.0, gps_x=0.3, compass=2.0, compass_sd=0.05)
    rng = np.random.default_rng(seed)
    return with_fixes(city(options, rng), options, rng)


def assert_as_honest(nees: Array) -> None:
    """NEES (n, 2) of the bounded smoother and of the exact one, which is one draw of the start's errors a log."""
    assert 0.5 < nees[:, 0].mean() < 2
    assert (np.abs(np.log(nees[:, 0] / nees[:, 1])) < np.log(2)).all()


@pytest.mark.parametrize("seeds", first_quick([range(1), range(6)]))
def test_loop_closures_to_the_first_poses_are_not_lost(seeds: range) -> None:
    """So the error from the start, and not after alignment alone, is nearly the exact one's."""
    errors, honest = list[list[float]](), list[list[float]]()
    for seed in seeds:
        made = a_patrol(seed, 3000)
        assert made.truth is not None
        truth, (backend, _) = made.truth.poses, run("smoother", made.log, keep=20.0)
        g: Graph = backend._forest.g
        assert (g.links[: g.state[LINKS], LOOP] == MOVED).sum() == len(backend._transfers) > 0
        ends = [backend.finish(), final("smoother", made.log)]
        errors.append([error(end.path, truth) for error in (rmse, aligned_error) for end in ends])
        honest.append([normalised(end.path.copy(), end.cov, truth) for end in ends])
        np.linalg.cholesky(ends[0].cov)  # all are positive definite
    if len(seeds) >= 6:
        bounded, exact, turned, optimum = np.exp(np.log(errors).mean(axis=0))
        assert bounded < 1.1 * exact
        assert turned < 1.1 * optimum
        assert_as_honest(np.array(honest))


@pytest.mark.parametrize("seeds", first_quick([range(1), range(6)]))
def test_positions_and_headings_are_as_good_as_exactly_smoothed_and_honest(seeds: range) -> None:
    errors, honest = list[list[float]](), list[list[float]]()
    for seed in seeds:
        made = a_city(seed)
        assert made.truth is not None
        truth, (backend, _) = made.truth.poses, run("smoother", made.log, keep=20.0)
        g: Graph = backend._forest.g
        assert len(backend._positions) > 0
        assert g.fixed.shape[0] < 1.5 * backend.held + 2500
        ends = [backend.finish(), final("smoother", made.log)]
        errors.append([error(end.path, truth) for error in (rmse, aligned_error) for end in ends])
        honest.append([normalised(end.path.copy(), end.cov, truth) for end in ends])
    bounded, exact, turned, optimum = np.exp(np.log(errors).mean(axis=0))
    assert turned < 1.1 * optimum
    assert bounded < (1.1 if len(seeds) >= 6 else 1.5) * exact
    if len(seeds) >= 6:
        assert_as_honest(np.array(honest))
