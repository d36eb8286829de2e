"""Partial sightings and fixes in a filter, and the late start of landmarks that one sighting leaves open: one layer.

Of a landmark on the map, a range or a bearing corrects the belief as a whole sighting does. Of another one it is held
back, and the pose is kept in the state (a clone, see `kept_poses`): when the held ones together place the landmark
(see `..starting.placing`), it enters the map without prior information, and all of them correct the belief at once,
about the kept poses. So nothing is used twice, all cross-covariances are those of the measurements, and no earlier
linearisation is at a place that may be wrong. Poses that nothing waits for leave the state, which is exact.

At most `MOST` sightings of a landmark wait; of more, the one is dropped whose neighbours along the way are closest.

Constant errors (`Systematic`) are entries of the state: scale and offset of ranges, the heading's offset, and the scale
of the wheels, by which the robot has moved less at every step than odometry says.

The layer decides what is used when; a filter does it to its own belief, by the methods of `Parts`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...core.factors import Odometry, Prior, Step, Systematic
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ..api import Constant, Diverged
from ..starting.drift import relative
from ..starting.placing import placed
from ._ekf import AT_ROBOT
from ._partial import NO_ENTRY, REFUSED, USED

MOST = 40
"""Sightings of one landmark that wait."""

FURTHER = 0.05
"""Share of its way since the first that the robot must add before the sightings are tried again."""

LOOSE = 1e4
"""Standard deviation of a new landmark, in those of its place: it has no prior information to eight digits."""

NO_GATES = np.zeros(3)
"""Of one, two and three degrees of freedom."""

OWN = (-3, -2, -1)
"""Entries of the present pose."""


class Parts(Protocol):
    """A filter's belief as this layer corrects it: a pose, and a state of pairs of entries.

    An entry is counted from the first one after the pose. The seven entries of a partial sighting are the pose's x, y
    and heading, the landmark's x and y, scale and offset of ranges; NO_ENTRY where there is none. Outcomes are USED,
    REFUSED by a gate, or a reason of failure.
    """

    @property
    def pairs(self) -> int:
        """The pairs of the state."""
        ...

    def constant(self, first: float, second: float) -> int:
        """Adds a pair of constant errors around zero, with these standard deviations; returns its first entry."""
        ...

    def constants(self, entry: int) -> tuple[float, float]:
        """The present means of a pair of constant errors."""
        ...

    def one(self, entry: int) -> tuple[float, float]:
        """The present mean of an entry, and its standard deviation."""
        ...

    def shift(self, entry: int, ahead: float, left: float) -> None:
        """Adds this entry's error, times a way in the body's frame, to that of the pose's position."""
        ...

    def space(self) -> list[tuple[int, int]]:
        """Adds space for poses to keep; returns the entries of each: x, with y after it, and heading."""
        ...

    def keep(self, clone: tuple[int, int]) -> None:
        """Clones the pose into these entries."""
        ...

    def poses(self, clones: Ints) -> tuple[Array, Array]:
        """Kept poses (k, 3) in the world at entries (k, 2), and their joint covariance (3k, 3k)."""
        ...

    def begin(self, xy: Array, sd: float, agreed: int) -> int:
        """Adds a landmark at xy (2,), independent, of standard deviation `sd` (m); returns its pair.

        `agreed` sightings have placed it.
        """
        ...

    def partly(self, entries: Ints, slot: int, kind: int, z: float, var: float, gate: float) -> tuple[int, float]:
        """Corrects by a partial sighting of a landmark, with these entries (7,) and the filter's number `slot`.

        The number is negative for a landmark held fixed, which has no entries. Returns the outcome and the squared
        distance.
        """
        ...

    def together(self, entries: Ints, kind: Ints, z: Array, var: Array) -> int:
        """Corrects by k <= MOST partial sightings at once, with entries (k, 7); returns the outcome."""
        ...

    def fixed(self, offset: int, z: Array, cov: Array, arm: Array, gate: float) -> tuple[int, float, int]:
        """Corrects by a fix; `offset` is the entry of the heading's constant error.

        Returns the outcome, the squared distance and the number of entries measured.
        """
        ...

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending."""
        ...


@dataclass
class _Clone:
    """A kept pose, by the number of held sightings that need it."""

    entries: tuple[int, int]  # of x, with y after it; of the heading
    way: float  # m, along which the robot had come
    needed: int = 0


@dataclass
class _Held:
    """A sighting that waits."""

    clone: _Clone
    kind: int
    z: float
    var: float


def nothing(landmark: int, slot: int) -> None:
    """A landmark has entered the map, which a filter need not be told."""
    del landmark, slot


class LateStarts:
    """The part of a filter for logs with partial sightings or fixes."""

    def __init__(
        self, parts: Parts, prior: Prior, slot: dict[int, int], started: Callable[[int, int], None] = nothing
    ) -> None:
        """`slot` has the filter's numbers of landmarks by id, the pairs of those in the state.

        `started` is told of a new one, and of its pair.
        """
        self._parts, self._slot, self._started = parts, slot, started
        self._prior: Systematic = prior.systematic
        self._held: dict[int, list[_Held]] = {}
        self._tried: dict[int, float] = {}  # m, the way at which a landmark was tried last
        self._free: list[tuple[int, int]] = []  # entries of poses that are needed no longer
        self._way = 0.0
        scale, offset, heading, each, wheels = self._prior
        self._ranging = scale > 0 or offset > 0
        self._common = parts.constant(scale, offset) if self._ranging and not each else NO_ENTRY
        self._each: dict[int, int] | None = {} if self._ranging and each else None
        self._heading = parts.constant(heading, 0.0) if heading > 0 else NO_ENTRY
        self._wheels = parts.constant(wheels, 0.0) if wheels > 0 else NO_ENTRY

    def moved(self, odometry: Odometry | None) -> Odometry | None:
        """The motion by the wheels' scale at present, whose error is added to the pose's before that motion.

        The way of d = s / (1 + scale) changes by -d / (1 + scale); a motion leaves an error of the position as it is.
        """
        if self._wheels == NO_ENTRY or odometry is None:
            return odometry
        longer = 1 + self._parts.constants(self._wheels)[0]
        true = np.array((1 / longer, 1 / longer, 1.0))
        delta = odometry.delta * true
        self._parts.shift(self._wheels, -float(delta[0]) / longer, -float(delta[1]) / longer)
        return Odometry(delta, odometry.cov * np.outer(true, true))

    def step(self, step: Step, gates: Array) -> tuple[float, int, int]:
        """Corrects by a step's fixes and partial sightings, after its motion and whole sightings.

        `gates` (3,) are those of one, two and three degrees of freedom, 0 for none. Returns the squared distances of
        what was used, their degrees of freedom, and the number refused.
        """
        if step.odometry is not None:
            self._way += float(np.hypot(*step.odometry.delta[:2]))
        parts, nis, dof, refused = self._parts, 0.0, 0, 0
        for z, cov, arm in zip(*step.fixes, strict=True):
            measured = int(np.sum(~np.isnan(z)))
            why, distance, k = parts.fixed(self._heading, z, cov, arm, float(gates[measured - 1]))
            refused += self._counted(why, "a fix")
            if why == USED:
                nis, dof = nis + distance, dof + k
        waiting = list[_Held]()
        for landmark, kind, z, var in zip(*(column.tolist() for column in step.partial), strict=True):
            if landmark not in self._slot:
                waiting.append(self._hold(landmark, kind, z, var))
                continue
            entries = self._entries(OWN, landmark, kind)
            why, distance = parts.partly(entries, self._slot[landmark], kind, z, var, float(gates[0]))
            refused += self._counted(why, f"landmark {landmark}")
            if why == USED:
                nis, dof = nis + distance, dof + 1
        if waiting:
            self._keep(waiting)
        for landmark in dict.fromkeys(step.partial.ids.tolist()):
            if landmark in self._held and landmark not in self._slot:
                self._try(landmark)
        for landmark in [one for one in step.sightings.ids.tolist() if one in self._held]:
            self._use(landmark)  # a whole sighting has started it
        return nis, dof, refused

    def compacted(self) -> bool:
        """Takes out the kept poses where nothing waits any longer; True if pairs of the state have moved."""
        if self._held or not self._free:
            return False
        gone = {entry // 2 for entries in self._free for entry in entries}
        left = [pair for pair in range(self._parts.pairs) if pair not in gone]
        self._parts.reduce(left)
        place = {pair: i for i, pair in enumerate(left)}
        for landmark, pair in self._slot.items():
            self._slot[landmark] = place.get(pair, pair)  # one held fixed has no pair
        for name in ("_common", "_heading", "_wheels"):
            entry = getattr(self, name)
            setattr(self, name, entry if entry == NO_ENTRY else 2 * place[entry // 2])
        if self._each is not None:
            self._each = {landmark: 2 * place[entry // 2] for landmark, entry in self._each.items()}
        self._free = []
        return True

    @property
    def range_errors(self) -> tuple[float, float] | None:
        """The scale and offset (m) of all ranges at present, where they are estimated together."""
        return None if self._common == NO_ENTRY else self._parts.constants(self._common)

    def constant(self, landmarks: Iterable[int]) -> Constant | None:
        """The constant errors at present, those of each landmark's ranges in the order given; None without any."""
        if self._prior == Systematic(each=self._prior.each):
            return None
        entries = [self._common] if self._each is None else [self._each.get(one, NO_ENTRY) for one in landmarks]
        pairs = np.array([self._pair(entry) for entry in entries]).reshape(-1, 2, 2)
        turn, longer = (
            (0.0, sd) if entry == NO_ENTRY else self._parts.one(entry)
            for entry, sd in ((self._heading, self._prior.heading_offset), (self._wheels, self._prior.wheel_scale))
        )
        return Constant(
            pairs[:, 0, 0],
            pairs[:, 1, 0],
            turn[0],
            longer[0],
            Constant(pairs[:, 0, 1], pairs[:, 1, 1], turn[1], longer[1]),
        )

    def _pair(self, entry: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """The scale and the offset at an entry, each with its standard deviation: those of the prior without one."""
        if entry == NO_ENTRY:
            return (0.0, self._prior.range_scale), (0.0, self._prior.range_offset)
        return self._parts.one(entry), self._parts.one(entry + 1)

    def _errors(self, landmark: int) -> int:
        """The first entry of the errors of ranges to a landmark."""
        if self._each is None:
            return self._common
        if landmark not in self._each:
            self._each[landmark] = self._parts.constant(self._prior.range_scale, self._prior.range_offset)
        return self._each[landmark]

    def _entries(self, pose: tuple[int, int, int], landmark: int, kind: int) -> Ints:
        """The seven entries of a partial sighting."""
        slot, errors = self._slot[landmark], self._errors(landmark) if kind == RANGE else NO_ENTRY
        place = (2 * slot, 2 * slot + 1) if slot >= 0 else (NO_ENTRY, NO_ENTRY)
        both = (NO_ENTRY, NO_ENTRY) if errors == NO_ENTRY else (errors, errors + 1)
        return np.array((*pose, *place, *both), np.int64)

    def _hold(self, landmark: int, kind: int, z: float, var: float) -> _Held:
        one = _Held(_Clone((NO_ENTRY, NO_ENTRY), self._way), kind, z, var)
        self._held.setdefault(landmark, []).append(one)
        return one

    def _keep(self, waiting: list[_Held]) -> None:
        """Keeps the present pose for the sightings of this step that wait."""
        if not self._free:
            self._free = self._parts.space()
        clone = _Clone(self._free.pop(), self._way, len(waiting))
        for one in waiting:
            one.clone = clone
        self._parts.keep(clone.entries)

    def _release(self, one: _Held) -> None:
        one.clone.needed -= 1
        if one.clone.needed == 0:
            self._free.append(one.clone.entries)

    def _try(self, landmark: int) -> None:
        """Starts a landmark if its held sightings place it."""
        held = self._held[landmark]
        while len(held) > MOST:
            ways = np.array([one.clone.way for one in held])
            self._release(held.pop(1 + int(np.argmin(ways[2:] - ways[:-2]))))
        way = self._way - held[0].clone.way
        if len(held) < 2 or way < (1 + FURTHER) * self._tried.get(landmark, 0.0):
            return
        self._tried[landmark] = way
        poses, drift = self._poses(held)
        kind = np.array([one.kind for one in held])
        scale, offset = self._parts.constants(self._errors(landmark)) if self._ranging else (0.0, 0.0)
        z = np.array([one.z for one in held])
        z = np.where(kind == RANGE, np.maximum(z - offset, 0.0) / (1 + scale), z)
        place = placed(poses, kind, z, np.array([one.var for one in held]), drift)
        if place is None or not place.sure:
            return
        loose = LOOSE * float(np.sqrt(np.trace(place.cov)))
        pair = self._slot[landmark] = self._parts.begin(place.xy, loose, len(held))
        self._started(landmark, pair)
        self._use(landmark)

    def _use(self, landmark: int) -> None:
        """Corrects by the held sightings of a landmark that is on the map."""
        held = self._held.pop(landmark)
        self._tried.pop(landmark, None)
        rows = [
            self._entries((one.clone.entries[0], one.clone.entries[0] + 1, one.clone.entries[1]), landmark, one.kind)
            for one in held
        ]
        why = self._parts.together(
            np.array(rows), np.array([one.kind for one in held], np.int64),
            np.array([one.z for one in held]), np.array([one.var for one in held]),
        )  # fmt: skip
        self._counted(why, f"landmark {landmark}")
        for one in held:
            self._release(one)

    def _poses(self, held: list[_Held]) -> tuple[Array, Array]:
        """The poses (k, 3) of held sightings, and their covariance (3k, 3k) as seen from the last of them."""
        poses, cov = self._parts.poses(np.array([one.clone.entries for one in held]))
        return poses, relative(poses[:, :2], cov)

    @staticmethod
    def _counted(why: int, of: str) -> int:
        """1 for a refused measurement; Diverged where it could not be used."""
        if why == AT_ROBOT:
            raise Diverged(f"the estimate of {of} lies at the robot's own position, where a range has no derivative")
        if why not in (USED, REFUSED):
            raise Diverged(f"the innovation covariance of {of} is not positive definite")
        return int(why == REFUSED)
