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

from ...core.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, Step, Truth
from ...core.partial import NO_PARTIAL, RANGE, Partial
from ...core.se2 import Array, Ints
from .._expected import carried
from .._joint_compatibility import Frame, Gates
from .._rules import NEW, Decision, decide, decide_frame, decision_by
from ..api import (
    Backend,
    Belief,
    Calibrates,
    Calibration,
    Expected,
    Foresees,
    Pose,
    Solution,
    TakenOut,
    TakesOut,
    WantsTruth,
)
from ..expected import filled, fills, room_for
from ..locating.virtual import virtual
from . import parts
from ._line import agreeing, polar
from .merging import Merging
from .names import Names
from .options import RULES
from .quantiles import gates, quantile
from .rescue import rescued
from .signatures import SignatureFilters, joined

LARGEST = 64  # pairs that a joint gate is tabulated for at first
FEW_NEW = 3  # a rescue is tried where that many sightings of a step and half of them would be new
ROOM = 16  # expected landmarks that there is room for at first
LONGEST = 100  # steps in line at most


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
        self._names = Names(given, self._merging, options.retire)
        self._sure: list[int] = []  # the landmark of every sighting of a step that has been named
        self._sure_parts: list[int] = []  # likewise of every partial sighting
        self._seen = self._seen_parts = 0  # sightings so far
        self._systematic = prior.systematic
        self._furthest = 0.0  # m; the furthest range so far
        self._now = np.zeros(0, np.int64)  # landmarks of the last step's sightings
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
        return self._signatures.of(self._names.own(landmarks.tolist()))

    def belief(self) -> Belief | None:
        """The backend's, and the landmark that each sighting of the last step was taken for."""
        found = self._inner.belief()
        if found is None or not self._line:
            return None if found is None else found._replace(assigned=self._names.translated(self._now.tolist()))
        pose, cov = self._ahead(np.zeros((3, 3)) if found.cov is None else found.cov)
        return Belief(pose, None if found.cov is None else cov, assigned=self._names.translated(self._now.tolist()))

    def map(self) -> Map:
        """The backend's, without landmarks that were taken out."""
        return self._names.as_called(self._inner.map())

    def finish(self) -> Solution | None:
        """Takes the steps still in line; the backend's solution, without landmarks that were taken out."""
        while self._line:
            self._take(self._line[0])
            self._line.popleft()
        found = self._inner.finish()
        if found is None:
            return None
        return found._replace(
            map=self._names.as_called(found.map), constant=self._names.kept_of(found.constant, found.map.ids)
        )

    def assigned(self) -> Ints:
        """(s,) the landmark of every sighting so far; UNKNOWN for one that is not used, or waits."""
        return self._names.translated(self._sure + [UNKNOWN] * (self._seen - len(self._sure)))

    def assigned_partial(self) -> Ints:
        """(p,) the landmark of every partial sighting so far; UNKNOWN for one that is left out, or waits."""
        return self._names.translated(self._sure_parts + [UNKNOWN] * (self._seen_parts - len(self._sure_parts)))

    def taken_out(self) -> TakenOut | None:
        """The measurements that the backend has taken out, if it does, by these ids."""
        found = self._inner.taken_out() if isinstance(self._inner, TakesOut) else None
        return None if found is None else found._replace(moved=self._names.translated(found.moved.tolist()))

    def calibration(self) -> Calibration:
        """That of the backend, each landmark's errors without those of landmarks that were taken out."""
        ids = self._inner.map().ids
        found = self._inner.calibration() if isinstance(self._inner, Calibrates) else Calibration()
        return found._replace(constant=self._names.kept_of(found.constant, ids))

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
        if self._names.made:  # a known id may be of a landmark that was there without one
            named = self._names.own(named)
        start = time.process_time_ns() if self.timed else 0
        if self._foresees:
            self._inner.foresee(step.gyro)
        found = self._named_at_once(step) if self._plain and 0 < len(named) == named.count(UNKNOWN) else None
        decided = found is not None
        if found is not None:
            named = found.tolist()
        else:
            open_ = self._names.open(named)
            if open_:
                self.tried[-1] += self._name(step, named, open_)
                decided = True
            found = np.array(named, np.int64)
        if decided or self._names.made:
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
        pairs = merging.found(self._inner, self._names.called)
        if not pairs:
            return self._pose
        merging.merge(pairs)
        self._names.retired.update(gone for gone, _ in pairs)
        return self._inner.unite(pairs)

    def _named_at_once(self, step: Step) -> Ints | None:
        """The ids of a step whose sightings have none, as `_name` finds them, by as few calls as there can be.

        None where a rescue is to be tried.
        """
        seen, inner = step.sightings, self._inner
        count = len(seen.ids)
        self._gates_for(count)
        decision = self._decision
        decision.first[0] = self._names.next
        if self._into:
            self._arrays = inner.expected_into(step.odometry, seen, self._far, self._arrays)
        else:
            self._arrays = filled(self._arrays, inner.expected(step.odometry, seen, self._far), seen)
        new, tried = decision.said.tolist()
        if new and self._options.rescue and new >= max(FEW_NEW, count / 2):
            return None
        self._names.next -= new
        self.tried[-1] += tried
        return decision.named[:count].copy()

    def _with_parts(self, step: Step) -> Partial:
        """The partial sightings of a step whose whole ones are named, with ids; without those that are left out."""
        found, whole = step.partial, step.sightings
        self._furthest = max(
            self._furthest, whole.z[:, 0].max(initial=0.0), found.z[found.kind == RANGE].max(initial=0.0)
        )
        ids = found.ids
        if self._names.made:
            ids = np.array(self._names.own(ids.tolist()), np.int64)
        if UNKNOWN in ids:
            ids = self._parts_named(step, found._replace(ids=ids))
        self._sure_parts += ids.tolist()
        if ids is found.ids:
            return found
        return parts.rows(found._replace(ids=ids), ids != UNKNOWN)

    def _parts_named(self, step: Step, found: Partial) -> Ints:
        """The ids of a step's partial sightings, of which some are UNKNOWN: see `parts`."""
        scale, offset = self._systematic.range_scale, self._systematic.range_offset
        if scale or offset:  # how large they are only the backend knows
            more = np.where(found.kind == RANGE, (scale * found.z) ** 2 + offset**2, 0.0)
            found = found._replace(var=found.var + more)
        reach = parts.REACH * self._furthest or parts.BOUNDLESS
        asked = parts.as_whole(parts.rows(found, found.ids == UNKNOWN), reach)
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
            pair, known = rescued(self._inner, self._pose, step, open_) or (pair, known)
        new = list[int]()
        for i, landmark, own in zip(open_, pair, given, strict=True):
            if own != UNKNOWN:
                named[i] = self._names.joined(own, known[landmark] if landmark >= 0 else UNKNOWN)
            elif landmark >= 0:
                named[i] = known[landmark]
            elif landmark == NEW:
                new.append(i)
        if new and self._options.confirm:
            new = self._confirmed(new)
        for i in new:
            named[i] = self._names.new()
        if self._options.retire:
            self._names.forget(named, {named[i] for i in new})
        return nodes

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
        if not self._names.retired and named.count(UNKNOWN) == len(named) and clear is None:
            return expected
        out = self._names.retired.union(named) if self._names.retired else named
        ids = expected.ids.tolist()
        keep = [k for k in (range(len(ids)) if clear is None else clear) if ids[k] not in out]
        if len(keep) == len(expected.ids):
            return expected
        entries = np.repeat(2 * np.array(keep, np.int64), 2)
        entries[1::2] += 1
        return Expected(
            expected.ids[keep], expected.z[keep], np.ascontiguousarray(expected.cov[np.ix_(entries, entries)])
        )

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
