"""The exponential of an error of the invariant filter, applied to its mean: pose, landmarks and kept poses.

Pose and landmarks are one element of SE_{N+1}(2): the error of the heading turns the landmarks, too. A kept pose is an
element of SE(2) beside it, with a heading of its own: its entries of the state are x, y after it, and heading.
"""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints


@compiled
def left_jacobian(angle: float) -> tuple[float, float]:
    """a and b of the left Jacobian [a -b; b a] of SO(2): sin(angle) / angle and (1 - cos(angle)) / angle."""
    if angle == 0.0:
        return 1.0, 0.0
    return sin(angle) / angle, 2.0 * sin(angle / 2.0) * sin(angle / 2.0) / angle


@compiled
def retract(pose: Array, mean: Array, n: int, own: Array, first: Array, second: Array, nu0: float, nu1: float) -> None:
    """Applies the group's exponential of xi = W' nu, W of the pose (2, 3), to the mean: a rotation and shift of all."""
    angle = own[0, 2] * nu0 + own[1, 2] * nu1
    c, s = cos(angle), sin(angle)
    along, across = left_jacobian(angle)
    x, y = own[0, 0] * nu0 + own[1, 0] * nu1, own[0, 1] * nu0 + own[1, 1] * nu1
    pose[0], pose[1] = (
        c * pose[0] - s * pose[1] + along * x - across * y,
        s * pose[0] + c * pose[1] + across * x + along * y,
    )
    pose[2] = wrap(pose[2] + angle)
    for j in range(0, n, 2):
        x, y = first[j] * nu0 + second[j] * nu1, first[j + 1] * nu0 + second[j + 1] * nu1
        mean[j], mean[j + 1] = (
            c * mean[j] - s * mean[j + 1] + along * x - across * y,
            s * mean[j] + c * mean[j + 1] + across * x + along * y,
        )


@compiled
def exponential(x: float, y: float, angle: float, at_x: float, at_y: float) -> tuple[float, float]:
    """The place (at_x, at_y) after the motion exp(x, y, angle) of the plane."""
    c, s = cos(angle), sin(angle)
    along, across = left_jacobian(angle)
    return c * at_x - s * at_y + along * x - across * y, s * at_x + c * at_y + across * x + along * y


@compiled
def logarithm(x: float, y: float, angle: float) -> tuple[float, float]:
    """The x and y of the error whose exponential is the motion: a turn by `angle` about the origin, then (x, y)."""
    along, across = left_jacobian(angle)
    square = along * along + across * across
    return (along * x + across * y) / square, (along * y - across * x) / square


@compiled
def retract_all(pose: Array, mean: Array, n: int, kept: Ints, W: Array, rows: Array, nu: Array) -> None:
    """`retract` by xi = W' nu, W of the pose (r, 3), of the rest `rows` (r, n), where poses are `kept` (k, 2)."""
    xi = np.zeros(3 + n)
    for q in range(len(nu)):
        for j in range(3):
            xi[j] += W[q, j] * nu[q]
        for j in range(n):
            xi[3 + j] += rows[q, j] * nu[q]
    poses = np.empty((len(kept), 3))
    for k in range(len(kept)):
        at, turn = int(kept[k, 0]), int(kept[k, 1])
        angle = xi[3 + turn]
        poses[k, 0], poses[k, 1] = exponential(xi[3 + at], xi[4 + at], angle, mean[at], mean[at + 1])
        poses[k, 2] = wrap(mean[turn] + angle)
    angle = xi[2]
    c, s = cos(angle), sin(angle)
    along, across = left_jacobian(angle)
    for j in range(0, n, 2):
        x, y = xi[3 + j], xi[4 + j]
        mean[j], mean[j + 1] = (
            c * mean[j] - s * mean[j + 1] + along * x - across * y,
            s * mean[j] + c * mean[j + 1] + across * x + along * y,
        )
    pose[0], pose[1] = exponential(xi[0], xi[1], angle, pose[0], pose[1])
    pose[2] = wrap(pose[2] + angle)
    for k in range(len(kept)):
        at, turn = kept[k, 0], kept[k, 1]
        mean[at], mean[at + 1], mean[turn] = poses[k, 0], poses[k, 1], poses[k, 2]
