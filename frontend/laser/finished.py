"""The finished submaps that a front end keeps: as many as its floor has room for, however long it drives.

Ground that was drawn again and again is kept by its first submap, whose place is the least uncertain, and by the
newest, which show what has changed. Those that were not searched lately are packed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints
from .settings import Settings
from .submap import Submap


class Near(NamedTuple):
    """A submap near a pose."""

    distance: float  # m to its nearest step
    submap: Submap
    step: int  # that step


class Finished:
    """Finished submaps in the order of time."""

    def __init__(self, settings: Settings) -> None:
        self.kept: list[Submap] = []
        self.count = 0  # of all that were finished
        self._settings = settings
        self._opened: list[Submap] = []  # unpacked; the last one used at the end
        self._steps: Ints = np.zeros(0, np.int64)  # (m,) those of all submaps that are kept
        self._first: Ints = np.zeros(0, np.int64)  # (n,) of each submap, its first row there

    def add(self, submap: Submap, estimate: Array) -> None:
        """Adds a submap and drops those that newer ones replace; `estimate` (k, 3) are the poses of the steps."""
        self.count += 1
        if not submap.steps:
            return
        submap.pack()
        self.kept.append(submap)
        self._index()
        self._thin(estimate)

    def near(self, here: Array, estimate: Array, before: float) -> list[Near]:
        """The submaps within `loop_radius` of a pose that were finished at `before` (m of path), nearest first."""
        s = self._settings
        if not self.kept:
            return []
        off = estimate[self._steps, :2] - here[:2]
        distance = np.hypot(off[:, 0], off[:, 1])
        least = np.minimum.reduceat(distance, self._first)
        found = list[Near]()
        for number in np.argsort(least, kind="stable").tolist():
            submap = self.kept[number]
            if least[number] >= s.loop_radius or len(found) == s.loop_submaps:
                break
            if submap.died <= before:
                first = int(self._first[number])
                nearest = int(np.argmin(distance[first : first + len(submap.steps)]))
                found.append(Near(float(least[number]), submap, submap.steps[nearest]))
        return found

    def use(self, submap: Submap) -> None:
        """Tells that a submap is searched; the one not used for the longest time is packed."""
        if submap in self._opened:
            self._opened.remove(submap)
        self._opened.append(submap)
        if len(self._opened) > self._settings.opened:
            self._opened.pop(0).pack()

    def _index(self) -> None:
        lengths = [len(submap.steps) for submap in self.kept]
        self._steps = np.concatenate([np.array(submap.steps, np.int64) for submap in self.kept])
        self._first = np.cumsum([0, *lengths[:-1]])

    def _thin(self, estimate: Array) -> None:
        """Drops submaps around the new one, the oldest first, whose ground is in one older and `newer` newer ones."""
        s, poses = self._settings, estimate[self._steps]
        of = np.repeat(np.arange(len(self.kept)), np.diff(self._first, append=len(self._steps)))
        stays = np.ones(len(self.kept), np.bool_)
        for number in np.unique(of[_around(poses, poses[self._first[-1] :], s.ground)])[: -s.newer].tolist():
            mine = poses[of == number]
            rows = np.flatnonzero(_around(poses, mine, s.ground) & stays[of])
            dx, dy, turned = (mine[:, None] - poses[rows]).transpose(2, 0, 1)
            same = (dx * dx + dy * dy < s.ground**2) & (np.cos(turned) > np.cos(s.ground_turn))
            first = np.flatnonzero(np.diff(of[rows], prepend=-1))
            covers, others = np.logical_or.reduceat(same, first, axis=1), of[rows][first]
            older = covers[:, others < number].any(axis=1)
            newer = covers[:, others > number].sum(axis=1) >= s.newer
            stays[number] = (older & newer).mean() < s.replaced
        if not stays.all():
            self.kept = [submap for submap, stay in zip(self.kept, stays.tolist(), strict=True) if stay]
            self._opened = [submap for submap in self._opened if submap in self.kept]
            self._index()


def _around(poses: Array, some: Array, far: float) -> NDArray[np.bool_]:
    """Which poses (m, 3) are in the box around `some` (k, 3) or within `far` (m) of it."""
    low, high = some[:, :2].min(axis=0) - far, some[:, :2].max(axis=0) + far
    return ((poses[:, :2] >= low) & (poses[:, :2] <= high)).all(axis=1)
