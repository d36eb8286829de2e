"""The share of white in a pixel that sees a printed pattern through a blur, with its derivatives, compiled."""

import math

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

RIM, PAPER = 4, 2
"""Modules of white paper around a pattern, and up to how far out a pixel may lie: it sees two modules either way."""

CUT_OFF = 4.5
"""Standard deviations beyond which an edge is a step."""

VALUE, BY_U, BY_V, BY_UV, BY_SIGMA_U, BY_SIGMA_V, BY_INK = range(7)
"""Places of the share and its derivatives in the result of `share`."""

KNOTS = 32
"""Of the normal distribution's table, to a standard deviation. Hermite's cubics between them err by 4e-9 at most."""


def _cubics(values: Array, slopes: Array) -> Array:
    """(n - 1, 4) the coefficients, constant first, of Hermite's cubics through n `values` with `slopes` per knot."""
    low, high = values[:-1], values[1:]
    rises, falls = slopes[:-1], slopes[1:]
    return np.stack((low, rises, 3 * (high - low) - 2 * rises - falls, 2 * (low - high) + rises + falls), axis=-1)


_PLACES = np.arange(-CUT_OFF * KNOTS, CUT_OFF * KNOTS + 1) / KNOTS
_DENSITY = np.exp(-0.5 * _PLACES**2) / math.sqrt(2 * math.pi)
_NORMAL = np.hstack((
    _cubics(np.array([0.5 * math.erfc(-s / math.sqrt(2)) for s in _PLACES]), _DENSITY / KNOTS),
    _cubics(_DENSITY, -_PLACES * _DENSITY / KNOTS),
))  # fmt: skip
"""(n, 8) the distribution function's cubics and the density's."""

_LATER, _SOONER, _STEP = 4, 5, 6
"""Columns of `_weigh`'s table, beside the four modules'."""


@compiled
def share(
    u: float,
    v: float,
    sigma_u: float,
    sigma_v: float,
    askew: float,
    ink: float,
    pattern: Array,
    table: Array,
    seen: Array,
) -> None:
    """Fills `seen` (7,) with the share of white at (u, v), modules, and its derivatives.

    `pattern` (m + 2 RIM, m + 2 RIM), 1 is white. The blur has standard deviations `sigma_u` and `sigma_v`, modules,
    and covariance `askew`. Black is grown by `ink` modules at every edge. `table` (2, 3, 7) is overwritten.

    A blur along the pattern's own axes sees the sum of products of `_weigh`'s shares. Of a tilted one Mehler's series
    is taken: the product of two normal distribution functions, plus their covariance times the mixed second derivative.
    Ink moves the edge nearest to the pixel, along u in every row and along v in every column of modules; what is left
    out is the square of the ink, where two edges meet.
    """
    wu, wv = table[0], table[1]
    first_u = _weigh(u, sigma_u, ink, wu) + RIM
    first_v = _weigh(v, sigma_v, ink, wv) + RIM
    value, by_u, by_v, by_uv, by_sigma_u, by_sigma_v, by_ink = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(4):
        if wv[0, j] == 0.0 and wv[1, j] == 0.0:
            continue
        white_0, white_1, white_2 = 0.0, 0.0, 0.0
        for i in range(4):
            printed = pattern[first_v + j, first_u + i]
            white_0 += printed * wu[0, i]
            white_1 += printed * wu[1, i]
            white_2 += printed * wu[2, i]
        rise = pattern[first_v + j, first_u + 2] - pattern[first_v + j, first_u + 1]
        up, down = max(rise, 0.0), min(rise, 0.0)
        white_0 += up * wu[0, _LATER] + down * wu[0, _SOONER]
        white_1 += up * wu[1, _LATER] + down * wu[1, _SOONER]
        white_2 += up * wu[2, _LATER] + down * wu[2, _SOONER]
        by_ink -= wv[0, j] * (up * (wu[1, _STEP] + wu[1, _LATER]) - down * (wu[1, _STEP] + wu[1, _SOONER]))
        value += white_0 * wv[0, j]
        by_u += white_1 * wv[0, j]
        by_v += white_0 * wv[1, j]
        by_uv += white_1 * wv[1, j]
        by_sigma_u += white_2 * wv[0, j]
        by_sigma_v += white_0 * wv[2, j]
    for i in range(4 if wv[1, _STEP] + wv[1, _LATER] + wv[1, _SOONER] != 0.0 else 0):
        rise = pattern[first_v + 2, first_u + i] - pattern[first_v + 1, first_u + i]
        up, down = max(rise, 0.0), min(rise, 0.0)
        moved_0 = up * wv[0, _LATER] + down * wv[0, _SOONER]
        moved_1 = up * wv[1, _LATER] + down * wv[1, _SOONER]
        moved_2 = up * wv[2, _LATER] + down * wv[2, _SOONER]
        value += moved_0 * wu[0, i]
        by_u += moved_0 * wu[1, i]
        by_v += moved_1 * wu[0, i]
        by_uv += moved_1 * wu[1, i]
        by_sigma_u += moved_0 * wu[2, i]
        by_sigma_v += moved_2 * wu[0, i]
        by_ink -= wu[0, i] * (up * (wv[1, _STEP] + wv[1, _LATER]) - down * (wv[1, _STEP] + wv[1, _SOONER]))
    seen[VALUE], seen[BY_U], seen[BY_V], seen[BY_UV] = value, by_u, by_v, by_uv
    seen[BY_SIGMA_U], seen[BY_SIGMA_V], seen[BY_INK] = by_sigma_u, by_sigma_v, by_ink
    seen[VALUE] += askew * seen[BY_UV]


@compiled
def _weigh(u: float, sigma: float, ink: float, weights: Array) -> int:
    """Shares of four adjacent modules in a pixel at `u`, under a blur of `sigma` modules.

    Row 0 of `weights` (3, 7) has them, the others their derivatives by u and sigma; returns the first module. A module
    is the difference of two steps. The last three columns belong to the edge between the second and the third module:
    what changes when it lies `ink` later, or sooner, and its step.
    """
    edge = math.floor(u + 0.5)
    steepness = 1.0 / sigma
    before = (1.0, 0.0, 0.0)
    for k in range(3):
        here = _step(u - (edge - 1 + k), steepness)
        for row in range(3):
            weights[row, k] = before[row] - here[row]
        if k == 1:
            later = here if ink == 0.0 else _step(u - edge - ink, steepness)
            sooner = here if ink == 0.0 else _step(u - edge + ink, steepness)
            for row in range(3):
                weights[row, _LATER] = later[row] - here[row]
                weights[row, _SOONER] = sooner[row] - here[row]
                weights[row, _STEP] = here[row]
        before = here
    for row in range(3):
        weights[row, 3] = before[row]
    return edge - 2


@compiled
def _step(beyond: float, steepness: float) -> tuple[float, float, float]:
    """A step from 0 to 1 as it is seen so far `beyond` it, with 1 / sigma, and its derivatives by place and sigma."""
    s = beyond * steepness
    if s > CUT_OFF:
        return 1.0, 0.0, 0.0
    if s < -CUT_OFF:
        return 0.0, 0.0, 0.0
    x = (s + CUT_OFF) * KNOTS
    k = min(int(x), len(_NORMAL) - 1)
    x -= k
    c = _NORMAL[k]
    by_u = (c[4] + x * (c[5] + x * (c[6] + x * c[7]))) * steepness
    return c[0] + x * (c[1] + x * (c[2] + x * c[3])), by_u, -s * by_u
