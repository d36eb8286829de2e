"""The edge between two modules that is nearest to a pixel, and the covariance by such edges, compiled."""

import math

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._grey import PARAMETERS

RESIDUAL, WEIGHT, EDGE, COLUMNS = PARAMETERS, PARAMETERS + 1, PARAMETERS + 2, PARAMETERS + 3
"""Columns of a pixel's row after its derivatives: residual, weight, and the number of the nearest edge."""


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
def sum_edges(rows: Array, step: Array, by_edge: Array) -> None:
    """Adds to `by_edge` (edges, 25) each edge's part of the gradient after the `step` (24,), and its sum of weights."""
    for row in rows:
        residual = row[RESIDUAL]
        for i in range(PARAMETERS):
            residual -= row[i] * step[i]
        edge = by_edge[int(row[EDGE])]
        weighted = row[WEIGHT] * residual
        for i in range(PARAMETERS):
            edge[i] += weighted * row[i]
        edge[PARAMETERS] += row[WEIGHT]


@compiled
def spread(normal: Array, by_edge: Array, residual: float) -> Array:
    """The covariance (8, 8) of the homography's change; LinAlgError where something is not determined.

    Blur, demosaicing and what the model leaves out correlate the residuals along an edge: each edge counts as one
    (White's covariance by clusters), and the whole covariance is scaled by how much more that gives, on average over
    the eight.

    The fit takes up a part of the edges' sums, by their leverage h, on average parameters per edge, of which those with
    few pixels count in part. Of residuals without correlation it leaves 1 - h, of those with it less (Bell and
    McCaffrey 2002): where a third of the variance is shared by edges it leaves (1 - h)^1.5, to 10 %.
    """
    inverse = np.linalg.inv(normal)[:8]
    cov = np.ascontiguousarray(inverse[:, :8])
    weights = by_edge[:, PARAMETERS]
    edges = weights.sum() ** 2 / (weights * weights).sum()
    pulls = np.ascontiguousarray(by_edge[:, :PARAMETERS]) @ np.ascontiguousarray(inverse.T)
    clustered = pulls.T @ pulls
    excess = np.trace(np.linalg.solve(cov, clustered)) / (8.0 * residual * residual)
    excess /= max(1.0 - PARAMETERS / edges, 0.25) ** 1.5
    return max(excess, 1.0) * residual * residual * cov
