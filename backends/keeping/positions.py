"""Positions and headings measured at marginalised steps, as such of held steps nearby."""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints, wrap
from ..smoothing._factors import fix_off
from ..smoothing._graph import END, FIRST, FIX, PART, STEP, Graph
from ..smoothing._log import covariance_of
from .anchored import NOWHERE, Anchors
from .transfers import lever

WEAK = 0.3
"""rad; standard deviation with which a pose's heading is stated beside transferred positions.

Without, positions near a pose say next to nothing of its heading, and their least squares may lie turns away. The
landmarks tell a heading a hundred times as well.
"""


class MovedFix(NamedTuple):
    """A fix as information about the offset of a held pose, and the right-hand side, linearised at that pose."""

    by: int  # row of the step
    information: Array  # (3, 3)
    side: Array  # (3,)
    own: Array  # (3, 3) covariance of the pose given its landmarks


def measured(g: Graph, v: int) -> Ints:
    """The rows of `fixed` that a pose has."""
    parts = g.sightings[g.variables[v, FIRST] : g.variables[v, END], PART]
    return FIX - parts[parts <= FIX]


def told(g: Graph, row: int, pose: Array) -> tuple[Array, Array, Array]:
    """Residual (3,) of a row of `fixed` at a pose (3,), derivative (3, 3) by the pose, and information (3, 3)."""
    e0, e1, e2, east, north = fix_off(pose[0], pose[1], pose[2], 0.0, g.fixed, row)
    W = np.zeros((3, 3))
    covariance_of(g.fixed[row], 3, W)
    return np.array([e0, e1, e2]), np.array([[1.0, 0.0, -north], [0.0, 1.0, east], [0.0, 0.0, 1.0]]), W


def moved_fixes(
    g: Graph, first: int, last: int, path: Array, left: Array, near: Anchors, reach: float
) -> tuple[list[MovedFix], int]:
    """The fixes of rows `first` to `last`, which are marginalised; and how many of these have no anchor `near`.

    The landmarks tell where a marginalised pose is, with the covariance `left` (k, 3, 3), relative to the anchor within
    `reach` (m) that is known best, whose error counts once. So a fix of the one is a fix of a point fixed to the other.
    What it told of its own pose is taken back: the residual is that by the sightings alone.
    """
    out, lost = list[MovedFix](), 0
    for k in range(first, last + 1):
        if g.at[k] < 0:
            continue
        for row in measured(g, int(g.at[k])).tolist():
            at = near.best(path[k], reach)
            if at == NOWHERE:
                lost += 1
                continue
            e, H, W = told(g, row, path[k])
            by_anchor = H @ lever(near.poses[at], path[k])
            known = np.linalg.solve(np.eye(3) + W @ H @ left[k - first] @ H.T, W)
            by = int(g.variables[near.variables[at], STEP])
            out.append(MovedFix(by, by_anchor.T @ known @ by_anchor, -by_anchor.T @ W @ e, near.covs[at]))
    return out, lost


class _Sum(NamedTuple):
    pose: Array  # (3,) that offsets are from
    fix: Array  # (9,) the pose's own first fix, about that: information (6), right-hand side (3)
    information: Array  # (3, 3) of what was transferred, about the landmarks around
    side: Array  # (3,)
    own: Array  # (3, 3)


class Positions:
    """All that was transferred to each held step: one row of `fixed`, in place of its own first one.

    Its sum is known relative to the landmarks around, and the pose's own error counts once, whatever it has summed up.
    """

    def __init__(self) -> None:
        self._sums = dict[int, _Sum]()  # by step

    def __len__(self) -> int:
        return len(self._sums)

    def add(self, g: Graph, moved: MovedFix, step: int, pose: Array) -> None:
        """Adds one to a `step` that has a fix, and a pose (3,), in its row of `fixed`."""
        v = int(g.at[moved.by])
        row = int(measured(g, v)[0])
        if step not in self._sums:
            e, H, W = told(g, row, pose)
            own = H.T @ W @ H
            own[2, 2] += WEAK**-2
            fix = np.concatenate((own[np.triu_indices(3)], -H.T @ W @ e))
            self._sums[step] = _Sum(pose.copy(), fix, np.zeros((3, 3)), np.zeros(3), moved.own)
        of = self._sums[step]
        off = pose - of.pose
        off[2] = wrap(off[2])
        of = of._replace(
            information=of.information + moved.information, side=of.side + moved.side + moved.information @ off
        )
        self._sums[step] = of
        once, total = np.linalg.inv(np.eye(3) + of.information @ of.own), np.zeros((3, 3))
        covariance_of(of.fix, 0, total)
        total += once @ of.information
        offset = np.linalg.solve(total, of.fix[6:] + once @ of.side)
        there = of.pose + offset
        there[2] = wrap(there[2])
        g.fixed[row] = np.concatenate((there, total[np.triu_indices(3)], np.zeros(2)))
