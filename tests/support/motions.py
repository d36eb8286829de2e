"""Algebra of planar motions for tests only: composition, with covariance too, and derivatives of `between`."""

import numpy as np

from slamduel.core.se2 import Array, compose, compose_jacobians


def between_jacobians(a: Array, b: Array) -> tuple[Array, Array]:
    """d between(a, b) / d a and / d b, each (..., 3, 3)."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    by_b = np.zeros((*c.shape, 3, 3))
    by_b[..., 0, 0] = by_b[..., 1, 1] = c
    by_b[..., 0, 1] = s
    by_b[..., 1, 0] = -s
    by_b[..., 2, 2] = 1.0
    by_a = -by_b
    by_a[..., 0, 2] = -s * dx + c * dy
    by_a[..., 1, 2] = -c * dx - s * dy
    return by_a, by_b


def chained(deltas: Array, start: Array | None = None) -> Array:
    """(n + 1, 3) the poses of `deltas` (n, 3) one after another, from `start` (3,), or the origin."""
    path = [np.zeros(3) if start is None else start]
    for delta in deltas:
        path.append(compose(path[-1], delta))
    return np.array(path)


def chain(delta: Array, cov: Array, after: Array, after_cov: Array) -> tuple[Array, Array]:
    """Composes two motions: (3,) in the body frame before the first, and its 3x3 covariance, to first order.

    The errors of the two are assumed independent: C = Ja C1 Ja' + Jb C2 Jb'.
    """
    by_first, by_second = compose_jacobians(delta, after)
    return compose(delta, after), by_first @ cov @ by_first.T + by_second @ after_cov @ by_second.T
