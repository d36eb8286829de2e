"""Tracking: the pose of each scan on the submap of the last metres, from several guesses where the wheels may be wrong.

Most scans are where the wheels say. Where the scan denies it, or the wheels do what no robot does (they repeat a
reading while it drives, or jump), a scan is matched from the motion before, from standing still, from where the wheels
have it since they last agreed, and from the best place nearby, too. Where these end at different places, each is
followed through the next scans until one explains them better: by their points, by a motion without jerks, and by the
wheels' sum, which readings that come late leave as it was.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, compose, wrap
from ...core.small_matrices import inverse
from ..maps._grid import known
from ._matching import Hold, match
from ._search import Search, correlated
from .guesses import Anchor, Guesses, beyond, distance, guesses, held, wheels_cov
from .scanner import Scan
from .settings import Settings
from .submap import Submap
from .wheels_check import WheelsCheck, contradicts

AT_FIRST, AGAIN = 6, 4
"""Cells around a point in which its wall is looked for at first: from a guess, and after a search."""

ITERATIONS = 20

TURNED = 0.03
"""rad that a match turns a scan from which on it is matched again from there: walls far away, beyond the cells that are
looked at from the guess and then from fewer and fewer, are found only now.
"""

REACH, FIELD_SD = 14.0, 0.08
"""m around the prediction in which a lost scan is searched for, and the width of the field."""

FEW = 80
"""Points of a scan that are searched with."""

SEARCH, SEARCH_TURN = 0.3, 0.35
"""m and rad that a search goes beyond the motion."""

STEP, TURN_STEP = 0.08, 0.03
"""m and rad between poses that are tried."""

TRUST, TRUST_TURN = 0.6, 0.6
"""sd, m and rad, of the search's prior, beside the motion."""

COST, BETTER = 0.02, 0.03
"""Share of points that a unit of squared distance costs; by how much a search has to be better."""

FARTHEST, JERK = 25.0, 4.0
"""Squared distances from the wheels' place, and from that by the motion before, at the most: stamps jitter."""

SUM, LATE = 6.0, 4.0
"""Squared distance from the wheels' sum since they last agreed from which on a place costs no more: readings may be
late; and that for each second since then: not for ever.
"""

DENIED = 0.5
"""Squared distance that a place costs which the wheels deny, while they agreed with the scan before, for each e-fold of
the volume in which it is expected by the motion before: where scans are far apart in time, that tells little.
"""

HELD = 25.0
"""Times the information of the wheels' motion with which a scan is held where they say that it is."""

SAME, SAME_TURN = 0.05, 0.02
"""m and rad; places that are closer are one."""

SURE, CLEAR, UNSURE = 0.25, 0.15, 0.05
"""Lead in the score at which a place is decided on, and at which one is that wheels and scan agree on; below which it
stays doubtful.
"""

LONGEST, MOST = 6, 4
"""Scans through which different places are followed at most, and how many places."""

DOUBTED, APART = 4.0, 9.0
"""Squared distances of a pose from the wheels' at which it is in doubt, and at which they count nothing."""

UNKNOWN = 0.7
"""Share that a point counts for on ground that the submap has not seen; on a wall it is 1, in free space 0."""

DROP, MEMORY = 0.04, 0.1
"""By how much less than usual of a scan is explained where its place is doubtful, and where a doubtful one is searched
for; weight of a scan in what is usual.
"""


class Placed(NamedTuple):
    """A scan with its pose."""

    t: float
    scan: Scan
    pose: Array  # (3,) on the matcher's path
    explained: float  # share of the points, those on ground that the submap has not seen in part
    score: float  # of this scan: explained, less what jerks and the wheels' place cost, while these agree
    off_wheels: float  # squared distance from where the wheels have it since they last agreed
    wheels: bool  # their motion counts
    points: bool = True  # the scan counts
    off: Array | None = None  # (3,) to another place that the scans do not tell from it
    anchor: Anchor | None = None  # None: wheels and scans agree
    lost: bool = False  # from where it was expected it did not match
    searched: bool = False  # a search found it
    hold: Hold | None = None  # to which it was held while it was matched; None: it was not matched


