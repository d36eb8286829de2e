"""What factors add to a front, against numerical derivatives; motions in between against one dense elimination."""

from collections.abc import Callable

import numpy as np
import pytest

from dense_fit import weight
from random_logs import random_covariance
from slamduel.backends.common_options import LOSSES
from slamduel.backends.smoothing import _factors, _graph, _links, _log
from slamduel.backends.smoothing._graph import NO_VARIABLE, Graph
from slamduel.backends.smoothing.arrays import made, with_rows
from slamduel.core.se2 import Array, between, compose, wrap


def a_graph(rng: np.random.Generator, inner: int = 0, loss: int = 0) -> Graph:
    """Two poses, so many motions between them but one, and a landmark sighted from the second: variables 0, 1, 2."""
    g = with_rows(made(loss, 2.0), "steps", inner + 2)
    pose, cov = np.array([1.0, -2.0, 2.9]), 0.01 * np.eye(3)
    _log.move(g, np.concatenate((pose[None], cov)), pose, cov)
    _log.add_pose_after(g, NO_VARIABLE, 0)
    for _ in range(inner + 1):
        motion = np.concatenate((np.array([[0.5, 0.1, 0.3]]), random_covariance(rng, [0.1, 0.2, 0.05])))
        _log.move(g, motion, pose, cov)
    g.steps[1 : inner + 2, _graph.POINT :] += 0.05 * rng.standard_normal((inner + 1, 3))  # not where the motions lead
    x = _log.add_pose_after(g, 0, inner + 1)
    mx, my = (g.values[x, :2] + rng.uniform(1, 3, 2)).tolist()
    landmark = _log.add_variable(g, 2, mx, my, 0.0)
    z = np.array([[2.0, 0.7, *random_covariance(rng, [0.2, 0.1]).ravel()]])
    _log.add_sightings_of(g, x, np.array([landmark]), z)
    return g


def front(g: Graph, add: Callable[[Array, int], None], size: int) -> tuple[Array, Array]:
    """The matrix (size, size) and the right-hand side that a factor adds."""
    F = np.zeros(size * (size + 1))
    add(F, size + 1)
    rows = F.reshape(size, size + 1)
    upper = np.triu(rows[:, :size])
    return upper + np.triu(upper, 1).T, rows[:, size]


def numerical(residual: Callable[[Array], Array], at: Array, information: Array) -> tuple[Array, Array]:
    """J' W J and -J' W e by central differences."""
    h = 1e-6
    J = np.stack([(residual(at + h * e) - residual(at - h * e)) / (2 * h) for e in np.eye(len(at))], axis=1)
    return J.T @ information @ J, -J.T @ information @ residual(at)


def of_motion(delta: Array) -> Callable[[Array], Array]:
    """The residual of a motion between two poses (6,)."""

    def residual(v: Array) -> Array:
        e = between(v[:3], v[3:]) - delta
        e[2] = wrap(e[2])
        return e

    return residual


