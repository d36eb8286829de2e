"""The covariance of a fit, by what residuals share along edges and among four kinds of pixels, compiled.

Behind a colour filter a pixel sees one of three colours and takes the others from its neighbours. By even and odd rows
and columns there are four kinds of pixels, whatever the filter's order and the interpolation, and edges are blurred
differently in each. An edge along the pixels runs through one kind or two: it seems moved, all along, and with it all
edges a whole number of pairs of pixels away. Such a move the fit takes for the marker's, and leaves hardly any of it in
the residuals of edges. The kinds' blurs tell it.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ...core.kernels._small import cholesky, dot, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._grey import PARAMETERS, A, C

RESIDUAL, WEIGHT, EDGE, KIND, COLUMNS = range(PARAMETERS, PARAMETERS + 5)
"""Columns of a pixel's row after its derivatives: residual, weight, nearest edge, see `edge_of`, and kind.

The kind is 0 to 3: odd columns count 1, odd rows 2.
"""


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


class Misfit(NamedTuple):
    """The residuals of a fit, by edges and by kinds of pixels."""

    by_edge: Array  # (edges, 25) each edge's part of the gradient, and its sum of weights
    rest: Array  # (edges, 25) likewise, without what kinds of pixels see differently
    hidden: Array  # (24,) how far the kinds' blurs move the parameters
    variances: Array  # (2,) of the residuals and of the rest, 0 where the kinds see nothing differently


@compiled
def edge_of(u: float, v: float, m: int) -> int:
    """The number of the edge nearest to (u, v), modules: k (m + 2) + j is edge k across u in row j of modules.

    Rows count from the margin's -1 on. The numbers' other half, from (m + 1) (m + 2) on, are edges across v.
    """
    line_u, line_v = math.floor(u + 0.5), math.floor(v + 0.5)
    if abs(u - line_u) < abs(v - line_v):
        return min(max(line_u, 0), m) * (m + 2) + min(max(math.floor(v), -1), m) + 1
    return (m + 1 + min(max(line_v, 0), m)) * (m + 2) + min(max(math.floor(u), -1), m) + 1


@compiled
def moved_residual(row: Array, change: Array) -> float:
    """The residual of a pixel's `row` after a small `change` (24,) of the parameters: in four sums, which is faster."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(0, PARAMETERS, 4):
        a += row[i] * change[i]
        b += row[i + 1] * change[i + 1]
        c += row[i + 2] * change[i + 2]
        d += row[i + 3] * change[i + 3]
    return row[RESIDUAL] - ((a + b) + (c + d))


@compiled
def sum_edges(rows: Array, by_edge: Array) -> None:
    """Adds to `by_edge` (edges, 25) each edge's part of the gradient, and its sum of weights."""
    for row in rows:
        edge = by_edge[int(row[EDGE])]
        weighted = row[WEIGHT] * row[RESIDUAL]
        for i in range(PARAMETERS):
            edge[i] += weighted * row[i]
        edge[PARAMETERS] += row[WEIGHT]


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


@compiled
def spread(normal: Array, misfit: Misfit) -> Array:
    """The covariance (8, 8) of the homography's change; LinAlgError where something is not determined.

    Residuals are alike along edges, see `_growth`, and by the kinds of pixels behind a colour filter. As
    much as the kinds' blurs move the homography it is off: their square is added to the covariance that the rest of the
    residuals gives, on average over the eight. Where residuals as they are give more, that stays.
    """
    inverse: Any = np.linalg.inv(normal)[:8]
    cov = np.ascontiguousarray(inverse[:, :8])
    information: Any = np.linalg.inv(cov)
    growth = _growth(inverse, information, misfit.by_edge, misfit.variances[0])
    if misfit.variances[1] > 0.0:
        hidden = np.ascontiguousarray(misfit.hidden[:8])
        rest = _growth(inverse, information, misfit.rest, misfit.variances[1])
        growth = max(growth, rest + hidden @ information @ hidden / 8.0)
    return growth * cov


@compiled
def _growth(inverse: Array, information: Array, by_edge: Array, variance: float) -> float:
    """Squared grey levels: the factor from the covariance of the eight by the normal matrix to that by edges.

    `inverse` (8, 24) is the covariance of the eight with all parameters, `information` (8, 8) the inverse of
    theirs. Blur, demosaicing and what the model leaves out correlate the residuals along an edge: each edge counts as
    one (White's covariance by clusters), and the whole covariance is scaled by how much more that gives, on average
    over the eight.

    The fit takes up a part of the edges' sums, by their leverage h, on average parameters per edge, of which those with
    few pixels count in part. Of residuals without correlation it leaves 1 - h, of those with it less (Bell and
    McCaffrey 2002): where a third of the variance is shared by edges it leaves (1 - h)^1.5, to 10 %.
    """
    weights = by_edge[:, PARAMETERS]
    edges = weights.sum() ** 2 / (weights * weights).sum()
    pulls = np.ascontiguousarray(by_edge[:, :PARAMETERS]) @ np.ascontiguousarray(inverse.T)
    excess = (information * (pulls.T @ pulls)).sum() / 8.0
    return max(excess / max(1.0 - PARAMETERS / edges, 0.25) ** 1.5, variance)
