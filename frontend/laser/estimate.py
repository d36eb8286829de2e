"""The poses of the steps by the front end's own pose graph, which says where to look for loops.

Moving all steps to the optimum costs more the longer the log is, so that is done each time their number has grown by a
tenth: all of these together cost some ten times the last. In between only the last steps move.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ...core.small_matrices import inverse
from .loops import ScanLoop
from .pose_graph import Edges, optimised
from .rows import Rows
from .settings import Settings


class ScanStep(NamedTuple):
    """The pose of a scan, and the motion since the step before."""

    t: float
    scan: int  # its number
    pose: Array  # (3,) on the matcher's path
    delta: Array  # (3,) from the step before
    cov: Array  # (3, 3) in the axes of delta


class StepPoses:
    """The poses of the steps."""

    def __init__(self, settings: Settings) -> None:
        self._settings, self._poses = settings, Rows(3)
        self._loops: list[int] = []  # how many there were when a step came; its own are later ones
        self._whole = 0  # the steps that there were when all were moved

    @property
    def poses(self) -> Array:
        """(n, 3); a view."""
        return self._poses.array

    def append(self, pose: Array, loops: int) -> None:
        """Appends a step's pose, with as many loops as were found so far."""
        self._poses.append(pose)
        self._loops.append(loops)

    def correct(self, steps: Sequence[ScanStep], loops: Sequence[ScanLoop]) -> None:
        """Moves the last steps to the optimum; all of them where enough are new."""
        s, n = self._settings, len(self._poses)
        if n - self._whole >= s.optimise_all * n:
            self.move(steps, loops, 15)
        else:
            self._move(max(1, n - s.optimise_last), steps, loops, 15)

    def move(self, steps: Sequence[ScanStep], loops: Sequence[ScanLoop], iterations: int, *, far: bool = False) -> None:
        """Moves all steps to the optimum, in which loops may be `far` off."""
        self._whole = len(self._poses)
        self._move(1, steps, loops, iterations, far)

    def _move(
        self, first: int, steps: Sequence[ScanStep], loops: Sequence[ScanLoop], iterations: int, far: bool = False
    ) -> None:
        """Moves the steps from `first` on; those before are held."""
        recent = [loop for loop in loops[self._loops[first] :] if loop.step >= first]
        to, step = (np.array([getattr(one, name) for one in recent], np.int64) for name in ("to", "step"))
        last = steps[first:]
        held = np.unique(np.append(to[to < first], first - 1))
        nodes = np.concatenate((held, np.arange(first, len(steps))))
        rows = np.arange(len(held), len(nodes))
        before = np.searchsorted(nodes, np.arange(first - 1, len(steps) - 1))
        delta, cov = np.array([one.delta for one in last]), np.array([one.cov for one in last])
        loop_delta, loop_cov = (np.array([getattr(one, name) for one in recent]) for name in ("delta", "cov"))
        found = optimised(
            self._poses.array[nodes],
            Edges(before, rows, delta, inverse(cov)),
            Edges(
                np.searchsorted(nodes, to),
                np.searchsorted(nodes, step),
                loop_delta.reshape(-1, 3),
                inverse(loop_cov.reshape(-1, 3, 3)),
            ),
            iterations,
            len(held),
            far=far,
        )
        self._poses.array[first:] = found[len(held) :]
