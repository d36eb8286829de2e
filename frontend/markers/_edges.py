"""The edge between two modules that is nearest to a pixel, and the covariance by such edges, compiled."""

import math
from typing import Any, NamedTuple

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._grey import PARAMETERS

RESIDUAL, WEIGHT, EDGE, KIND, COLUMNS = range(PARAMETERS, PARAMETERS + 5)
"""Columns of a pixel's row after its derivatives: residual, weight, nearest edge, see `edge_of`, and kind.

The kind is 0 to 3: odd columns count 1, odd rows 2.
"""


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
def spread(normal: Array, misfit: Misfit) -> Array:
    """The covariance (8, 8) of the homography's change; LinAlgError where something is not determined.

    Residuals are alike along edges, see `_growth`, and by the kinds of pixels behind a colour filter, see `_kinds`. As
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
