"""What a colour filter does to a fit: a blur of its own in each of four kinds of pixels, compiled.

Behind a colour filter a pixel sees one of three colours and takes the others from its neighbours. By even and odd rows
and columns there are four kinds of pixels, whatever the filter's order and the interpolation, and edges are blurred
differently in each. An edge along the pixels runs through one kind or two: it seems moved, all along, and with it all
edges a whole number of pairs of pixels away. Such a move the fit takes for the marker's, and leaves hardly any of it in
the residuals of edges. The kinds' blurs tell it.
"""

import numpy as np

from ...core.kernels._small import cholesky, dot, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._edges import KIND, RESIDUAL, WEIGHT, moved_residual
from ._grey import PARAMETERS, A, C

BLURS = np.array([8 + A, 8 + C])
"""Parameters that each kind of pixels has a change of its own of: the blur along the rows and along the columns."""

SIGNS = np.array([[1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0]])
"""(3, 4) what the kinds differ in: by columns, by rows and by both."""

KIND_SD = 0.3
"""Standard deviation that is expected of each difference, of the logarithm of the blur."""

FELT = 5.0
"""Least gain of the kinds' blurs, by what chance explains, that counts: without a filter it is one or two."""

SINGULAR = 1e-12
"""A pivot below that share of its diagonal entry is rounding."""


@compiled
def part_kinds(rows: Array, normal: Array, variance: float, hidden: Array) -> float:
    """Takes out of the residuals in `rows` (n, COLUMNS), in place, what blurs of the kinds' own explain.

    They are fitted together with the parameters, whose `normal` (24, 24) matrix is given for residuals of some
    `variance`, by one linear step. Fills `hidden` (24,) with how far that moves the parameters. Returns the weighted
    sum of the squares that remain; NaN, with nothing changed, where that gains no more than by chance, or the matrix
    is singular.
    """
    sums = np.zeros((4, 2, PARAMETERS + 1))
    for row in rows:
        kind = sums[int(row[KIND])]
        for a in range(2):
            weighted = row[WEIGHT] * row[BLURS[a]]
            for i in range(PARAMETERS + 1):
                kind[a, i] += weighted * row[i]
    across, inner, pull = np.zeros((6, PARAMETERS)), np.zeros((6, 6)), np.zeros(6)
    for k in range(6):
        for kind in range(4):
            sign, own = SIGNS[k // 2, kind], sums[kind, k % 2]
            for i in range(PARAMETERS):
                across[k, i] += sign * own[i]
            pull[k] += sign * own[RESIDUAL]
            for j in range(6):
                inner[k, j] += sign * SIGNS[j // 2, kind] * own[BLURS[j % 2]]
        inner[k, k] += variance / KIND_SD**2
    factor, shifts = np.zeros((PARAMETERS, PARAMETERS)), np.zeros((6, PARAMETERS))
    if not cholesky(normal, factor, PARAMETERS, SINGULAR, 0.0):
        return np.nan
    for k in range(6):
        solve(factor, across[k], shifts[k], PARAMETERS)
        for j in range(6):
            for i in range(PARAMETERS):
                inner[j, k] -= across[j, i] * shifts[k, i]
    apart = np.zeros(6)
    if not cholesky(inner, inner, 6, SINGULAR, 0.0):
        return np.nan
    solve(inner, pull, apart, 6)
    if dot(apart, pull) < FELT * 6 * variance:
        return np.nan
    for i in range(PARAMETERS):
        for k in range(6):
            hidden[i] -= apart[k] * shifts[k, i]
    blurs = np.zeros((4, 2))
    for kind in range(4):
        for k in range(6):
            blurs[kind, k % 2] += SIGNS[k // 2, kind] * apart[k]
    chi = 0.0
    for row in rows:
        own = blurs[int(row[KIND])]
        residual = moved_residual(row, hidden) - own[0] * row[BLURS[0]] - own[1] * row[BLURS[1]]
        row[RESIDUAL] = residual
        chi += row[WEIGHT] * residual * residual
    return chi
