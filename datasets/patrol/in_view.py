"""The view of a robot on its round: landmarks on walls, unless another wall is in between."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.elementary import hypot
from ...core.se2 import Array, Ints
from ..rendering._casting import cast
from ..worlds.floor_plan import Plan
from .rounds import WANDERING, Drive, Rounds, places

APART = 0.1  # m of the round between two places from which the view is computed
OFF_WALL = 0.02  # m, of a landmark
NEAREST = 0.3  # m; what is nearer is not sighted
BATCH = 256  # places that are tried at once
BLOCK = 1 << 16  # steps that are worked on at once

_NOBODY = np.zeros((0, 3))


class View(NamedTuple):
    """The landmarks that are in view from places along the round."""

    every: float  # s between two places
    first: Ints  # (m + 1,) rows of `row` of each
    row: Ints  # (v,) landmarks


def landmarks(plan: Plan, path: Rounds, count: int, reach: float, rng: np.random.Generator) -> Array:
    """(count, 2) m: random places on walls, each in view from somewhere on the round."""
    start, end = plan.walls[:, :2], plan.walls[:, 2:]
    length = hypot(*(end - start).T)
    along = (end - start) / length[:, None]
    until = np.cumsum(length)
    found = [np.zeros((0, 2))]
    while sum(map(len, found)) < count:
        at, side = rng.uniform(0.0, until[-1], BATCH), rng.choice([-1.0, 1.0], BATCH)
        wall = np.minimum(np.searchsorted(until, at, "right"), len(until) - 1)
        across = np.stack((-along[wall, 1], along[wall, 0]), axis=-1)
        xy = start[wall] + along[wall] * (at - until[wall] + length[wall])[:, None]
        xy += across * (OFF_WALL * side)[:, None]
        seen = np.unique(view(plan, path, xy, reach - 2 * WANDERING).row)
        found.append(xy[seen])
    return np.concatenate(found)[:count]


def view(plan: Plan, path: Rounds, xy: Array, reach: float) -> View:
    """The landmarks `xy` (n, 2) that are in view from each place of the round, and at most `reach` m away."""
    every = APART / path.speed.max()
    spots = places(path, every * np.arange(int(path.period / every) + 1, dtype=np.float64))
    rows = list[Ints]()
    for x, y in spots.tolist():
        off = xy - (x, y)
        away = hypot(*off.T)
        near = np.flatnonzero((away <= reach) & (away > 0))
        free = cast(plan.walls, _NOBODY, x, y, off[near] / away[near, None], reach + 1.0)
        rows.append(near[free >= away[near]])
    first = np.concatenate(([0], np.cumsum([len(row) for row in rows])))
    return View(every, first.astype(np.int64), np.concatenate(rows).astype(np.int64))


def sighted(drive: Drive, view: View, xy: Array, reach: float) -> Iterator[tuple[Ints, Ints]]:
    """Yields steps and landmarks, block by block: what is in view from the place on the round next to the robot.

    And from NEAREST to `reach` m from the robot itself.
    """
    spot = (drive.phase / view.every).astype(np.int64)
    for begin in range(0, len(spot), BLOCK):
        of = spot[begin : begin + BLOCK]
        counts = view.first[of + 1] - view.first[of]
        step = np.repeat(np.arange(begin, begin + len(of)), counts)
        within = np.arange(len(step)) - np.repeat(np.cumsum(counts) - counts, counts)
        row = view.row[np.repeat(view.first[of], counts) + within]
        away = hypot(*(xy[row] - drive.poses[step, :2]).T)
        kept = (away >= NEAREST) & (away <= reach)
        yield step[kept], row[kept]


def is_free(plan: Plan, poses: Array, xy: Array) -> NDArray[np.bool]:
    """(n,) True where no wall is between a pose (n, 3) and a point (n, 2)."""
    off = xy - poses[:, :2]
    away = hypot(*off.T)
    towards = (off / away[:, None])[:, None]
    free = np.empty(len(xy), bool)
    for k, (x, y, _) in enumerate(poses.tolist()):
        free[k] = cast(plan.walls, _NOBODY, x, y, towards[k], away[k] + 1.0)[0] >= away[k]
    return free