@pytest.mark.parametrize("pose_first", [True, False])
def test_a_sighting(pose_first: bool) -> None:
    for seed in range(20):
        g = a_graph(np.random.default_rng(seed))
        ip, il = (0, 3) if pose_first else (2, 0)
        H, b = front(g, lambda F, w, g=g, ip=ip, il=il: _factors.add_sighting(g, 0, F, w, ip, il), 5)
        order = np.r_[ip : ip + 3, il : il + 2]
        W = np.array([[g.seen[0, 2], g.seen[0, 3]], [g.seen[0, 3], g.seen[0, 4]]])

        def residual(v: Array, z: Array = g.seen[0, :2]) -> Array:
            dx, dy = v[3:] - v[:2]
            return np.array([np.hypot(dx, dy) - z[0], wrap(np.asarray(np.arctan2(dy, dx) - v[2] - z[1]))])

        expected = numerical(residual, np.r_[g.values[1], g.values[2, :2]], W)
        assert H[np.ix_(order, order)] == pytest.approx(expected[0], rel=1e-5, abs=1e-4)
        assert b[order] == pytest.approx(expected[1], rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("before_first", [True, False])
def test_a_motion(before_first: bool) -> None:
    for seed in range(20):
        g = a_graph(np.random.default_rng(seed))
        ia, ib = (0, 3) if before_first else (3, 0)
        H, b = front(g, lambda F, w, g=g, ia=ia, ib=ib: _factors.add_link(g, 0, F, w, ia, ib), 6)
        order = np.r_[ia : ia + 3, ib : ib + 3]
        S = np.zeros((3, 3))
        _log.covariance_of(g.steps[1], _graph.NOISE, S)
        W = np.asarray(np.linalg.inv(S), np.float64)
        expected = numerical(of_motion(g.steps[1, :3]), np.r_[g.values[0], g.values[1]], W)
        assert H[np.ix_(order, order)] == pytest.approx(expected[0], rel=1e-5, abs=1e-4)
        assert b[order] == pytest.approx(expected[1], rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("before_first", [True, False])
@pytest.mark.parametrize("loss", ["none", "huber", "cauchy", "geman-mcclure"])
def test_a_loop_and_its_weight(loss: str, before_first: bool) -> None:
    ia, ib = (0, 3) if before_first else (3, 0)
    order, shares = np.r_[ia : ia + 3, ib : ib + 3], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        g = a_graph(rng, loss=list(LOSSES).index(loss))
        cov = random_covariance(rng, [0.1, 0.2, 0.05])
        at = np.r_[g.values[0], g.values[1]]
        delta = between(at[:3], at[3:]) + rng.normal(0, [0.3, 0.3, 0.1])
        assert _log.add_loop(g, 0, 1, delta, cov)
        H, b = front(g, lambda F, w, g=g: _factors.add_link(g, 1, F, w, ia, ib), 6)
        residual = of_motion(delta)
        W = np.asarray(np.linalg.inv(cov), np.float64)
        shares.append(weight(loss, 2.0, float(residual(at) @ W @ residual(at)))[0])
        expected = numerical(residual, at, shares[-1] * W)
        assert H[np.ix_(order, order)] == pytest.approx(expected[0], rel=1e-5, abs=1e-4)
        assert b[order] == pytest.approx(expected[1], rel=1e-5, abs=1e-4)
    assert (min(shares) < 0.5) == (loss != "none")


def chain(g: Graph, n: int) -> tuple[Array, Array]:
    """Information and right-hand side of the motions between n poses, linearised where they are."""
    H, b, one = np.zeros((3 * n, 3 * n)), np.zeros(3 * n), np.zeros((3, 3))
    for k in range(1, n):
        p, q = g.steps[k - 1, 9:], g.steps[k, 9:]
        _log.covariance_of(g.steps[k], _graph.NOISE, one)
        rows = slice(3 * k - 3, 3 * k + 3)
        more = numerical(of_motion(g.steps[k, :3]), np.r_[p, q], np.asarray(np.linalg.inv(one), np.float64))
        H[rows, rows] += more[0]
        b[rows] += more[1]
    return H, b


def test_motions_one_after_another_are_one_link_and_what_is_between_follows() -> None:
    for seed in range(5):
        n = 9
        g = a_graph(np.random.default_rng(seed), inner=n - 2)
        H, b = chain(g, n)
        ends, inside = np.r_[:3, 3 * n - 3 : 3 * n], np.arange(3, 3 * n - 3)
        gain = np.linalg.solve(H[np.ix_(inside, inside)], H[np.ix_(inside, ends)])
        found = front(g, lambda F, w, g=g: _factors.add_link(g, 0, F, w, 0, 3), 6)
        assert found[0] == pytest.approx(H[np.ix_(ends, ends)] - H[np.ix_(ends, inside)] @ gain, rel=1e-4, abs=1e-3)
        assert found[1] == pytest.approx(b[ends] - gain.T @ b[inside], rel=1e-4, abs=1e-3)
        rows = np.zeros((n - 2, 27))
        _links.inner(g, 0, n - 1, rows)
        left = np.linalg.inv(H[np.ix_(inside, inside)])
        for i in range(n - 2):
            at = slice(3 * i, 3 * i + 3)
            assert np.hstack((rows[i, :9].reshape(3, 3), rows[i, 9:18].reshape(3, 3))) == pytest.approx(
                -gain[at], abs=1e-5
            )
            assert rows[i, 18:21] == pytest.approx((left @ b[inside])[at], abs=1e-5)
            cov = np.zeros((3, 3))
            _log.covariance_of(rows[i], 21, cov)
            assert cov == pytest.approx(left[at, at], rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("kind", [_factors.NONE, _factors.HUBER, _factors.CAUCHY, _factors.GEMAN_MCCLURE])
def test_a_weight_is_the_derivative_of_its_loss(kind: int) -> None:
    for q in (0.01, 1.0, 3.9, 4.1, 30.0):
        h = 1e-5 * q
        slope = (_factors.loss(kind, 2.0, q + h) - _factors.loss(kind, 2.0, q - h)) / (2 * h)
        assert _factors.weight(kind, 2.0, q) == pytest.approx(slope, rel=1e-6)


def test_a_motion_is_the_plain_difference_of_poses() -> None:
    """J is the product's: at the pose that a motion leads to the link has no offset, and elsewhere all that is left."""
    g = a_graph(np.random.default_rng(0))
    to = compose(g.steps[0, 9:], g.steps[1, :3])
    assert g.linked[0, :3] == pytest.approx(between(np.zeros(3), to) - g.values[1], abs=1e-12)
