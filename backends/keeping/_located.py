"""The information of sightings and loop closures about a pose, given all around it."""

import numpy as np

from ...core.kernels._planar import information
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._factors import add_sighting
from ..smoothing._graph import (
    END,
    FIRST,
    FIX,
    INFORMATION,
    LANDMARK,
    LINK,
    LOOP,
    NEXT_A,
    NEXT_B,
    PART,
    STEP,
    SUBMAP,
    A,
    B,
    Graph,
)
from ..smoothing._log import covariance_of


@compiled
def add_loops(g: Graph, v: int, first: int, last: int, F: Array, w: int) -> None:
    """Adds the information of loop closures about pose `v`, in the first rows of front F, given their other ends.

    Those to steps from `first` to `last`, and from later steps, are left out.
    """
    S, k = np.empty(6), g.variables[v, LINK]
    while k >= 0:
        if g.links[k, LOOP] and g.links[k, B] == v:
            to = g.variables[g.links[k, A], STEP]
            if to < first or to > last:
                for i in range(6):
                    S[i] = g.linked[k, INFORMATION + i]
                add_six(S, F, w)
        k = g.links[k, NEXT_A if g.links[k, A] == v else NEXT_B]


@compiled
def add_six(S: Array, F: Array, w: int) -> None:
    """Adds information S (6,) to the first rows of front F."""
    F[0] += S[0]
    F[1] += S[1]
    F[2] += S[2]
    F[w + 1] += S[3]
    F[w + 2] += S[4]
    F[2 * w + 2] += S[5]


@compiled
def own_covariance(g: Graph, v: int, loops: bool, C: Array) -> bool:
    """The covariance C (3, 3) of pose `v` given all its landmarks and, with `loops`, what its loop closures lead to.

    Motions to it and from it are left out: they would have the poses before and after it known. False where it is not
    positive definite.
    """
    if g.variables[v, SUBMAP] > 0:
        return False
    F, S, W = np.zeros(12), np.empty(6), np.empty(6)
    for s in range(g.variables[v, FIRST], g.variables[v, END]):
        if g.sightings[s, LANDMARK] >= 0 and g.sightings[s, PART] > FIX:
            add_sighting(g, s, F, 4, 0, -1)
    k = g.variables[v, LINK] if loops else -1
    while k >= 0:
        if g.links[k, LOOP]:
            for i in range(6):
                S[i] = g.linked[k, INFORMATION + i]
            if g.links[k, A] == v:
                a, b = g.values[v], g.values[g.links[k, B]]
                transposed(S, a[1] - b[1], b[0] - a[0])
            add_six(S, F, 4)
        k = g.links[k, NEXT_A if g.links[k, A] == v else NEXT_B]
    W[0], W[1], W[2], W[3], W[4], W[5] = F[0], F[1], F[2], F[5], F[6], F[10]
    if not information(W, 0, S, 0):
        return False
    covariance_of(S, 0, C)
    return True


@compiled
def transposed(W: Array, gx: float, gy: float) -> None:
    """W = G' W G for information W (6,) and G = [1, 0, gx; 0, 1, gy; 0, 0, 1]."""
    tx, ty = W[2] + gx * W[0] + gy * W[1], W[4] + gx * W[1] + gy * W[3]
    W[5] += gx * (W[2] + tx) + gy * (W[4] + ty)
    W[2], W[4] = tx, ty


@compiled
def own_covariances(g: Graph, variables: Ints, loops: bool, covs: Array, definite: Ints) -> None:
    """Likewise of poses `variables` (n,): `covs` (n, 3, 3), and `definite` (n,), 1 where there is one."""
    for i in range(len(variables)):
        definite[i] = 1 if own_covariance(g, variables[i], loops, covs[i]) else 0
