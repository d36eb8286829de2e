"""The averages of every two of many numbers, by rank: Walsh's, of which Hodges and Lehmann's estimates are made.

Of a few numbers all averages are sorted. Of many they would not fit into memory, and the one of a rank is looked for
between the lowest and the highest: how many lie below a bound is counted from the sorted numbers.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..frontend.se2 import Array

MANY = 2_000
"""Numbers from which on the averages are not all worked out."""

HALVINGS = 45
"""Of what is between the lowest and the highest: it comes to a part in 10^13."""


def ranked(d: Array, ranks: Sequence[int]) -> list[float]:
    """Those of these ranks, from 0 on, among the n (n + 1) / 2 averages of every two of d (n,) and of each with itself.

    Of one that is infinite and one that is minus infinite, half count as either: on no ratio do their ranks differ.
    """
    if len(d) <= MANY:
        found = _all(d)
        return [float(found[rank]) for rank in ranks]
    finite = np.sort(d[np.isfinite(d)])
    lowest, highest = int((d == -np.inf).sum()), int((d == np.inf).sum())
    below = lowest * (lowest + 1) // 2 + lowest * len(finite) + lowest * highest // 2
    inside = len(finite) * (len(finite) + 1) // 2
    known = {
        rank: -np.inf if rank < below else np.inf if rank >= below + inside else _of_rank(finite, rank - below)
        for rank in set(ranks)
    }
    return [known[rank] for rank in ranks]


def _all(d: Array) -> Array:
    """All of them, sorted."""
    one, other = _twos(len(d))
    with np.errstate(invalid="ignore"):
        found = np.sort((d[one] + d[other]) / 2)
    opposed = int(np.isnan(found).sum())
    if not opposed:
        return found
    half = np.full(opposed // 2, np.inf)
    return np.concatenate([-half, np.sort(np.append(found[:-opposed], np.zeros(opposed % 2))), half])


@lru_cache(maxsize=8)
def _twos(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The two places in an array of n that each average is of."""
    return np.triu_indices(n)


def _of_rank(d: Array, rank: int) -> float:
    """Of sorted numbers."""
    low, high = float(d[0]), float(d[-1])
    places = np.arange(len(d))
    for _ in range(HALVINGS):
        middle = low + (high - low) / 2
        if not low < middle < high:
            break
        upto = np.searchsorted(d, 2 * middle - d, side="right")  # with each, so many make an average of no more
        if int(np.maximum(upto - places, 0).sum()) > rank:
            high = middle
        else:
            low = middle
    return max(low, high)
