"""The motion between two frames from matched points, with its covariance, and on the floor.

RANSAC as in RGBD-SLAM (Endres, Hess, Sturm, Cremers and Burgard, T-RO 2014), scored by MSAC on rays and depths, then
Gauss-Newton with the points' own covariances. On the floor the motion is that of the robot's origin, for which x, y and
heading are marginalised over height, pitch and roll.
"""

from typing import NamedTuple

import numpy as np

from ..elementary import arctan2
from ..se2 import Array, Ints
from ._registration import msac, refined
from .points import Points
from .settings import Settings


class Registration(NamedTuple):
    """A motion p = R q + t from the second frame's points to the first's."""

    R: Array  # (3, 3)
    t: Array  # (3,) m
    cov: Array  # (6, 6) of a shift (m) and a turn (rad), both on the left
    inliers: Ints  # (k,) rows of the matches
    chi: float  # squared distance of the inliers by degree of freedom


def registered(
    first: Points, second: Points, settings: Settings, rng: np.random.Generator, guess: tuple[Array, Array] | None = None
) -> Registration | None:
    """Registers matched points: row k of `first` is row k of `second`. None where too few agree or a view is degenerate.

    `guess` is a motion R, t that is tried first. A covariance that the residuals contradict is scaled by `chi`.
    """
    s, n = settings, len(first.z)
    if n < s.inliers:
        return None
    p, q = first.xyz, second.xyz
    p_sd, q_sd = (np.column_stack((points.z_sd, points.ray_sd)) for points in (first, second))
    R, t = (np.eye(3), np.zeros(3)) if guess is None else (guess[0].copy(), guess[1].copy())
    msac(p, p_sd, q, q_sd, _triples(n, s.hypotheses, rng), s.gate, R, t)
    inside, cov = np.zeros(n, bool), np.empty((6, 6))
    squared = refined(p, p_sd, q, q_sd, R, t, s.gate, s.inliers, inside, cov)
    if squared < 0:
        return None
    inliers = np.flatnonzero(inside)
    chi = squared / (3 * len(inliers) - 6)
    return Registration(R, t, cov * max(chi, 1.0), inliers, chi)


def _triples(n: int, count: int, rng: np.random.Generator) -> Ints:
    """(count, 3) rows below n, three different ones each."""
    a = rng.integers(0, n, count)
    b = (a + rng.integers(1, n, count)) % n
    c = (a + rng.integers(1, n, count)) % n
    return np.column_stack((a, b, c))[c != b]


class Planar(NamedTuple):
    """The motion of the robot on the floor."""

    delta: Array  # (3,) x, y (m) and heading (rad) of the second pose in the first
    cov: Array  # (3, 3)


def planar(found: Registration, first: Array, second: Array) -> Planar:
    """The motion on the floor; `first` and `second` (4, 4) take points of the two frames to their levelled robots."""
    F, f = first[:3, :3], first[:3, 3]
    R = F @ found.R @ second[:3, :3].T
    t = F @ found.t + f - R @ second[:3, 3]
    by_error = _adjoint(F, f)
    J = np.zeros((3, 6))
    J[0, 0] = J[1, 1] = 1.0
    J[:2, 3:] = -_skew(t)[:2]
    x, y, z = R[:, 0]
    J[2, 3:] = np.array([-z * x, -z * y, x * x + y * y]) / (x * x + y * y)
    J = J @ by_error
    delta = np.array([t[0], t[1], float(arctan2(y, x))])
    cov = J @ found.cov @ J.T
    return Planar(delta, (cov + cov.T) / 2)


def guess_of(delta: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """The motion R (3, 3), t (3,) between two frames of a robot that moves by `delta` (3,) on the floor."""
    c, s = np.cos(delta[2]), np.sin(delta[2])
    T = np.array([[c, -s, 0, delta[0]], [s, c, 0, delta[1]], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    F, S = first[:3, :3], second
    moved = T @ S
    return F.T @ moved[:3, :3], F.T @ (moved[:3, 3] - first[:3, 3])


def _adjoint(R: Array, t: Array) -> Array:
    """(6, 6) from errors in a frame to those in the frame that R, t takes it to."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[:3, 3:] = _skew(t) @ R
    return out


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
