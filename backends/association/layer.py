"""Data association in front of a backend: it makes up the ids of sightings, and the backend gets an ordinary step.

The backend states which landmarks it expects to see, and with what joint covariance; a rule decides which of them each
sighting without an id is of; one that is of none is of a new landmark. Rule, gates and code are the same for every
backend. Signatures, where sightings have them, are weighed with the places: the landmarks' are estimated here. Ranges
and bearings alone are named after the whole sightings of their step: see `parts`. Ids that are known are left as they
are. Made-up ids are -2, -3, ...: never the number of a real landmark.
"""

import time
from collections import deque
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, Step, Truth
from ...core.partial import NO_PARTIAL, RANGE, Partial
from ...core.se2 import Array, Ints, compose
from .._expected import carried
from .._joint_compatibility import Frame, Gates
from .._rules import NEW, Decision, decide, decide_frame, decision_by
from ..api import (
    Backend,
    Belief,
    Calibrates,
    Calibration,
    Constant,
    Expected,
    Foresees,
    Pose,
    Solution,
    TakenOut,
    TakesOut,
    WantsTruth,
)
from ..expected import filled, fills, room_for
from ..locating.locate import locate
from ..locating.virtual import virtual
from . import parts
from ._line import agreeing, polar
from .merging import Merging
from .options import RULES
from .quantiles import gates, quantile
from .signatures import SignatureFilters, joined

FIRST = -2  # the first made-up id, unless the given map has lower ones; the next ones are below it
LARGEST = 64  # pairs that a joint gate is tabulated for at first
ROOM = 16  # expected landmarks that there is room for at first
LONGEST = 100  # steps in line at most

FEW_NEW, SURE, MARGIN, REACH = 3, 5, 6.0, 2.0
"""A rescue is tried where that many sightings and half of them would be new; the landmarks that have to agree, and how
much likelier the pose has to be than any other; landmarks are taken from that many ranges of the furthest sighting."""


