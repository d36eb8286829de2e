"""Compiled filters of Gauss-Markov errors with white noise and one bias per chain.

A chain is the errors of one kind of measurement in order of time: those of one landmark's ranges, for one. Error i is
`scale_i (sqrt(share) g + sqrt(1 - share) w) + b`: g a first-order Gauss-Markov process of unit variance with the
correlation exp(-dt / time), w white, b a bias that is constant in the chain. `gap` (n,) is the time since the error
before, in s; inf begins a chain.
"""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array


@compiled
def innovations(error: Array, scale: Array, gap: Array, share: float, time: float, bias: float) -> tuple[Array, Array]:
    """Innovations (n,) and their variances (n,) of a Kalman filter of g and b; b has the standard deviation `bias`."""
    n = len(error)
    found, spread = np.empty(n), np.empty(n)
    g = b = gg = gb = bb = 0.0
    for i in range(n):
        if np.isinf(gap[i]):
            g, b, gg, gb, bb = 0.0, 0.0, 1.0, 0.0, bias * bias
        else:
            r = np.exp(-gap[i] / time)
            g, gg, gb = r * g, 1.0 + r * r * (gg - 1.0), r * gb
        h = scale[i] * np.sqrt(share)
        to_g, to_b = h * gg + gb, h * gb + bb
        v = max(h * to_g + to_b + scale[i] * scale[i] * (1.0 - share), 1e-12 * scale[i] * scale[i])  # of rounding
        e = error[i] - h * g - b
        found[i], spread[i] = e, v
        g, b = g + to_g * e / v, b + to_b * e / v
        gg, bb = max(gg - to_g * to_g / v, 0.0), max(bb - to_b * to_b / v, 0.0)
        most = np.sqrt(gg * bb)  # rounding may not make the covariance of g and b indefinite
        gb = min(max(gb - to_g * to_b / v, -most), most)
    return found, spread


@compiled
def sum_variance(scale: Array, gap: Array, share: float, time: float, bias: float) -> float:
    """The variance of the sum of all errors."""
    total = before = biases = 0.0
    number = 0
    for i in range(len(scale)):
        if np.isinf(gap[i]):
            biases += bias * bias * number * number
            before, number = 0.0, 0
        else:
            before *= np.exp(-gap[i] / time)
        total += scale[i] * scale[i] + 2.0 * share * scale[i] * before
        before += scale[i]
        number += 1
    return total + biases + bias * bias * number * number
