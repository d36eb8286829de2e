"""The ground truth of simulated pose graphs whose robot walks on a grid: whole metres and quarter turns.

Such a truth is exact, though its files have six digits: a quarter turn of 1.5708 would be 4 mm off after 10,000 steps.
"""

from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array, Ints
from ...core.table import Table
from ..formats.pose_graph import wrapped

QUARTER = np.pi / 2
WRITTEN = 1e-4  # m and rad: farthest from the grid that the six digits of a truth may be
MEASURED = 0.5  # m: the nearest point of the grid is meant, whatever the noise

_COS, _SIN = np.array([1.0, 0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0, -1.0])
_HEADINGS = np.array([0.0, QUARTER, np.pi, -QUARTER])


class Walk(NamedTuple):
    """The poses of a walk, in the order of their ids."""

    ids: Ints  # (n,)
    xy: Array  # (n, 2) m, whole numbers
    quarters: Ints  # (n,) heading in quarter turns, 0 to 3

    @property
    def poses(self) -> Array:
        """(n, 3)."""
        return np.column_stack((self.xy, _HEADINGS[self.quarters]))


def walked(edges: Table, within: float = WRITTEN) -> Walk:
    """The walk from the origin of which `edges`, from to dx dy dtheta, are the motions or measurements.

    Between two consecutive poses the first edge counts; all others have to agree with it. InputError for a row that is
    farther than `within` from the grid, that contradicts the walk, and where no edge joins two consecutive poses.
    """
    start, end = edges.whole("from"), edges.whole("to")
    ids = np.unique(np.concatenate((start, end)))
    first, last = np.searchsorted(ids, start), np.searchsorted(ids, end)
    motion, turn = _on_grid(edges, within)

    neighbours = np.flatnonzero(np.abs(last - first) == 1)
    joined, row = np.unique(np.maximum(first, last)[neighbours], return_index=True)
    for step in np.setdiff1d(np.arange(1, len(ids)), joined):
        raise InputError(
            f"{edges.path}: no edge connects pose {ids[step - 1]} to pose {ids[step]}, expected one between all "
            "consecutive poses."
        )
    row = neighbours[row]
    back = (last < first)[row]
    turns = np.where(back, -turn[row], turn[row])
    quarters = np.concatenate(([0], np.cumsum(turns))) % 4
    ahead = np.where(back[:, None], -_turned(motion[row], turns), motion[row])
    xy = np.concatenate((np.zeros((1, 2)), np.cumsum(_turned(ahead, quarters[:-1]), axis=0)))

    seen = _turned(xy[last] - xy[first], -quarters[first])
    wrong = (seen != motion).any(axis=1) | ((quarters[last] - quarters[first] - turn) % 4 != 0)
    for k in np.flatnonzero(wrong):
        raise edges.fault(k, f"pose {end[k]} seen from pose {start[k]} contradicts the motions between them")
    return Walk(ids, xy, quarters)


def standing(walk: Walk, sightings: Table) -> Map:
    """The landmarks of which `sightings`, pose id x y, are the true ones; InputError where two of one disagree."""
    pose, seen = sightings.whole("pose"), sightings.whole("id")
    step = np.minimum(np.searchsorted(walk.ids, pose), len(walk.ids) - 1)
    for k in np.flatnonzero(walk.ids[step] != pose):
        raise sightings.fault(k, f"a sighting from pose {pose[k]}, expected a pose of an edge")
    places = walk.xy[step] + _turned(sightings.rows[:, 2:4], walk.quarters[step])
    ids, first, which = np.unique(seen, return_index=True, return_inverse=True)
    for k in np.flatnonzero(np.abs(places - places[first][which]).max(axis=1, initial=0) > WRITTEN):
        raise sightings.fault(k, f"landmark {seen[k]} is elsewhere than at its first sighting, expected it to stay")
    return Map(ids, places[first], None)


def nearest(poses: Array) -> Array:
    """The `poses` (n, 3) of the grid that those of an estimate are nearest to."""
    quarters = np.rint(poses[:, 2] / QUARTER).astype(np.int64) % 4
    return np.column_stack((np.rint(poses[:, :2]) + 0.0, _HEADINGS[quarters]))


def _on_grid(edges: Table, within: float) -> tuple[Array, Ints]:
    """The motions (m, 2), in m, and the turns (m,), in quarters, of the grid that are nearest to the edges'."""
    found = wrapped(edges, "dtheta")[:, edges.columns.index("dx") :][:, :3]
    motion, turn = np.rint(found[:, :2]), np.rint(found[:, 2] / QUARTER)
    off = np.maximum(np.abs(found[:, :2] - motion).max(axis=1, initial=0), np.abs(found[:, 2] - turn * QUARTER))
    for row in np.flatnonzero(off > within):
        dx, dy, dtheta = found[row]
        raise edges.fault(row, f"the motion is {dx:g} {dy:g} {dtheta:g}, expected whole metres and quarter turns")
    return motion, turn.astype(np.int64)


def _turned(xy: Array, quarters: Ints) -> Array:
    """The vectors `xy` (m, 2) turned by so many quarters (m,), exactly."""
    c, s = _COS[quarters % 4], _SIN[quarters % 4]
    return np.stack((c * xy[:, 0] - s * xy[:, 1], s * xy[:, 0] + c * xy[:, 1]), axis=-1) + 0.0  # no -0