class Associating:
    """A backend behind data association.

    A step waits in line where later ones are to be known before it is named: for `lookahead` more sightings, all
    weighed as one frame at its pose, and for those that have to `confirm` a new landmark. The pose until then is that
    of the last step named, and odometry from there.
    """

    def __init__(self, inner: Backend, prior: Prior, options: Any) -> None:
        self._inner: Any = inner
        self._options, self._rule = options, RULES.index(options.association)
        self._signatures = SignatureFilters() if prior.signatures else None
        self._each = 3 if prior.signatures else 2  # degrees of freedom of a pair
        self._match, self._far = (quantile(share, 1, self._each) for share in (options.match, options.new))
        self._apart = quantile(options.match, 1)  # of places alone
        self._apart_part = quantile(options.match, 1, 1)  # of a range or a bearing alone
        self._gates = gates(options.joint, LARGEST, self._each)
        self._waits = options.lookahead > 0 or options.confirm > 0
        self._plain = not self._waits and not options.retire and not prior.signatures and not options.merge
        self._into, self._arrays = fills(inner), room_for(ROOM)
        self._foresees = prior.gyro is not None and isinstance(inner, Foresees)
        self._decision = self._decided_by(self._gates)
        self._line = deque[Step]()
        self._pose: Array | None = prior.pose.copy()
        given = () if prior.map is None else prior.map.ids.tolist()
        self._merging = Merging(given) if options.merge else None
        self._next = min((FIRST, *(landmark - 1 for landmark in given)))  # of a map made without ids, too
        self._known = set[int](given)  # ids sighted as such, or given
        self._made: dict[int, int] = {}  # known id -> made-up one of the same landmark
        self._called: dict[int, int] = {}  # and the inverse
        self._sure: list[int] = []  # the landmark of every sighting of a step that has been named
        self._sure_parts: list[int] = []  # likewise of every partial sighting
        self._seen = self._seen_parts = 0  # sightings so far
        self._systematic = prior.systematic
        self._furthest = 0.0  # m; the furthest range so far
        self._now = np.zeros(0, np.int64)  # landmarks of the last step's sightings
        self._once: dict[int, int] = {}  # landmark sighted once -> the number of the step with sightings
        self._retired: set[int] = set()
        self._looks = 0  # steps with sightings
        self.timed = False  # `ns` is kept; the clock costs a tenth of association
        self.ns: list[int] = []  # CPU time of association, each step
        self.tried: list[int] = []  # pairs or nodes of the search, each step

    def step(self, step: Step) -> Pose | None:
        """Takes the steps for which enough is known: decides which landmark each sighting is of, and hands them on."""
        self._seen += len(step.sightings.ids)
        self._seen_parts += len(step.partial.ids)
        self.ns.append(0)
        self.tried.append(0)
        if not self._waits:
            self._take(step)
            return self._pose
        self._line.append(step)
        while self._line and self._ready():
            self._take(self._line[0])
            self._line.popleft()
        if not self._line or self._pose is None:
            return None if self._pose is None else self._pose.copy()
        self._now = np.full(len(step.sightings.ids), UNKNOWN)
        return self._ahead(np.zeros((3, 3)))[0]

    @property
    def inner(self) -> Backend:
        """The backend behind."""
        return self._inner

    def signatures(self, landmarks: Ints) -> Array | None:
        """(n, 2) mean and variance of the landmarks' signatures; None if sightings have none."""
        if self._signatures is None:
            return None
        names: list[int] = landmarks.tolist()
        return self._signatures.of([self._made.get(name, name) for name in names])

    def belief(self) -> Belief | None:
        """The backend's, and the landmark that each sighting of the last step was taken for."""
        found = self._inner.belief()
        if found is None or not self._line:
            return None if found is None else found._replace(assigned=self._translated(self._now.tolist()))
        pose, cov = self._ahead(np.zeros((3, 3)) if found.cov is None else found.cov)
        return Belief(pose, None if found.cov is None else cov, assigned=self._translated(self._now.tolist()))

    def map(self) -> Map:
        """The backend's, without landmarks that were taken out."""
        return self._as_called(self._inner.map())

    def finish(self) -> Solution | None:
        """Takes the steps still in line; the backend's solution, without landmarks that were taken out."""
        while self._line:
            self._take(self._line[0])
            self._line.popleft()
        found = self._inner.finish()
        if found is None:
            return None
        return found._replace(map=self._as_called(found.map), constant=self._kept_of(found.constant, found.map.ids))

    def assigned(self) -> Ints:
        """(s,) the landmark of every sighting so far; UNKNOWN for one that is not used, or waits."""
        return self._translated(self._sure + [UNKNOWN] * (self._seen - len(self._sure)))

    def assigned_partial(self) -> Ints:
        """(p,) the landmark of every partial sighting so far; UNKNOWN for one that is left out, or waits."""
        return self._translated(self._sure_parts + [UNKNOWN] * (self._seen_parts - len(self._sure_parts)))

    def taken_out(self) -> TakenOut | None:
        """The measurements that the backend has taken out, if it does, by these ids."""
        found = self._inner.taken_out() if isinstance(self._inner, TakesOut) else None
        return None if found is None else found._replace(moved=self._translated(found.moved.tolist()))

    def calibration(self) -> Calibration:
        """That of the backend, each landmark's errors without those of landmarks that were taken out."""
        ids = self._inner.map().ids
        found = self._inner.calibration() if isinstance(self._inner, Calibrates) else Calibration()
        return found._replace(constant=self._kept_of(found.constant, ids))

    def tell(self, truth: Truth) -> bool:
        """Hands the ground truth on to a backend that asks for it."""
        return isinstance(self._inner, WantsTruth) and self._inner.tell(truth)

    def _ready(self) -> bool:
        """Tells if the first step in line need not wait."""
        options, line = self._options, self._line
        if UNKNOWN not in line[0].sightings.ids or len(line) > LONGEST:
            return True
        later = [len(step.sightings.ids) for step in islice(line, 1, None)]
        looks = len(later) - later.count(0)
        return sum(later) >= options.lookahead and (looks >= options.within or not options.confirm)

    def _take(self, step: Step) -> None:
        """Names the sightings of a step, the first in line, and hands it on."""
        ids, z, cov = step.sightings
        named: list[int] = ids.tolist()
        if self._made:  # a known id may be of a landmark that was there without one
            named = [self._made.get(name, name) for name in named]
        start = time.process_time_ns() if self.timed else 0
        if self._foresees:
            self._inner.foresee(step.gyro)
        found = self._named_at_once(step) if self._plain and 0 < len(named) == named.count(UNKNOWN) else None
        decided = found is not None
        if found is not None:
            named = found.tolist()
        else:
            open_ = self._open(named)
            if open_:
                self.tried[-1] += self._name(step, named, open_)
                decided = True
            found = np.array(named, np.int64)
        if decided or self._made:
            sightings = RangeBearing(found, z, cov)
            if UNKNOWN in named:
                used = found != UNKNOWN
                sightings = RangeBearing(found[used], z[used], cov[used])
                step = step._replace(signatures=step.signatures.rows(used) if self._signatures else step.signatures)
            step = step._replace(sightings=sightings)
        if self._signatures is not None:
            self._signatures.learn(step.sightings.ids.tolist(), step.signatures)
        self._now = found
        if step.partial is not NO_PARTIAL:
            partial = self._with_parts(step)
            decided, step = decided or partial is not step.partial, step._replace(partial=partial)
        if self.timed and decided:
            self.ns[-1] += time.process_time_ns() - start
        self._sure += named
        self._pose = self._inner.step(step)
        if self._merging is not None and named:
            self._pose = self._merged(self._merging, [name for name in named if name != UNKNOWN])

    def _merged(self, merging: Merging, sighted: list[int]) -> Pose | None:
        """Merges landmarks that turn out to be one, once a step has `sighted` these; the pose by then."""
        merging.sighted(sighted)
        pairs = merging.found(self._inner, self._called)
        if not pairs:
            return self._pose
        merging.merge(pairs)
        self._retired.update(gone for gone, _ in pairs)
        return self._inner.unite(pairs)

    def _named_at_once(self, step: Step) -> Ints | None:
        """The ids of a step whose sightings have none, as `_name` finds them, by as few calls as there can be.

        None where a rescue is to be tried.
        """
        seen, inner = step.sightings, self._inner
        count = len(seen.ids)
        self._gates_for(count)
        decision = self._decision
        decision.first[0] = self._next
        if self._into:
            self._arrays = inner.expected_into(step.odometry, seen, self._far, self._arrays)
        else:
            self._arrays = filled(self._arrays, inner.expected(step.odometry, seen, self._far), seen)
        new, tried = decision.said.tolist()
        if new and self._options.rescue and new >= max(FEW_NEW, count / 2):
            return None
        self._next -= new
        self.tried[-1] += tried
        return decision.named[:count].copy()

    def _with_parts(self, step: Step) -> Partial:
        """The partial sightings of a step whose whole ones are named, with ids; without those that are left out."""
        found, whole = step.partial, step.sightings
        self._furthest = max(
            self._furthest, whole.z[:, 0].max(initial=0.0), found.z[found.kind == RANGE].max(initial=0.0)
        )
        ids = found.ids
        if self._made:
            ids = np.array([self._made.get(name, name) for name in ids.tolist()], np.int64)
        unknown = ids == UNKNOWN
        if unknown.any():
            ids = self._parts_named(step, found._replace(ids=ids))
        self._sure_parts += ids.tolist()
        if ids is found.ids:
            return found
        return _rows(found._replace(ids=ids), ids != UNKNOWN)

    def _parts_named(self, step: Step, found: Partial) -> Ints:
        """The ids of a step's partial sightings, of which some are UNKNOWN: see `parts`."""
        scale, offset = self._systematic.range_scale, self._systematic.range_offset
        if scale or offset:  # how large they are only the backend knows
            more = np.where(found.kind == RANGE, (scale * found.z) ** 2 + offset**2, 0.0)
            found = found._replace(var=found.var + more)
        reach = parts.REACH * self._furthest or parts.BOUNDLESS
        asked = parts.as_whole(_rows(found, found.ids == UNKNOWN), reach)
        ids, z, cov = step.sightings
        both = RangeBearing(
            np.concatenate((ids, asked.ids)), np.concatenate((z, asked.z)), np.concatenate((cov, asked.cov))
        )
        for column in both:
            column.flags.writeable = False  # as a log's: kernels are compiled for one kind
        expected = self._expected(step.odometry, both, [UNKNOWN])
        ids, tried = parts.named(found, expected, step.sightings, self._apart_part, reach)
        self.tried[-1] += tried
        return ids

    def _open(self, named: list[int]) -> list[int]:
        """The sightings to be decided on: those without an id, and those with one that comes up after made-up ones."""
        if named.count(UNKNOWN) == len(named):
            return list(range(len(named)))
        if self._next == FIRST:
            self._known.update(named)
            return [i for i, name in enumerate(named) if name == UNKNOWN]
        return [i for i, name in enumerate(named) if name == UNKNOWN or (name > UNKNOWN and name not in self._known)]

    def _name(self, step: Step, named: list[int], open_: list[int]) -> int:
        """Replaces ids in `named`, where they are decided on; returns the pairs or nodes tried."""
        given = [named[i] for i in open_]
        for i in open_:
            named[i] = UNKNOWN
        if self._options.lookahead:
            known, pair, nodes = self._weighed_ahead(step, named, open_)
        else:
            known, pair, nodes = self._weighed(step, named, open_)
        pair = pair[: len(open_)].tolist()
        if self._options.rescue and pair.count(NEW) >= max(FEW_NEW, len(pair) / 2):
            pair, known = self._rescued(step, open_, pair, known)
        new = list[int]()
        for i, landmark, own in zip(open_, pair, given, strict=True):
            if own != UNKNOWN:
                named[i] = self._joined(own, known[landmark] if landmark >= 0 else UNKNOWN)
            elif landmark >= 0:
                named[i] = known[landmark]
            elif landmark == NEW:
                new.append(i)
        if new and self._options.confirm:
            new = self._confirmed(new)
        for i in new:
            named[i] = self._next
            self._next -= 1
        if self._options.retire:
            self._forget(named, {named[i] for i in new})
        return nodes

    def _joined(self, own: int, landmark: int) -> int:
        """The id for a landmark of known id `own`, now sighted as such, that may be there without one."""
        self._known.add(own)
        if landmark >= UNKNOWN or landmark in self._called:
            return own
        self._made[own], self._called[landmark] = landmark, own
        return landmark

    def _weighed(self, step: Step, named: list[int], open_: list[int]) -> tuple[list[int], Ints, int]:
        """Decides on the sightings without an id: the landmarks expected, and which of them each is of."""
        seen = step.sightings
        expected = self._expected(step.odometry, seen, named)
        z, cov = seen.z, seen.cov
        if len(open_) < len(named):
            z, cov = z[open_], cov[open_]
            z.flags.writeable = cov.flags.writeable = False
        decided = (
            self._rule, z, cov, expected.z, expected.cov, self._match, self._gates_for(len(z)), self._far,
            self._options.nodes,
        )  # fmt: skip
        if self._signatures is None:
            pair, nodes = decide_frame(*decided)
        else:
            signed = self._signatures.pairs(step.signatures.rows(open_), expected.ids)
            pair, nodes = decide_frame(*decided, signed)
        return expected.ids.tolist(), pair, nodes

    def _weighed_ahead(self, step: Step, named: list[int], open_: list[int]) -> tuple[list[int], Ints, int]:
        """Likewise by the next steps' sightings too, as one frame at this step's pose."""
        steps, count = [step], 0
        for later in islice(self._line, 1, None):
            if count >= self._options.lookahead:
                break
            steps.append(later)
            count += len(later.sightings.ids)
        frame = virtual(steps)
        first = len(named)
        rows = np.concatenate((open_, first + np.flatnonzero(frame.ids[first:] == UNKNOWN))).astype(np.int64)
        entries = np.stack((2 * rows, 2 * rows + 1), axis=1).ravel()
        z, noise, blocks = polar(frame.xy[rows], np.ascontiguousarray(frame.cov[np.ix_(entries, entries)]))
        z.flags.writeable = blocks.flags.writeable = False  # as a log's: kernels are compiled for one kind
        expected = self._expected(step.odometry, RangeBearing(frame.ids[rows], z, blocks), named)
        within = Gates(self._match, self._match, self._gates_for(len(z)), self._options.nodes)
        decided = self._rule, Frame(z, noise, expected.z, expected.cov), frame.step[rows], within, self._far
        if self._signatures is None:
            pair, nodes = decide(*decided)
        else:
            pair, nodes = decide(*decided, self._signatures.pairs(joined(steps).rows(rows), expected.ids))
        return expected.ids.tolist(), pair, nodes

    def _expected(self, odometry: Odometry | None, seen: RangeBearing, named: list[int]) -> Expected:
        """The backend's expectation, without landmarks that were taken out or that a sighting with an id is of."""
        expected = self._inner.expected(odometry, seen, self._far)
        clear = None if self._merging is None else self._merging.clear(expected, seen)
        if not self._retired and named.count(UNKNOWN) == len(named) and clear is None:
            return expected
        out = self._retired.union(named) if self._retired else named
        ids = expected.ids.tolist()
        keep = [k for k in (range(len(ids)) if clear is None else clear) if ids[k] not in out]
        if len(keep) == len(expected.ids):
            return expected
        entries = np.repeat(2 * np.array(keep, np.int64), 2)
        entries[1::2] += 1
        return Expected(
            expected.ids[keep], expected.z[keep], np.ascontiguousarray(expected.cov[np.ix_(entries, entries)])
        )

    def _rescued(self, step: Step, open_: list[int], pair: list[int], known: list[int]) -> tuple[list[int], list[int]]:
        """Looks for a frame that would be mostly new on the map so far, before it doubles landmarks.

        One frame whose sightings are all off together doubles what it sees, and all is lost. Only the decision is made
        by the pose found; the backend gets the sightings as they are.
        """
        if len(open_) < SURE or self._pose is None:
            return pair, known
        around = self._inner.map()
        here = self._pose if step.odometry is None else compose(self._pose, step.odometry.delta)
        near = np.flatnonzero(np.hypot(*(around.xy - here[:2]).T) < REACH * step.sightings.z[:, 0].max())
        if len(near) < SURE:
            return pair, known
        entries = np.stack((2 * near, 2 * near + 1), axis=1).ravel()
        joint = None if around.cov is None else around.cov[np.ix_(entries, entries)]
        ids, z, cov = step.sightings
        fix = locate(
            [step._replace(odometry=None, sightings=RangeBearing(ids[open_], z[open_], cov[open_]))],
            Map(around.ids[near], around.xy[near], joint),
            least=SURE,
            margin=MARGIN,
        )
        if fix is None:
            return pair, known
        found = fix.ids.tolist()
        return [k if landmark != UNKNOWN else NEW for k, landmark in enumerate(found)], found

    def _confirmed(self, new: list[int]) -> list[int]:
        """Those of the `new` sightings of the first step in line that enough of the following steps agree with."""
        steps, looks = [self._line[0]], 0
        for later in islice(self._line, 1, None):
            if looks == self._options.within:
                break
            steps.append(later)
            looks += len(later.sightings.ids) > 0
        frame = virtual(steps)
        rows, nearest = np.array(new, np.int64), self._merging is not None
        agreed = agreeing(frame.xy, frame.cov, frame.step, rows, self._apart, nearest).tolist()
        return [i for i, times in zip(new, agreed, strict=True) if times >= self._options.confirm]

    def _forget(self, named: list[int], new: set[int]) -> None:
        """Takes out landmarks that were sighted once, long ago: a first sighting says nothing of the pose."""
        self._looks += 1
        for landmark in named:
            if landmark in new:
                self._once[landmark] = self._looks
            else:
                self._once.pop(landmark, None)
        for landmark in list(self._once):  # in the order of their sightings
            if self._looks - self._once[landmark] <= self._options.retire:
                break
            del self._once[landmark]
            self._retired.add(landmark)

    def _ahead(self, cov: Array) -> tuple[Pose, Array]:
        """The last named step's pose, of this covariance, after the odometry of the steps in line."""
        assert self._pose is not None
        pose, cov, motion = self._pose.copy(), cov.copy(), np.empty((4, 3))
        for step in self._line:
            if step.odometry is not None:
                motion[0], motion[1:] = step.odometry
                carried(pose, cov, motion)
        return pose, cov

    def _gates_for(self, pairs: int) -> Array:
        """Joint gates of up to that many pairs."""
        if pairs >= len(self._gates):
            self._gates = gates(self._options.joint, 2 * pairs, self._each)
            self._decision = self._decided_by(self._gates)
        return self._gates

    def _decided_by(self, joint: Array) -> Decision:
        """The decision by these joint gates, for compiled code: that of the answers from now on."""
        decision = decision_by(self._rule, self._match, joint, self._far, self._options.nodes)
        self._arrays.decision[0] = decision.address
        return decision

    def _translated(self, ids: list[int]) -> Ints:
        """Ids as they are known now: of a made-up one whose landmark has got a known one, that."""
        if self._merging is not None and self._merging.same:
            ids = [self._merging.now(i) for i in ids]
        return np.array([self._called.get(i, i) for i in ids] if self._called else ids, np.int64)

    def _as_called(self, found: Map) -> Map:
        """The map by these ids, without landmarks that were taken out."""
        if self._retired:
            keep = np.flatnonzero(~np.isin(found.ids, list(self._retired)))
            entries = np.stack((2 * keep, 2 * keep + 1), axis=1).ravel()
            cov = None if found.cov is None else found.cov[np.ix_(entries, entries)]
            found = Map(found.ids[keep], found.xy[keep], cov)
        return found._replace(ids=self._translated(found.ids.tolist())) if self._called else found

    def _kept_of(self, found: Constant | None, ids: Ints) -> Constant | None:
        """Constant errors of the backend's landmarks, without those that were taken out."""
        if found is None or not self._retired or len(found.range_scale) != len(ids) or len(ids) == 1:
            return found
        keep = ~np.isin(ids, list(self._retired))

        def less(one: Constant) -> Constant:
            return one._replace(range_scale=one.range_scale[keep], range_offset=one.range_offset[keep])

        return less(found)._replace(sd=None if found.sd is None else less(found.sd))


def _rows(of: Partial, kept: NDArray[np.bool]) -> Partial:
    return Partial(of.ids[kept], of.kind[kept], of.z[kept], of.var[kept])