class Tracker:
    """Places scans in the order of time."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.lost = self.found_again = self.by_wheels = self.doubted = self.undecided = 0
        self._last = deque[Placed](maxlen=2)
        self.branches = list[list[Placed]]()  # from the last scan that is placed on
        self._usual = settings.lost  # of the points explained
        self._wheels_check = WheelsCheck()

    def start(self, t: float, scan: Scan) -> Placed:
        """Takes the first scan."""
        self._last.append(Placed(t, scan, np.zeros(3), 1.0, 0.0, 0.0, True))
        return self._last[-1]

    def take(self, t: float, motion: Array | None, scan: Scan, submap: Submap) -> list[Placed]:
        """Takes a scan; `motion` (3,) is the wheels' since the one before. Returns the scans that are placed now."""
        if self.branches:
            self.branches = [
                [*branch, one] for branch in self.branches for one in self._candidates(branch, t, motion, scan, submap)
            ]
            return self._decided(LONGEST)
        found = self._candidates([], t, motion, scan, submap)
        if len(found) > 1:
            self.doubted += 1
            self._wheels_check.forget()
        elif motion is not None:
            found = [self._checked(found[0], motion, submap)]
        self.branches = [[one] for one in found]
        return self._decided(LONGEST)

    def decide(self) -> list[Placed]:
        """The scans that were not placed yet, where most speaks for."""
        return self._decided(0) if self.branches else []

    def _decided(self, longest: int) -> list[Placed]:
        """The scans since the last one that is placed, once it is clear where they are; empty before that."""
        self.branches = _apart(sorted(self.branches, key=_total, reverse=True))
        best, *others = self.branches
        lead = _total(best) - _total(others[0]) if others else np.inf
        first = best[0]
        plain = first.anchor is None and first.explained >= self._usual - DROP
        clear = not others or (
            lead >= (CLEAR if plain else SURE) and (len(best) > 1 or first.explained >= self.settings.lost)
        )
        if not (clear or len(best) >= longest):
            del self.branches[MOST:]
            return []
        if lead < UNSURE:
            self.undecided += 1
            best[0] = best[0]._replace(off=between(best[-1].pose, others[0][-1].pose))
        elif best[-1].wheels and others:  # the scans have said that the wheels were right
            best[-1] = best[-1]._replace(anchor=None)
        self.branches = []
        self._last.extend(best)
        for one in best:
            self.lost += one.lost
            self.found_again += one.searched
            self._usual += MEMORY * (one.explained - self._usual)
        return best

    def _candidates(
        self, branch: list[Placed], t: float, motion: Array | None, scan: Scan, submap: Submap
    ) -> list[Placed]:
        """The places of a scan after those of a branch, best first; one where no other is in sight."""
        s, grid, past = self.settings, submap.grid, [*self._last, *branch]
        last, moved, earlier = past[-1], np.zeros(3), 0.0
        if len(past) > 1:
            moved, earlier = between(past[-2].pose, last.pose), last.t - past[-2].t
        guess = guesses(last.pose, moved, (earlier, t - last.t), motion, last.anchor, s)
        first, doubtful = guess.first, guess.odd or last.anchor is not None

        def placed(start: Array, hold: Hold, reach: int, matched: bool = True) -> Placed:
            pose, explained = start, 0.0
            if matched:
                pose, _, explained = match(grid, scan.few, start, hold, s.sd, reach, ITERATIONS)
                if abs(wrap(pose[2] - start[2])) > TURNED:
                    pose, _, explained = match(grid, scan.few, pose, hold, s.sd, reach, ITERATIONS)
                explained += UNKNOWN * (1 - max(known(grid, pose, scan.few), explained))
            score, by = explained - COST * min(guess.surprise(pose), JERK), hold if matched else None
            if motion is None:
                return Placed(t, scan, pose, explained, score, 0.0, True, hold=by)
            anchor, agrees = None, distance(pose, first) < APART
            if guess.odd or not agrees:
                then = last.anchor or Anchor(last.t, last.pose, np.zeros(3))
                score -= COST * DENIED * guess.vague * (last.anchor is None and not agrees)
                anchor = then._replace(moved=compose(then.moved, motion))
            late = 0.0 if last.anchor is None else LATE * max(t - last.anchor.t, 0.0)
            most = min(max(late, SUM), FARTHEST) if doubtful else FARTHEST
            off = min(distance(pose, guess.since or first), most)
            score -= COST * off * (anchor is None)
            return Placed(t, scan, pose, explained, score, off, agrees, anchor=anchor, hold=by)

        if not len(scan.few):
            return [placed(first.pose, first, AT_FIRST, False)._replace(lost=True)]
        found = [placed(first.pose, first, AT_FIRST)]
        least = max(s.lost, self._usual - DROP)
        if found[0].explained >= least and found[0].off_wheels < DOUBTED and not doubtful:
            return found
        found += [placed(one.pose, one, AT_FIRST) for one in guess.all[1:]]
        if max(one.explained for one in found) < max(s.lost, self._usual - DROP):
            best = placed(self._searched(guess, found, last.pose, scan, submap), first, AGAIN)
            if best.score > max(one.score for one in found) + BETTER:
                found.append(best._replace(searched=True))
        if found[0].explained < s.lost:
            found = [one._replace(lost=True) for one in found]
        if guess.odd and motion is not None and not motion.any():
            found.reverse()
        apart = list[Placed]()
        for one in found:  # the most trusted guess first, whose hold is the better one
            same = next((k for k, other in enumerate(apart) if _same(one, other)), None)
            if same is None:
                apart.append(one)
            elif _total([one]) > _total([apart[same]]) + BETTER:
                apart[same] = one
        return sorted(apart, key=lambda one: _total([one]), reverse=True)

    def _searched(self, guess: Guesses, found: list[Placed], last: Array, scan: Scan, submap: Submap) -> Array:
        """The pose (3,) nearby at which most points are on walls."""
        moved, sd = [between(last, one.pose) for one in guess.all], np.minimum(np.sqrt(guess.cov), self.settings.blind)
        way = max(float(np.hypot(one[0], one[1])) for one in moved) + 2 * sd[0]
        turned = max(abs(float(one[2])) for one in moved) + 2 * sd[2]
        centre = max(found, key=lambda one: one.score).pose if guess.wheels is None else guess.wheels.pose
        field, origin = submap.field_around(centre, REACH, FIELD_SD)
        few = scan.few[:: max(1, len(scan.few) // FEW)]
        search = Search(few, centre, SEARCH + way, SEARCH_TURN + turned, TURN_STEP)
        return correlated(field, origin, self.settings.cell, search, STEP, TRUST + way, TRUST_TURN + turned)

    def _checked(self, found: Placed, motion: Array, submap: Submap) -> Placed:
        """The scan, placed by the wheels from half a metre back where they contradict it and explain more points."""
        s, scan, pose = self.settings, found.scan, found.pose
        start, moved = self._wheels_check.motion(self._last[-1].pose, motion)
        cov = wheels_cov(moved, s)
        if not contradicts(between(start, pose), moved, inverse(cov)) or not len(scan.few):
            return found
        grid, by_wheels = submap.grid, held(start, moved, cov)
        hold, free = Hold(by_wheels.pose, HELD * by_wheels.information), Hold(pose, np.zeros((3, 3)))
        other, _, explained = match(grid, scan.few, hold.pose, hold, s.sd, AGAIN, ITERATIONS)
        if explained < match(grid, scan.few, pose, free, s.sd, AGAIN, ITERATIONS)[2] + BETTER:
            return found
        self._wheels_check.forget()
        self.by_wheels += 1
        return found._replace(pose=other, wheels=True, points=False, anchor=None)


def _total(branch: list[Placed]) -> float:
    """The score of scans that end where the last one is."""
    pending = branch[-1].off_wheels if branch[-1].anchor is not None else 0.0
    return sum(one.score for one in branch) - COST * pending


def _apart(branches: list[list[Placed]]) -> list[list[Placed]]:
    """Those of the branches, best first, that do not end where a better one does."""
    out = list[list[Placed]]()
    for one in branches:
        if not any(_same(one[-1], other[-1]) for other in out):
            out.append(one)
    return out


def _same(one: Placed, other: Placed) -> bool:
    return not beyond(between(one.pose, other.pose), SAME, SAME_TURN)
