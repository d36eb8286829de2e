"""The unscented transform as a regression, and small Cholesky roots, compiled.

A transform takes x = mean + root xi, xi ~ N(0, 1), over the few coordinates x that a model depends on, and returns it
as a regression on xi: slope, shift of the mean, and residual covariance. In x itself the slope is A = slope root^-1,
and the covariance of the model with anything else is A times that of x.
"""

from math import sqrt

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

ROUNDING = 1e-15
"""Share of a variance hidden by rounding: conditional variances are not taken below it."""


@compiled
def regress(
    ahead: Array, behind: Array, dims: int, outs: int, spread: float, excess: float
) -> tuple[Array, Array, Array]:
    """Regresses a model on xi from its values at +-sqrt(spread) along each xi, minus that at the mean.

    `ahead` and `behind` are (dims, outs); `excess` is beta - alpha^2. Returns slope (outs, dims), shift (outs,) and the
    residual covariance (outs, outs). In these sums and differences the scaled unscented transform's mean is shift, and
    its covariance slope slope' + rest, whatever alpha, beta and kappa.
    """
    slope, shift, rest = np.empty((outs, dims)), np.zeros(outs), np.empty((outs, outs))
    for i in range(outs):
        for k in range(dims):
            slope[i, k] = (ahead[k, i] - behind[k, i]) / (2.0 * sqrt(spread))
            shift[i] += (ahead[k, i] + behind[k, i]) / (2.0 * spread)
    for i in range(outs):
        for j in range(outs):
            total = excess * shift[i] * shift[j]
            for k in range(dims):
                total += (ahead[k, i] + behind[k, i]) * (ahead[k, j] + behind[k, j]) / (4.0 * spread)
            rest[i, j] = total
    return slope, shift, rest


@compiled
def unroot(slope: Array, root: Array, outs: int, n: int) -> None:
    """A = slope root^-1 in place of the first n columns of slope (outs, _), for a lower root (n, n)."""
    for i in range(outs):
        for k in range(n - 1, -1, -1):
            for j in range(k + 1, n):
                slope[i, k] -= slope[i, j] * root[j, k]
            slope[i, k] /= root[k, k]


@compiled
def add_outer(slope: Array, rest: Array, outs: int, first: int, last: int) -> None:
    """rest (outs, outs) += slope slope' over the columns from `first` to before `last`, symmetric to the last bit."""
    for i in range(outs):
        for j in range(i + 1):
            for k in range(first, last):
                rest[i, j] += slope[i, k] * slope[j, k]
            rest[j, i] = rest[i, j]
