"""Partial sightings that wait until they place their landmark."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Map, Odometry
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from .drift import Drift
from .placing import placed

MORE = 1.1  # growth of a landmark's sightings after which it is placed again

MOST = 100
"""Sightings that a landmark is placed by; of more, as many, evenly chosen."""

NEAREST, FARTHEST = 1e-3, 10.0
"""m; least distance of a landmark from the pose that it starts at, and that of one with a single bearing."""


class Seen(NamedTuple):
    """A partial sighting."""

    step: int
    kind: int
    z: float
    var: float


class LatePlaces:
    """Holds back partial sightings of landmarks that are on no map until they place them."""

    def __init__(self) -> None:
        self._held: defaultdict[int, list[Seen]] = defaultdict(list)
        self._next: dict[int, float] = {}  # sightings at which a landmark is placed next
        self._drift = Drift()

    @property
    def waits(self) -> bool:
        """True while something is held back: then every motion is needed."""
        return len(self._held) > 0

    def move(self, odometry: Odometry | None) -> None:
        """Adds the motion to the next step."""
        self._drift.move(odometry)

    def hold(self, landmark: int, seen: Seen) -> None:
        """Adds a sighting."""
        if not self._held:
            self._drift.begin(seen.step)
        self._held[landmark].append(seen)

    def found(self, landmark: int, poses: Callable[[Sequence[int]], Array], since: int = 0) -> Array | None:
        """(2,) m, a landmark's place by the poses (k, 3) of k steps; None while it is not sure.

        Sightings before step `since` are dropped.
        """
        held = self._since(landmark, since)
        if len(held) < max(2, self._next.get(landmark, 0)):
            return None
        self._next[landmark] = MORE * len(held)
        held = [held[i] for i in thinned(len(held)).tolist()]
        steps = [one.step for one in held]
        path = poses(steps)
        place = placed(path, *_columns(held), self._drift.between(np.array(steps), path[-1, 2]))
        return place.xy if place is not None and place.sure else None

    def taken(self, landmark: int, since: int = 0) -> list[Seen]:
        """Everything held of a landmark from step `since` on; then nothing is held."""
        held = self._since(landmark, since)
        self._next.pop(landmark, None)
        self._held.pop(landmark, None)
        return held

    def ended(self, path: Array) -> list[tuple[int, Array]]:
        """Landmarks that are held back, each with its place (2,), m, by the whole `path` (n, 3), if it has one."""
        found = ((i, placed(path[[one.step for one in held]], *_columns(held))) for i, held in self._held.items())
        return [(landmark, place.xy) for landmark, place in found if place is not None]

    def added_to(self, landmarks: Map, path: Array) -> Map:
        """The map with those still held back, without covariance, where they are likeliest."""
        alone = {i: held for i, held in self._held.items() if i not in landmarks.ids}
        if not alone:
            return landmarks
        more = np.array([likeliest(path[[one.step for one in held]], *_columns(held)) for held in alone.values()])
        return Map(np.array([*landmarks.ids, *alone], np.int64), np.concatenate((landmarks.xy, more)), None)

    def _since(self, landmark: int, step: int) -> list[Seen]:
        """The sightings held of a landmark, without those before a step."""
        held = self._held[landmark]
        gone = next((i for i, one in enumerate(held) if one.step >= step), len(held))
        if gone:
            del held[:gone]
            self._next[landmark] = self._next.get(landmark, 0) - gone  # as many more as ever are needed
        return held


def thinned(n: int) -> Ints:
    """The rows of n sightings that place a landmark: all, or as many as `MOST` of them, evenly chosen."""
    return np.linspace(0, n - 1, min(n, MOST)).round().astype(np.int64)


def likeliest(poses: Array, kind: Ints, z: Array, var: Array) -> Array:
    """(2,) m, the likeliest place of a landmark by k partial sightings from poses (k, 3)."""
    found = placed(poses, kind, z, var)
    return somewhere(poses[-1], float(z[-1]), int(kind[-1])) if found is None else found.xy


def somewhere(pose: Array, z: float, kind: int) -> Array:
    """A place that fits one range, ahead, or one bearing, at a stated distance."""
    r, turn = (max(z, NEAREST), 0.0) if kind == RANGE else (FARTHEST, z)
    return pose[:2] + r * np.array((np.cos(pose[2] + turn), np.sin(pose[2] + turn)))


def _columns(held: list[Seen]) -> tuple[Ints, Array, Array]:
    _, kind, z, var = zip(*held, strict=True)
    return np.array(kind, np.int64), np.array(z), np.array(var)
