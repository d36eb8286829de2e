"""The information of errors that are correlated in time."""

from math import fsum, sqrt

import numpy as np

from ..core.kernels.compiled import compiled
from ..core.se2 import Array

FIRST = -1.0
"""In place of a correlation: the error begins a chain."""


@compiled
def information(scale: Array, keep: Array, share: float) -> Array:
    """The information (n,) about the value measured that each error of a chain adds.

    Error i is `scale_i (sqrt(share) g + sqrt(1 - share) w)`: g a first-order Gauss-Markov process of unit variance with
    the correlation `keep_i` to the error before, w white. The value is a constant; the sum over a chain's first errors
    is 1' C^-1 1 for their covariance C.
    """
    n = len(scale)
    added = np.empty(n)
    # The filter's state is g and the value m, in information form for m: m enters with none.
    gg = 1.0
    slope = 0.0  # d E[g | m, errors] / d m
    for i in range(n):
        if keep[i] == FIRST:
            gg, slope = 1.0, 0.0
        else:
            r = keep[i]
            gg, slope = 1.0 + r * r * (gg - 1.0), r * slope
        h = scale[i] * sqrt(share)
        v = h * h * gg + scale[i] * scale[i] * (1.0 - share)
        if v == 0.0:  # the error before, once more
            added[i] = 0.0
            continue
        by_value = 1.0 + h * slope  # d innovation / d(-m)
        added[i] = by_value * by_value / v
        k = gg * h / v
        slope -= k * by_value
        gg -= k * h * gg
    return added


def kept(keep: Array, share: float) -> float:
    """The share of their information that correlated errors of one size keep: what each adds to its chain, on average.

    `keep` (n,) and `share` as above.
    """
    return fsum(information(np.ones(len(keep)), keep, share).tolist()) / len(keep)
