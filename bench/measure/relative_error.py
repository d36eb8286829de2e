"""Relative pose error: errors of the motions along a path, each over a given length or duration.

Sturm et al., A Benchmark for the Evaluation of RGB-D SLAM Systems (IROS 2012), eqs (1)-(3). evo chooses the pairs of
poses by length; each pair begins where the one before ended. No alignment changes these errors.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints, between, wrap

TOLERANCE = 0.1  # share of a duration by which the time between two poses may differ from it


class RelativeError(NamedTuple):
    """Root mean squares over the pairs."""

    translation: float  # m
    rotation: float  # rad


def pairs_by_path(poses: Array, distance: float) -> Ints:
    """Finds the pairs (p, 2) of poses with `distance` (m) of path between them, or as little more as there is.

    By evo, as `evo_rpe --delta DISTANCE --delta_unit m --pairs_from_reference` has them for the known `poses` (m, 3). A
    rest that is too short is left out.
    """
    from evo.core.filters import filter_pairs_by_path

    if not len(poses):
        return np.zeros((0, 2), np.int64)
    placed = np.zeros((len(poses), 4, 4))
    placed[:, :2, 3] = poses[:, :2]  # of each, evo looks at the place alone
    return np.array(filter_pairs_by_path(list(placed), distance), np.int64).reshape(-1, 2)


def pairs_by_time(t: Array, duration: float) -> Ints:
    """Finds the pairs (p, 2) of poses that are `duration` (s) apart, within TOLERANCE of it.

    evo has no such pairs. From the first pose on, the pose nearest in time to `duration` later ends a pair and begins
    the next. A pair that is off by more than the tolerance, as over a gap, is left out.
    """
    if len(t) < 2:
        return np.zeros((0, 2), np.int64)
    later = np.minimum(np.searchsorted(t, t + duration), len(t) - 1)
    nearer = (t + duration) - t[later - 1] <= t[later] - (t + duration)
    following = np.maximum(later - nearer, np.arange(len(t)) + 1).tolist()
    ends = [0]
    while following[ends[-1]] < len(t):
        ends.append(following[ends[-1]])
    pairs = np.stack((ends[:-1], ends[1:]), axis=1)
    apart = t[pairs[:, 1]] - t[pairs[:, 0]]
    return pairs[np.abs(apart - duration) <= TOLERANCE * duration]


def relative_error(estimate: Array, truth: Array, pairs: Ints) -> RelativeError | None:
    """Computes the errors Q^-1 P of the motions of pairs (p, 2), Q the true and P the estimated one; None without."""
    if not len(pairs):
        return None
    first, second = pairs.T
    found, right = between(estimate[first], estimate[second]), between(truth[first], truth[second])
    off = found - right
    squares = (off[:, :2] ** 2).sum(axis=1)
    return RelativeError(float(np.sqrt(squares.mean())), float(np.sqrt((wrap(off[:, 2]) ** 2).mean())))
