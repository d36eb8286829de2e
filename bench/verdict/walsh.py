"""Walsh averages, the means of every two of many numbers, by rank; Hodges and Lehmann's estimates use them."""

from collections.abc import Sequence

import numpy as np

from ...frontend.errors import InputError
from ...frontend.se2 import Array

MOST = 2_000  # numbers of which all averages are computed: two million of these


def ranked(d: Array, ranks: Sequence[int]) -> list[float]:
    """Returns the Walsh averages of d (n,) with these ranks, from 0 on; there are n (n + 1) / 2.

    Of averages of infinity and minus infinity, half count as either: on no ratio do their ranks differ. InputError for
    more than MOST.
    """
    if len(d) > MOST:
        raise InputError(f"found {len(d):,} logs on which two backends are to be compared, expected at most {MOST:,}.")
    found = _sorted(d)
    return [float(found[rank]) for rank in ranks]


def _sorted(d: Array) -> Array:
    """Sorts all of them."""
    one, other = np.triu_indices(len(d))
    with np.errstate(invalid="ignore"):
        found = np.sort((d[one] + d[other]) / 2)
    opposed = int(np.isnan(found).sum())
    if not opposed:
        return found
    half = np.full(opposed // 2, np.inf)
    return np.concatenate([-half, np.sort(np.append(found[:-opposed], np.zeros(opposed % 2))), half])
