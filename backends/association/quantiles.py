"""Chi-square quantiles of joint distances, two degrees of freedom a pair."""

import math
from functools import cache

import numpy as np

from ...core.se2 import Array


@cache
def gates(share: float, most: int) -> Array:
    """Joint gates of 0 to `most` pairs, (most + 1,)."""
    return np.array([0.0, *(quantile(share, pairs) for pairs in range(1, most + 1))])


@cache
def quantile(share: float, pairs: int) -> float:
    """The chi-square quantile of a joint distance of that many pairs, two degrees of freedom each."""
    low, high = 0.0, 2.0 * (pairs - math.log1p(-share)) + 100.0 * math.sqrt(pairs)
    while high - low > 1e-13 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if _beyond(middle, pairs) > 1 - share else (low, middle)
    return (low + high) / 2


def _beyond(distance: float, pairs: int) -> float:
    """The probability that a joint distance of that many right pairs is larger: a Poisson sum."""
    half = distance / 2
    term = math.exp(-half)
    total = term
    for k in range(1, pairs):
        term *= half / k
        total += term
    return total
