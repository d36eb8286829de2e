"""Motions on the floor with covariances: their squared distance, one after another, and back."""

import numpy as np

from ..se2 import Array, compose_jacobians, inverse, wrap
from ..small_matrices import inverse as inverse_of
from ..small_matrices import propagated
from .planar import Planar


def distance(one: Planar, other: Planar) -> float:
    """The squared distance of two motions in units of both covariances."""
    off = one.delta - other.delta
    off[2] = wrap(off[2])
    return float(off @ inverse_of(one.cov + other.cov) @ off)


def back(motion: Planar) -> Planar:
    """The motion back."""
    delta = inverse(motion.delta)
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
