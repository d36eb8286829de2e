"""The front end's own pose graph. It only says where to look for the next loops: backends get the factors, not this."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ...core.se2 import Array, Ints, between, wrap

CAUCHY = 2.0  # scale of the loss on loops, in standard deviations
WIDE = (200.0, 20.0)  # scales before it where loops are believed that are far off: at once it would leave these out
ANCHOR = 1e8  # information of a pose that is held
SMALL = 1e-4  # m and rad; Gauss-Newton ends when no pose moves further


class Edges(NamedTuple):
    """Motions between poses of the graph, with covariances in the axes of `delta`."""

    first: Ints  # (m,)
    second: Ints  # (m,)
    delta: Array  # (m, 3)
    information: Array  # (m, 3, 3)


def optimised(
    poses: Array, steps: Edges, loops: Edges, iterations: int = 15, held: int = 1, *, far: bool = False
) -> Array:
    """Moves `poses` (n, 3) to the optimum by Gauss-Newton, with Cauchy's loss on the loops; the first `held` stay.

    Where loops may be `far` off, the loss narrows gradually.
    """
    poses = poses.copy()
    both = Edges(
        np.concatenate((steps.first, loops.first)),
        np.concatenate((steps.second, loops.second)),
        np.concatenate((steps.delta, loops.delta)),
        np.concatenate((steps.information, loops.information)),
    )
    robust = np.arange(len(both.first)) >= len(steps.first)
    for scale in (*WIDE, CAUCHY) if far else (CAUCHY,):
        for _ in range(iterations):
            moved = _solved(poses, both, np.where(robust, scale, np.inf), held)
            poses += moved
            poses[:, 2] = wrap(poses[:, 2])
            if np.abs(moved).max() < SMALL:
                break
    return poses


def _solved(poses: Array, edges: Edges, scale: Array, held: int) -> Array:
    """One step of Gauss-Newton, (n, 3); `scale` (m,) is that of each edge's loss."""
    i, j, delta, information = edges
    n = len(poses)
    a, b = poses[i], poses[j]
    residual = between(a, b) - delta
    residual[:, 2] = wrap(residual[:, 2])
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = (b - a)[:, 0], (b - a)[:, 1]
    by_b, by_a = np.zeros((len(i), 3, 3)), np.zeros((len(i), 3, 3))
    by_b[:, 0, 0], by_b[:, 0, 1], by_b[:, 1, 0], by_b[:, 1, 1], by_b[:, 2, 2] = c, s, -s, c, 1.0
    by_a[:] = -by_b
    by_a[:, 0, 2], by_a[:, 1, 2] = -s * dx + c * dy, -c * dx - s * dy
    squared = np.einsum("ni,nij,nj->n", residual, information, residual)
    weight = 1.0 / (1.0 + squared / scale**2)
    W = weight[:, None, None] * information
    WA, WB = W @ by_a, W @ by_b
    At, Bt = by_a.transpose(0, 2, 1), by_b.transpose(0, 2, 1)
    blocks = np.concatenate((At @ WA, At @ WB, Bt @ WA, Bt @ WB))
    rows, columns = np.concatenate((i, i, j, j)), np.concatenate((i, j, i, j))
    at, fixed = np.arange(3), np.arange(3 * held)
    H = csc_matrix(
        (
            np.concatenate((blocks.ravel(), np.full(3 * held, ANCHOR))),
            (
                np.concatenate(((3 * rows[:, None, None] + at[:, None] + 0 * at).ravel(), fixed)),
                np.concatenate(((3 * columns[:, None, None] + at + 0 * at[:, None]).ravel(), fixed)),
            ),
        ),
        shape=(3 * n, 3 * n),
    )
    g = np.zeros((n, 3))
    np.add.at(g, i, np.einsum("nij,nj->ni", At, np.einsum("nij,nj->ni", W, residual)))
    np.add.at(g, j, np.einsum("nij,nj->ni", Bt, np.einsum("nij,nj->ni", W, residual)))
    moved = splu(H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve(
        -g.ravel()
    )
    return moved.reshape(n, 3)
