"""Chi-square quantiles of joint distances: two degrees of freedom a pair, or three where sightings have signatures."""

import math
from functools import cache

import numpy as np

from ...core.se2 import Array


@cache
def gates(share: float, most: int, each: int = 2) -> Array:
    """Joint gates of 0 to `most` pairs, (most + 1,), of `each` degrees of freedom."""
    return np.array([0.0, *(quantile(share, pairs, each) for pairs in range(1, most + 1))])


@cache
def quantile(share: float, pairs: int, each: int = 2) -> float:
    """The chi-square quantile of a joint distance of that many pairs, `each` degrees of freedom each."""
    low, high = 0.0, each * (pairs - math.log1p(-share)) + 100.0 * math.sqrt(pairs)
    while high - low > 1e-13 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if _beyond(middle, each * pairs) > 1 - share else (low, middle)
    return (low + high) / 2


def _beyond(distance: float, freedom: int) -> float:
    """The probability that a joint distance of right pairs is larger: a Poisson sum, also of halves where it is odd."""
    half = distance / 2
    if freedom % 2 == 0:
        term = math.exp(-half)
        total = term
    else:
        term = 2 * math.sqrt(half / math.pi) * math.exp(-half)
        total = math.erfc(math.sqrt(half)) + (term if freedom > 1 else 0.0)
    for k in range(1, freedom // 2):
        term *= half / (k + freedom % 2 / 2)
        total += term
    return total
