"""Takes out landmarks that move, in front of a backend: the backend gets the sightings of landmarks that stand.

The backend states where it expects the landmarks of a frame, with their joint covariance. A sighting that is off, given
the others of the frame, is not handed on. If the next ones of its landmark are right again, it was misread: its id is
another landmark's. If three in a row are off and agree on another place, or on a steady motion, the landmark has moved.
One that moves less than its sightings err is found by sums of its displacements, which noise as stated drives beyond
their threshold at one sighting in a million, so that fewer than one in 1000 standing landmarks is named in a thousand
sightings of each. What has moved is not handed on any more, and leaves the map; what the backend has learnt from it
before stays.

Nothing is held back until it is confirmed: to drop the first sightings of every landmark costs far more than a mover
does. So a landmark may be mapped by a misread sighting. If three sightings agree on another place before others have
agreed with the first, it is mapped again, under an id of this layer's own.
"""

import math
from typing import Any

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, Step, Truth
from ...core.gyro import Turn
from ...core.se2 import Array, Ints, compose, wrap
from .._joint_compatibility import Gates
from ..api import Backend, Belief, Expected, Foresees, Pose, Solution, TakenOut, WantsTruth
from ._standing import AGREES, FEW, FORGETS, MOVED, STOOD_ELSEWHERE, Records, Sightings, follow, judge
from .quantiles import gates, quantile

MATCH, CAREFUL, JOINT = 0.9999, 0.99, 0.9999
"""Probabilities that a right sighting is within its gate: of a landmark that is settled, of another, all jointly."""

ALARM = 30.0
"""Squared distance of a sum of displacements: noise exceeds it with probability exp(-15), twice that for two sums."""

ASKED, FURTHER = 50.0, 1e4
"""Squared distances within which landmarks are asked for: about where they last were, and after a correction."""

NODES = 2000  # most nodes of the search for the sightings that agree

CROWD = 60
"""Sightings in a frame above which none is judged: the cost grows with the fourth power of their number."""

HELD = 10
"""Sightings of a new landmark that are not handed on as they are where another one is expected."""

LOST = 3
"""Landmarks that are off while none agrees: then it is the robot that is elsewhere, and they are handed on."""

STEP, MEDIAN = 0.02, 2 * math.log(2)
"""By how much the logarithm of the running median of squared distances follows each; the median of right ones."""

FIRST = -(2**40)  # the first id of a landmark that is mapped again; the next ones are below it
SLOTS = 64  # landmarks that space is reserved for at first


