"""The motion between two frames from matched points, with its covariance.

RANSAC as in RGBD-SLAM (Endres, Hess, Sturm, Cremers and Burgard, T-RO 2014), scored by MSAC on rays and depths, then
Gauss-Newton with the points' own covariances.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints
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
    first: Points,
    second: Points,
    settings: Settings,
    rng: np.random.Generator,
    guess: tuple[Array, Array] | None = None,
) -> Registration | None:
    """Registers matched points: row k of `first` is row k of `second`. None where too few agree or leave a turn open.

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
