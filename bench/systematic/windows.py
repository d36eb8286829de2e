"""Windows of time over which motions are added up: single steps have errors of their own."""

import numpy as np

from ...core.se2 import Array, Ints

WINDOW, FEWEST = 3.0, 10
"""s, and steps at least, over which motions along a known path are added up, axis by axis, and what tells of wheels is
averaged: the errors of single steps would make what they multiply look smaller."""


def windows(t: Array, driven: Ints) -> Ints:
    """The first motion of each window; motion i leads to step `driven[i]` (d,) of those at times t (n,)."""
    if not len(driven):
        return driven
    window = max(WINDOW, FEWEST * float(np.median(t[driven] - t[driven - 1])))
    return np.flatnonzero(np.diff(np.floor((t[driven] - t[0]) / window), prepend=-1.0))