class Standing:
    """A backend that landmarks which move are taken out in front of."""

    def __init__(self, inner: Backend, prior: Prior) -> None:
        self._inner: Any = inner
        self._foresees = prior.gyro is not None and isinstance(inner, Foresees)
        self._pose: Array = prior.pose.copy()
        self._records, self._count = _records(SLOTS), 0
        self._slot: dict[int, int] = {}
        self._moved: dict[int, None] = {}  # in the order in which they were found
        self._inside: dict[int, int] = {}  # id -> that of the landmark that was mapped again
        self._called: dict[int, int] = {}  # and the inverse
        self._wrong: set[int] = set()  # ids, inside, of landmarks that have been mapped again
        self._held: dict[int, int] = {}  # new landmark -> sightings not handed on
        self._off: dict[int, int] = {}  # landmark -> sightings not handed on
        self._doubted: set[int] = set()  # landmarks off since any has agreed
        self._log_median = 0.0  # of squared distances
        self._refused = 0  # sightings of the last step that were not handed on
        self._match, self._careful = quantile(MATCH, 1), quantile(CAREFUL, 1)
        self._gates = gates(JOINT, SLOTS)
        known = prior.map
        if known is not None:
            self._slot = {i: self._recorded(xy, FEW) for i, xy in zip(known.ids.tolist(), known.xy, strict=True)}

    def step(self, step: Step) -> Pose | None:
        """Hands the step on without sightings that are off, or of landmarks that have moved."""
        ids, z, cov = step.sightings
        self._refused = 0
        self.foresee(step.gyro)
        if len(ids):
            names = ids.tolist()
            keep = self._kept(step, names)
            if not all(keep):
                self._refused = keep.count(False)
                ids, z, cov = ids[keep], z[keep], cov[keep]
                step = step._replace(signatures=step.signatures.rows(keep) if len(step.signatures) else step.signatures)
            if self._inside:
                ids = np.array([self._inside.get(name, name) for name in ids.tolist()], np.int64)
            step = step._replace(sightings=RangeBearing(ids, z, cov))
        pose = self._inner.step(step)
        if pose is not None:
            self._pose = pose.copy()
        return pose

    def foresee(self, turn: Turn | None) -> None:
        """Hands the next step's turn on to a backend that expects by it."""
        if self._foresees:
            self._inner.foresee(turn)

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """The backend's expectation, without landmarks that have moved."""
        found: Expected = self._inner.expected(odometry, seen, gate)
        keep = self._standing(found.ids)
        if len(keep) < len(found.ids):
            entries = np.stack((2 * keep, 2 * keep + 1), axis=1).ravel()
            found = Expected(found.ids[keep], found.z[keep], np.ascontiguousarray(found.cov[np.ix_(entries, entries)]))
        return found._replace(ids=self._translated(found.ids))

    def belief(self) -> Belief | None:
        """The backend's; sightings that were not handed on are refused."""
        found: Belief | None = self._inner.belief()
        return None if found is None else found._replace(refused=found.refused + self._refused)

    def map(self) -> Map:
        """The backend's, without landmarks that have moved."""
        return self._only_standing(self._inner.map())

    def finish(self) -> Solution | None:
        """The backend's, likewise."""
        found: Solution | None = self._inner.finish()
        return None if found is None else found._replace(map=self._only_standing(found.map))

    def tell(self, truth: Truth) -> bool:
        """Hands the ground truth on to a backend that asks for it."""
        return isinstance(self._inner, WantsTruth) and self._inner.tell(truth)

    def taken_out(self) -> TakenOut:
        """The landmarks that have moved, and the misread sightings of others."""
        misread = sum(times for landmark, times in self._off.items() if landmark not in self._moved)
        return TakenOut(np.array(list(self._moved), np.int64), misread)

    def _kept(self, step: Step, names: list[int]) -> list[bool]:
        """Decides which sightings of the step are handed on."""
        keep = [name not in self._moved for name in names]
        rows = [i for i, standing in enumerate(keep) if standing]
        if not rows:
            return keep
        pose = self._pose if step.odometry is None else compose(self._pose, step.odometry.delta)
        known = [i for i in rows if names[i] in self._slot]
        if self._slot and len(rows) <= CROWD:
            self._weigh(step, pose, names, rows, known, keep)
        for i in rows:
            if not keep[i]:
                self._off[names[i]] = self._off.get(names[i], 0) + 1
            elif names[i] not in self._slot:
                self._slot[names[i]] = self._recorded(_place(pose, step.sightings.z[i]))
        return keep

    def _weigh(
        self, step: Step, pose: Array, names: list[int], rows: list[int], known: list[int], keep: list[bool]
    ) -> None:
        """Judges the sightings `rows` of a step, of which some are `known`; clears `keep` of those not handed on."""
        z, cov = step.sightings.z[rows], step.sightings.cov[rows]
        z.flags.writeable = cov.flags.writeable = False  # as a log's: kernels are compiled for one kind
        found, at = self._asked(step, pose, names, known, z, cov)
        if len(rows) >= len(self._gates):
            self._gates = gates(JOINT, 2 * len(rows))
        records, scale = self._records, max(1.0, math.exp(self._log_median) / MEDIAN)
        slots = np.array([self._slot.get(names[i], -1) for i in rows], np.int64)
        said, apart, off, spread = judge(
            Sightings(z, cov, at[rows], records.agreed[slots]), found.z, found.cov, pose[2], scale,
            Gates(self._match, self._match, self._gates, NODES), self._careful,
        )  # fmt: skip
        for j, i in enumerate(rows):
            if slots[j] < 0 and said[j] != AGREES and self._held.get(names[i], 0) < HELD:
                self._held[names[i]] = self._held.get(names[i], 0) + 1
                keep[i] = False
        judged = np.flatnonzero(at[rows] >= 0)
        for j in judged.tolist():
            records.xy[slots[j]] = _place(pose, found.z[at[rows[j]]])
        wrong = judged[said[judged] != AGREES].tolist()
        self._doubted = self._doubted.union(names[rows[j]] for j in wrong) if len(wrong) == len(judged) else set()
        if len(self._doubted) >= LOST:
            self._doubted = set()
            return
        for j in wrong:
            keep[rows[j]] = False
        if 2 * len(wrong) > len(judged) or not len(judged):
            return  # too few agree to judge the others by
        over = np.log(np.maximum(apart[judged] * scale, 1e-300)) > self._log_median
        self._log_median += STEP * (2 * int(over.sum()) - len(judged))
        verdicts = follow(records, slots[judged], said[judged], step.t, off[judged], spread[judged], self._match, ALARM)
        for j, verdict in zip(judged.tolist(), verdicts.tolist(), strict=True):
            i = rows[j]
            if verdict == MOVED:
                self._moved[names[i]] = None
                keep[i] = False
            elif verdict == STOOD_ELSEWHERE:
                self._map_again(names[i], _place(pose, z[j]))
                keep[i] = True

    def _asked(
        self, step: Step, pose: Array, names: list[int], known: list[int], z: Array, cov: Array
    ) -> tuple[Expected, Ints]:
        """The backend's expectation of all landmarks sighted; the row there of each of the step's sightings, or -1.

        It offers what is near a sighting: asked for are the sightings, and those of the landmarks where they last were.
        """
        gap = self._records.xy[[self._slot[names[i]] for i in known]].reshape(-1, 2) - pose[:2]
        there = np.stack((np.hypot(*gap.T), wrap(np.arctan2(gap[:, 1], gap[:, 0]) - pose[2])), axis=1)
        there, cov = np.concatenate((z, there)), np.concatenate((cov, step.sightings.cov[known]))
        there.flags.writeable = cov.flags.writeable = False
        seen = RangeBearing(np.zeros(len(there), np.int64), there, cov)
        found = self.expected(step.odometry, seen, ASKED)
        if not np.isin([names[i] for i in known], found.ids).all():
            found = self.expected(step.odometry, seen, FURTHER)
        row = {landmark: k for k, landmark in enumerate(found.ids.tolist())}
        at = np.full(len(names), -1)
        at[known] = [row.get(names[i], -1) for i in known]
        return found, at

    def _recorded(self, xy: Array, agreed: int = 0) -> int:
        """Makes a record of a landmark at xy (2,); returns its slot."""
        slot, records = self._count, self._records
        if slot == len(records.xy):
            longer: Any = map(np.concatenate, zip(records, _records(slot), strict=True))
            self._records = records = Records(*longer)
        records.xy[slot], records.agreed[slot] = xy, agreed
        self._count += 1
        return slot

    def _map_again(self, landmark: int, xy: Array) -> None:
        """Has the backend map a landmark anew, at its next sighting, which is about xy (2,)."""
        self._wrong.add(self._inside.get(landmark, landmark))
        self._inside[landmark] = inside = FIRST - len(self._wrong)
        self._called[inside] = landmark
        self._slot[landmark] = self._recorded(xy, FEW)

    def _standing(self, ids: Ints) -> Ints:
        """Indices of the backend's landmarks that neither have moved nor have been mapped again."""
        if not self._moved and not self._wrong:
            return np.arange(len(ids))
        out = self._wrong.union(self._moved, (self._inside[i] for i in self._moved if i in self._inside))
        return np.array([k for k, landmark in enumerate(ids.tolist()) if landmark not in out], np.int64)

    def _translated(self, ids: Ints) -> Ints:
        """Ids as they are outside."""
        return np.array([self._called.get(i, i) for i in ids.tolist()], np.int64) if self._called else ids

    def _only_standing(self, found: Map) -> Map:
        keep = self._standing(found.ids)
        if len(keep) < len(found.ids):
            entries = np.stack((2 * keep, 2 * keep + 1), axis=1).ravel()
            cov = None if found.cov is None else found.cov[np.ix_(entries, entries)]
            found = Map(found.ids[keep], found.xy[keep], cov)
        return found._replace(ids=self._translated(found.ids))


def _records(n: int) -> Records:
    """Room for those of n landmarks, of which nothing is known."""
    f = len(FORGETS)
    return Records(
        xy=np.zeros((n, 2)),
        agreed=np.zeros(n, np.int64),
        pull=np.zeros((n, f, 2)),
        weight=np.zeros((n, f, 3)),
        run=np.zeros(n, np.int64),
        lately=np.zeros((n, 2, 2)),
        spreads=np.zeros((n, 2, 2, 2)),
        times=np.zeros((n, 2)),
    )


def _place(pose: Array, z: Array) -> Array:
    """The place (2,) of a landmark that is seen at z (2,) from the pose."""
    way = pose[2] + z[1]
    return np.array((pose[0] + z[0] * math.cos(way), pose[1] + z[0] * math.sin(way)))
