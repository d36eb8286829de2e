"""Loop closures from marginalised steps to steps that are held, as loop closures from held steps near their begin."""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, compose, compose_jacobians, rotation, wrap
from ..smoothing._factors import weight
from ..smoothing._graph import COVARIANCE, LINKS, LOOP, LOSS, MOTION, SCALE, STEP, WEIGHT, A, B, Graph
from ..smoothing._links import relink
from ..smoothing._log import add_loop, covariance_of
from .anchored import NOWHERE, Anchors
from .compacted import Which

MOVED = 3  # LOOP of a link that sums up transferred loop closures

LEAST = 1e-3  # weight by a robust loss below which a loop closure is left out


class Moved(NamedTuple):
    """A pose relative to a held step, with a covariance there."""

    to: int  # row of the step that it leads to
    by: int  # row of the step that has the place of the marginalised one
    delta: Array  # (3,)
    cov: Array  # (3, 3) of the loop closure and the marginalised pose
    own: Array  # (3, 3) of the pose of row `by`


def transferred(
    g: Graph, first: int, last: int, path: Array, left: Array, held: Which, near: Anchors, reach: float
) -> list[Moved]:
    """The loop closures from rows `first` to `last`, which are marginalised, to rows that are `held` (n,).

    A marginalised pose b is known from the landmarks, with the covariance `left` (k, 3, 3), and so is the pose c of the
    nearest of the anchors `near` within `reach` (m), with its own. A loop closure a to b is one from a to c, with the
    errors of all three. What it told of b is taken back from b's pose first: with the sightings alone it is known where
    b is, and no measurement is used twice. The nearest and not the best known: with a few for all, their errors would
    be shared by many.
    """
    out, links = list[Moved](), g.links[: g.state[LINKS]]
    to, by = g.variables[links[:, A], STEP], g.variables[links[:, B], STEP]
    some = (links[:, LOOP] == 1) & (by >= first) & (by <= last)
    for k in np.flatnonzero(some & held[to]).tolist():
        a, b, C, L = path[to[k]], path[by[k]].copy(), np.zeros((3, 3)), g.linked[k]
        covariance_of(L, COVARIANCE, C)
        z, own = L[MOTION : MOTION + 3].copy(), left[by[k] - first]
        T = rotation(float(a[2]))
        e = compose(a, z) - b
        e[2] = wrap(e[2])
        S = T @ C @ T.T
        share = weight(g.settings[LOSS], g.settings[SCALE], float(e @ np.linalg.solve(S, e))) * float(L[WEIGHT])
        at = int(near.nearest(b[None], reach)[0])
        if at == NOWHERE or share < LEAST or near.variables[at] == links[k, A]:
            continue
        b -= own @ np.linalg.solve(S / share, e)
        c = near.poses[at]
        way = between(b, c)
        G = lever(b, c)
        R = rotation(float(b[2]))
        by_z, by_way = compose_jacobians(z, way)
        cov = by_z @ C @ by_z.T / share + by_way @ (R.T @ G @ own @ G.T @ R) @ by_way.T
        delta = compose(z, way)
        turned = rotation(float(c[2] - delta[2]))
        out.append(
            Moved(int(to[k]), int(g.variables[near.variables[at], STEP]), delta, cov, turned.T @ near.covs[at] @ turned)
        )
    return out


def lever(a: Array, b: Array) -> Array:
    """(3, 3): an error of pose a (3,) as one of a pose b (3,) that is fixed to it."""
    G = np.eye(3)
    G[:2, 2] = a[1] - b[1], b[0] - a[0]
    return G


class Transfers:
    """Transferred loop closures, summed up for each pair of held steps.

    Those of a pair share the error of the pose that has the place of the marginalised ones: it is added to the
    covariance of their weighted mean, once.
    """

    def __init__(self) -> None:
        self._sums = dict[tuple[int, int], tuple[Array, Array]]()  # by steps: the mean (3,) and its information (3, 3)

    def __len__(self) -> int:
        return len(self._sums)

    def add(self, moved: Moved, steps: tuple[int, int]) -> tuple[Array, Array]:
        """Adds one from and to these `steps`; returns the mean (3,) of the pair and its covariance (3, 3)."""
        W = np.linalg.inv(moved.cov)
        delta, total = self._sums.get(steps, (moved.delta, np.zeros((3, 3))))
        off = moved.delta - delta
        off[2] = wrap(off[2])
        total = total + W
        delta = delta + np.linalg.solve(total, W @ off)
        delta[2] = wrap(delta[2])
        self._sums[steps] = delta, total
        cov = np.linalg.inv(total) + moved.own
        return delta, (cov + cov.T) / 2


def link(g: Graph, a: int, b: int, delta: Array, cov: Array) -> None:
    """Has the one link that sums up transfers between variables a and b state this motion and covariance.

    There must be room for it.
    """
    links = g.links[: g.state[LINKS]]
    found = np.flatnonzero((links[:, LOOP] == MOVED) & (links[:, A] == a) & (links[:, B] == b))
    if len(found) == 0:
        k = int(g.state[LINKS])
        add_loop(g, a, b, delta, cov)
        g.links[k, LOOP] = MOVED
        return
    k = int(found[0])
    g.linked[k, MOTION : MOTION + 3], g.linked[k, COVARIANCE : COVARIANCE + 6] = delta, cov[np.triu_indices(3)]
    relink(g, k)
