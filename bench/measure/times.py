"""Whether a log's times are times: a log that has none numbers its steps."""

import numpy as np

from ...frontend.se2 import Array


def numbered(t: Array) -> bool:
    """Whether the times (n,) are the numbers of the steps."""
    return np.array_equal(t, np.arange(len(t)))


def length(t: Array) -> float | None:
    """s from first to last of the times (n,); None for a log of one step, or one that numbers its steps."""
    return None if len(t) < 2 or numbered(t) else float(t[-1] - t[0])
