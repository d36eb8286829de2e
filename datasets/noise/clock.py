"""Motions between other times than those at which they were told, for odometry whose clock is late or ahead."""

import numpy as np

from ...core.se2 import Array, between
from ...frontend.wheels.encoder import Floors, compose


def motions_after(t: Array, delta: Array, cov: Array, seconds: float) -> tuple[Array, Array]:
    """Motions (n, 3) and their covariances (n, 3, 3) between times `seconds` later than those t (n,) that they are of.

    Within a step the robot is taken to move evenly; before the first step, and after the last one, as in these. Row 0
    is ignored, and NaN.
    """
    wanted = t + seconds
    edges = np.union1d(t, wanted)
    low, high = edges[:-1], edges[1:]
    step = np.clip(np.searchsorted(t, low, side="right"), 1, len(t) - 1)
    lasts = t[step] - t[step - 1]
    start = np.where((low < t[0]) | (high > t[-1]), 0.0, (low - t[step - 1]) / lasts)
    share = (high - low) / lasts
    pieces = between(delta[step] * start[:, None], delta[step] * (start + share)[:, None])
    pieces_cov = cov[step] * share[:, None, None]
    first = np.searchsorted(edges, wanted)
    count = np.diff(first)
    moved, moved_cov = np.full_like(delta, np.nan), np.full_like(cov, np.nan)
    for pieces_each in np.unique(count):
        rows = np.flatnonzero(count == pieces_each)
        at = first[rows, None] + np.arange(pieces_each)
        moved[rows + 1], moved_cov[rows + 1] = compose(pieces[at], pieces_cov[at], Floors(0.0, 0.0))
    return moved, moved_cov
