"""Counters of the left and the right wheel that are read at times of their own, as readings of both."""

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from .ticks import Ticks


def joined(times: tuple[Array, Array], counts: tuple[Array, Array], source: str) -> Ticks:
    """Readings at each of the `times` (m,), s, increasing, of the left and of the right counter.

    The other counter is interpolated there. At any time between, interpolation is then that of each counter alone.
    InputError where the counters have no time in common.
    """
    first, last = (max(t[0] for t in times), min(t[-1] for t in times))
    if first > last:
        spans = " and ".join(f"{t[0]} to {t[-1]} s" for t in times)
        raise InputError(f"{source}: the left and right counts are from {spans}, expected times in common.")
    if np.array_equal(*times):
        return Ticks(times[0], np.column_stack(counts))
    every = np.union1d(*times)
    t = every[(first <= every) & (every <= last)]
    both = np.column_stack([np.interp(t, own, count) for own, count in zip(times, counts, strict=True)])
    left, right = (np.flatnonzero(np.isin(t, own)) for own in times)
    return Ticks(t, both, (left, right))
