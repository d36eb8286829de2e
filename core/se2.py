"""Planar rigid motions, SE(2): poses (x, y, heading) and their Jacobians.

A pose is an array (..., 3) of x (m), y (m) and heading (rad, counter-clockwise, wrapped to (-pi, pi]); every function
takes one pose or a batch of them, on leading axes. Jacobians are with respect to these three plain coordinates, so a
covariance propagated through them stays one of (x, y, heading).
"""

from math import ceil, isfinite, pi

import numpy as np
from numpy.typing import NDArray

from .elementary import sincos, sincos_of_one

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def wrap(angle: Array) -> Array:
    """Wraps `angle` (rad) to (-pi, pi]; an angle already there is returned bit for bit."""
    if isinstance(angle, float):
        return np.asarray(wrapped(angle))[()]
    turned = angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi))
    turned = np.where(turned <= -np.pi, np.pi, np.minimum(turned, np.pi))  # rounding may leave the range by an ulp
    return np.where((-np.pi < angle) & (angle <= np.pi), angle, turned)


def wrapped(angle: float) -> float:
    """The same bits for a single angle, without numpy's overhead for scalars."""
    if -pi < angle <= pi:
        return float(angle)
    if not isfinite(angle):
        return float("nan")
    turned = angle - 2 * pi * ceil((angle - pi) / (2 * pi))
    return pi if turned <= -pi or turned > pi else turned


def compose(a: Array, b: Array) -> Array:
    """The pose a + b of Smith, Self and Cheeseman: motion `b`, in the body frame of `a`, applied to `a`. (..., 3)."""
    if a.ndim == b.ndim == 1:  # a twentieth of the time, the same bits
        (x, y, heading), (dx, dy, turn) = a.tolist(), b.tolist()
        s, c = sincos_of_one(heading)
        return np.array((x + c * dx - s * dy, y + s * dx + c * dy, wrapped(heading + turn)))
    s, c = sincos(a[..., 2])
    x = a[..., 0] + c * b[..., 0] - s * b[..., 1]
    y = a[..., 1] + s * b[..., 0] + c * b[..., 1]
    return np.stack((x, y, wrap(a[..., 2] + b[..., 2])), axis=-1)


def compose_jacobians(a: Array, b: Array) -> tuple[Array, Array]:
    """d compose(a, b) / d a and / d b, each (..., 3, 3)."""
    s, c = sincos(a[..., 2])
    by_a = np.zeros((*c.shape, 3, 3))
    by_a[..., 0, 0] = by_a[..., 1, 1] = by_a[..., 2, 2] = 1.0
    by_a[..., 0, 2] = -s * b[..., 0] - c * b[..., 1]
    by_a[..., 1, 2] = c * b[..., 0] - s * b[..., 1]
    by_b = np.zeros_like(by_a)
    by_b[..., 0, 0] = by_b[..., 1, 1] = c
    by_b[..., 0, 1] = -s
    by_b[..., 1, 0] = s
    by_b[..., 2, 2] = 1.0
    return by_a, by_b


def summed(start: Array, motions: Array) -> Array:
    """(n + 1, 3) the path from the pose `start` (3,) by the motions (n, 3), each in the body frame before it."""
    heading = start[2] + np.concatenate(([0.0], np.cumsum(motions[:, 2])))
    s, c = sincos(heading[:-1])
    dx, dy = motions[:, 0], motions[:, 1]
    moved = np.stack((c * dx - s * dy, s * dx + c * dy), axis=-1)
    xy = start[:2] + np.concatenate((np.zeros((1, 2)), np.cumsum(moved, axis=0)))
    return np.column_stack((xy, wrap(heading)))


def inverse(a: Array) -> Array:
    """The motion that undoes `a`: compose(a, inverse(a)) is the identity. (..., 3)."""
    s, c = sincos(a[..., 2])
    x = -c * a[..., 0] - s * a[..., 1]
    y = s * a[..., 0] - c * a[..., 1]
    return np.stack((x, y, wrap(-a[..., 2])), axis=-1)


def between(a: Array, b: Array) -> Array:
    """The motion from `a` to `b` in the body frame of `a`: compose(a, between(a, b)) == b. (..., 3)."""
    if a.ndim == b.ndim == 1:
        (x, y, heading), (to_x, to_y, to_heading) = a.tolist(), b.tolist()
        s, c = sincos_of_one(heading)
        dx, dy = to_x - x, to_y - y
        return np.array((c * dx + s * dy, -s * dx + c * dy, wrapped(to_heading - heading)))
    s, c = sincos(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack((c * dx + s * dy, -s * dx + c * dy, wrap(b[..., 2] - a[..., 2])), axis=-1)


def act(pose: Array, xy: Array) -> Array:
    """The world position (..., 2), in m, of the point `xy` given in the body frame of `pose`."""
    s, c = sincos(pose[..., 2])
    x = pose[..., 0] + c * xy[..., 0] - s * xy[..., 1]
    y = pose[..., 1] + s * xy[..., 0] + c * xy[..., 1]
    return np.stack((x, y), axis=-1)


def act_jacobians(pose: Array, xy: Array) -> tuple[Array, Array]:
    """d act(pose, xy) / d pose, (..., 2, 3), and / d xy, (..., 2, 2)."""
    by_pose, by_xy = compose_jacobians(pose, xy)
    return by_pose[..., :2, :], by_xy[..., :2, :2]


def rotation(heading: float) -> Array:
    """The 3x3 matrix that rotates (x, y) by `heading` (rad) and leaves a heading alone.

    It transforms a covariance of (dx, dy, dheading) from a body frame at `heading` to the world: R @ cov @ R.T.
    """
    s, c = sincos_of_one(float(heading))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
