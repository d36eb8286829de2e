"""Distinguishes logs with real times from those that number their steps."""

import numpy as np

from .se2 import Array


def numbered(t: Array) -> bool:
    """True if the times (n,) are the numbers of the steps."""
    return np.array_equal(t, np.arange(len(t)))


def length(t: Array) -> float | None:
    """The s from the first to the last of the times (n,); None for one step, or numbered steps."""
    return None if len(t) < 2 or numbered(t) else float(t[-1] - t[0])
