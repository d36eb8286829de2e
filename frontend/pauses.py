"""The longest time in which no sensor of a recording gave anything.

A robot that stands makes no steps, and a camera may pause while its wheels are read: a long time between two steps of a
log is none without readings.
"""

from collections.abc import Sequence

import numpy as np

from ..core.se2 import Array

PAUSE = "longest_time_without_reading"
"""Its key among a log's notes, s."""


def longest_pause(start: float, end: float, *streams: Sequence[float] | Array) -> dict[str, float]:
    """The note on the longest time from `start` to `end`, s, without a reading in any of the `streams` of times, s."""
    t = np.concatenate([np.asarray(one, float) for one in streams])
    t = np.sort(np.concatenate((t[(start <= t) & (t <= end)], [start, end])))
    return {PAUSE: float(np.diff(t).max())}
