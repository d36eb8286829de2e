"""The motion of a robot on the floor from the motion between two frames of its camera.

It is that of the robot's origin, on the floor: at the camera's place a body that rocks moves by centimetres. The levels
of both frames tell how pitch, roll and height have changed between them, and correct the motion by as much as they are
better known; x, y and heading are marginalised over what is left. Such motions are compared, reversed and put together.
"""

from typing import NamedTuple

import numpy as np

from ...core.elementary import arctan2, sincos
from ...core.se2 import Array, compose_jacobians, rotation, wrap
from ...core.se2 import inverse as opposite
from ...core.small_matrices import inverse, propagated
from ._registration import turn_by
from .level import Level
from .registration import Registration
from .settings import Settings


class Planar(NamedTuple):
    """The motion of the robot on the floor."""

    delta: Array  # (3,) x, y (m) and heading (rad) of the second pose in the first
    cov: Array  # (3, 3) in the axes of delta


def planar(found: Registration, first: Level, second: Level, settings: Settings) -> Planar:
    """The motion on the floor between two levelled frames; its covariance has the settings' floors."""
    F, f = first.T[:3, :3], first.T[:3, 3]
    R = np.ascontiguousarray(F @ found.R @ second.T[:3, :3].T)
    t = F @ found.t + f - R @ second.T[:3, 3]
    by_error = adjoint(F, f)
    cov = by_error @ found.cov @ by_error.T
    # the second robot stands on the first one's floor, upright: turns about x and y, and its height, are zero
    H = np.array([[0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 1, t[1], -t[0], 0.0]])
    turn = rotation(float(arctan2(R[1, 0], R[0, 0])))
    residual = np.array([-R[1, 2], R[0, 2], t[2]])
    gain = cov @ H.T @ inverse(H @ cov @ H.T + first.cov + turn @ second.cov @ turn.T)
    cov = cov - gain @ H @ cov
    turn_by(-gain @ residual, R, t)
    J = np.zeros((3, 6))
    J[0, 0] = J[1, 1] = 1.0
    J[:2, 3:] = -skew(t)[:2]
    x, y, z = R[:, 0]
    J[2, 3:] = np.array([-z * x, -z * y, x * x + y * y]) / (x * x + y * y)
    delta = np.array([t[0], t[1], float(arctan2(y, x))])
    cov = J @ cov @ J.T + floors(delta, settings)
    return Planar(delta, (cov + cov.T) / 2)


def floors(delta: Array, settings: Settings) -> Array:
    """(3, 3) the covariance that the motion `delta` (3,) has at least: what features do not know."""
    s, way = settings, delta[0] ** 2 + delta[1] ** 2
    shift, turn = s.floor**2 + s.floor_share**2 * way, s.turn_floor**2 + s.floor_share**2 * delta[2] ** 2
    return np.diag([shift, shift, turn])


def camera_motion(delta: Array, first: Level, second: Level) -> tuple[Array, Array]:
    """The motion R (3, 3), t (3,) between the frames of a robot that moves by `delta` (3,) on the floor."""
    s, c = sincos(delta[2])
    T = np.array([[c, -s, 0.0, delta[0]], [s, c, 0.0, delta[1]], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    moved, F = T @ second.T, first.T[:3, :3]
    return F.T @ moved[:3, :3], F.T @ (moved[:3, 3] - first.T[:3, 3])


def adjoint(R: Array, t: Array) -> Array:
    """(6, 6) from errors (shift, turn) in a frame to those in the frame that R, t takes its points to."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[:3, 3:] = skew(t) @ R
    return out


def skew(v: Array) -> Array:
    """(3, 3) the matrix of the cross product with `v` (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def distance(one: Planar, other: Planar) -> float:
    """The squared distance of two motions in units of both covariances."""
    off = one.delta - other.delta
    off[2] = wrap(off[2])
    return float(off @ inverse(one.cov + other.cov) @ off)


def back(motion: Planar) -> Planar:
    """The motion back."""
    delta = opposite(motion.delta)
    by_there, by_back = compose_jacobians(motion.delta, delta)  # there and back is nowhere: they add up to zero
    return Planar(delta, propagated(by_back.T @ by_there, motion.cov))  # by_back is a rotation


def chained(delta: Array, cov: Array) -> Planar:
    """n motions (n, 3) with covariances (n, 3, 3), one after another, each in the axes before it.

    An error of one is turned by all headings before, and its turn moves everything after it.
    """
    if len(delta) == 0:
        return Planar(np.zeros(3), np.zeros((3, 3)))
    heading = np.concatenate(([0.0], np.cumsum(delta[:, 2])))
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    ends = np.cumsum(np.column_stack((c * delta[:, 0] - s * delta[:, 1], s * delta[:, 0] + c * delta[:, 1])), axis=0)
    J = np.zeros((len(delta), 3, 3))
    J[:, 0, 0], J[:, 0, 1], J[:, 1, 0], J[:, 1, 1], J[:, 2, 2] = c, -s, s, c, 1.0
    J[:, 0, 2], J[:, 1, 2] = -(ends[-1, 1] - ends[:, 1]), ends[-1, 0] - ends[:, 0]
    return Planar(np.array([*ends[-1], wrap(heading[-1])]), propagated(J, cov).sum(axis=0))
