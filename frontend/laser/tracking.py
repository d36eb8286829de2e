"""Tracking: the pose of each scan on the submap of the last metres, from several guesses where the wheels may be wrong.

Most scans are where the wheels say. Where the scan denies it, or the wheels do what no robot does (they repeat a
reading while it drives, or jump), a scan is matched from the motion before, from standing still and from the best
place nearby, too. Where these end at different places, each is followed through the next scans until one explains them
better.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, compose, rotation, wrap
from ...core.small_matrices import inverse
from ._matching import Hold, match
from ._search import Search, correlated
from .scanner import Scan
from .settings import Settings
from .submap import Submap
from .wheels_check import WheelsCheck, contradicts

AT_FIRST, AGAIN = 6, 4
"""Cells around a point in which its wall is looked for at first: from a guess, and after a search."""

ITERATIONS = 20

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
"""Share of points that a unit of squared distance from a guess costs; by how much a search has to be better."""

HELD = 25.0
"""Times the information of the wheels' motion with which a scan is held where they say that it is."""

OFTEN = 0.1
"""s; scans in a burst are taken to be that far apart where a speed is computed."""

ODD, ODD_TURN = 0.3, 0.4
"""m and rad between the wheels' motion and the motion before that no robot does from one scan to the next."""

MOVED, MOVED_TURN = 0.03, 0.03
"""m and rad of the motion before; a robot that moved less may well stand still."""

OTHER = 4.0
"""Squared distance that a guess costs which is not the wheels'."""

FARTHEST = 25.0
"""Squared distance from every guess beyond which a place costs no more."""

SAME, SAME_TURN = 0.05, 0.02
"""m and rad; places that are closer are one."""

SURE, UNSURE = 0.25, 0.05
"""Lead in the sum of shares of points explained at which a place is decided on; below which it stays doubtful."""

LONGEST, MOST = 6, 4
"""Scans through which different places are followed at most, and how many places."""

APART = 9.0
"""Squared distance of a pose from the wheels' from which on they count nothing in its covariance."""


class Placed(NamedTuple):
    """A scan with its pose."""

    t: float
    scan: Scan
    pose: Array  # (3,) on the matcher's path
    information: Array  # (3, 3) of the points
    explained: float  # share of the points
    score: float  # explained, less what the distance from the nearest guess costs
    wheels: bool  # their motion counts
    points: bool = True  # the scan counts
    off: Array | None = None  # (3,) to another place that the scans do not tell from it
    moved_last: Array | None = None  # (3,) where it was when the wheels last moved; None: they do


class Guess(NamedTuple):
    """Where a scan may be."""

    hold: Hold
    cost: float  # squared distance, of being this one


class Tracker:
    """Places scans in the order of time."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.lost = self.found_again = self.by_wheels = self.doubted = self.undecided = 0
        self._last = deque[Placed](maxlen=2)
        self._branches = list[list[Placed]]()  # from the last scan that is placed on
        self._wheels_check = WheelsCheck()

    def start(self, t: float, scan: Scan) -> Placed:
        """Takes the first scan."""
        self._last.append(Placed(t, scan, np.zeros(3), np.zeros((3, 3)), 1.0, 0.0, True))
        return self._last[-1]

    def take(self, t: float, motion: Array | None, scan: Scan, submap: Submap) -> list[Placed]:
        """Takes a scan; `motion` (3,) is the wheels' since the one before. Returns the scans that are placed now."""
        if self._branches:
            grown = [self._candidates(branch, t, motion, scan, submap)[0] for branch in self._branches]
            self._branches = [[*branch, one] for branch, one in zip(self._branches, grown, strict=True)]
            return self._decided(LONGEST)
        found = self._candidates([], t, motion, scan, submap)
        if len(found) == 1 and motion is not None:
            found = [self._checked(found[0], motion, submap)]
        self._branches = [[one] for one in found]
        if len(found) > 1:
            self.doubted += 1
        return self._decided(LONGEST)

    def decide(self) -> list[Placed]:
        """The scans that were not placed yet, where most speaks for."""
        return self._decided(0) if self._branches else []

    def _decided(self, longest: int) -> list[Placed]:
        """The scans since the last one that is placed, once it is clear where they are; empty before that."""
        self._branches.sort(key=_total, reverse=True)
        best = self._branches[0]
        others = [one for one in self._branches[1:] if not _same(one[-1].pose, best[-1].pose)]
        lead = np.inf if not others else _total(best) - _total(others[0])
        clear = lead >= SURE and (len(best) > 1 or best[0].explained >= self.settings.lost)
        if not (clear or len(best) >= longest):
            self._branches = [best, *others[: MOST - 1]]
            return []
        if lead < UNSURE:
            self.undecided += 1
            best[0] = best[0]._replace(off=between(best[-1].pose, others[0][-1].pose))
        self._branches = []
        self._last.extend(best)
        return best

    def _candidates(
        self, branch: list[Placed], t: float, motion: Array | None, scan: Scan, submap: Submap
    ) -> list[Placed]:
        """The places of a scan after those of a branch, best first; one where no other is in sight."""
        s, grid = self.settings, submap.grid
        past = [*self._last, *branch]
        last = past[-1]
        moved_last = None
        if motion is not None and not motion.any():
            moved_last = last.pose if last.moved_last is None else last.moved_last
        guesses = self._guesses(past, t, motion)
        first = guesses[0]
        if not len(scan.few):
            self.lost += not branch
            nothing = np.zeros((3, 3))
            return [Placed(t, scan, first.hold.pose, nothing, 0.0, 0.0, True, moved_last=moved_last)]

        def placed(start: Array, hold: Hold, reach: int) -> Placed:
            pose, information, explained = match(grid, scan.few, start, hold, s.sd, reach, ITERATIONS)
            off = min([_distance(pose, one.hold) + one.cost for one in guesses])
            wheels = motion is None or _distance(pose, first.hold) < APART
            score = explained - COST * min(off, FARTHEST)
            return Placed(t, scan, pose, information, explained, score, wheels, moved_last=moved_last)

        found = [placed(first.hold.pose, first.hold, AT_FIRST)]
        is_lost = found[0].explained < s.lost
        self.lost += is_lost and not branch
        if not is_lost and not _odd(guesses, last.pose, motion):
            return found
        found += [placed(one.hold.pose, one.hold, AT_FIRST) for one in guesses[1:]]
        if max(one.explained for one in found) < s.lost and not branch:
            way, turned = self._extent(guesses, last.pose)
            centre = max(found, key=lambda one: one.score).pose if motion is None else first.hold.pose
            field, origin = submap.field_around(centre, REACH, FIELD_SD)
            few = scan.few[:: max(1, len(scan.few) // FEW)]
            search = Search(few, centre, SEARCH + way, SEARCH_TURN + turned, TURN_STEP)
            guess = correlated(field, origin, s.cell, search, STEP, TRUST + way, TRUST_TURN + turned)
            best = placed(guess, first.hold, AGAIN)
            if best.score > max(one.score for one in found) + BETTER:
                self.found_again += 1
                found.append(best)
        found.sort(key=lambda one: one.score, reverse=True)
        apart = list[Placed]()
        for one in found:
            if not any(_same(one.pose, other.pose) for other in apart):
                apart.append(one)
        return apart

    def _guesses(self, past: list[Placed], t: float, motion: Array | None) -> list[Guess]:
        """Where a scan may be: by the wheels, by the motion before, and where the last one was."""
        s, last = self.settings, past[-1].pose
        R, blind = rotation(float(last[2])), np.eye(3) / s.blind**2
        carried = last
        if len(past) > 1:
            before = max(past[-1].t - past[-2].t, 1e-3)
            carried = compose(last, between(past[-2].pose, last) * min((t - past[-1].t) / before, 2.0))
        if motion is None:
            return [Guess(Hold(carried, blind), 0.0), Guess(Hold(last, blind), OTHER)]
        cov = wheels_cov(motion, s)
        start = last
        if motion.any() and past[-1].moved_last is not None:  # they repeated a reading, and now say all that was since
            start = past[-1].moved_last
            R = rotation(float(start[2]))
        elif not motion.any():
            before = between(last, carried)
            cov = cov + np.outer(before, before)
        by_wheels = Hold(compose(start, motion), inverse(R @ cov @ R.T))
        return [Guess(by_wheels, 0.0), Guess(Hold(carried, blind), OTHER), Guess(Hold(last, blind), OTHER)]

    def _extent(self, guesses: list[Guess], last: Array) -> tuple[float, float]:
        """m and rad from the last pose to the farthest guess."""
        moved = [between(last, one.hold.pose) for one in guesses]
        return max(float(np.hypot(one[0], one[1])) for one in moved), max(abs(float(one[2])) for one in moved)

    def _checked(self, found: Placed, motion: Array, submap: Submap) -> Placed:
        """The scan, placed by the wheels from half a metre back where they contradict it and explain more points."""
        s, scan, pose = self.settings, found.scan, found.pose
        start, moved = self._wheels_check.motion(self._last[-1].pose, motion)
        information = inverse(wheels_cov(moved, s))
        if not contradicts(between(start, pose), moved, information) or not len(scan.few):
            return found
        grid, by_wheels, R = submap.grid, compose(start, moved), rotation(float(start[2]))
        hold, free = Hold(by_wheels, HELD * R @ information @ R.T), Hold(pose, np.zeros((3, 3)))
        other, _, explained = match(grid, scan.few, by_wheels, hold, s.sd, AGAIN, ITERATIONS)
        if explained < match(grid, scan.few, pose, free, s.sd, AGAIN, ITERATIONS)[2] + BETTER:
            return found
        self._wheels_check.forget()
        self.by_wheels += 1
        return found._replace(pose=other, wheels=True, points=False)


def wheels_cov(motion: Array, s: Settings) -> Array:
    """Covariance of a motion by the wheels: wide enough for slipping ones."""
    way, turned = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
    sd = s.still + s.by_way * way
    turn_sd = s.turn_still + s.by_turn * turned + s.turn_by_way * way
    return np.diag([sd**2, sd**2, turn_sd**2])


def beyond(motion: Array, way: float, turn: float) -> bool:
    """Tells if a motion goes farther, m, or turns more, rad."""
    return bool(np.hypot(motion[0], motion[1]) > way or abs(motion[2]) > turn)


def _odd(guesses: list[Guess], last: Array, motion: Array | None) -> bool:
    """Tells if the wheels' motion is none that a robot makes after the motion before."""
    if motion is None:
        return False
    before = between(last, guesses[1].hold.pose)
    if not motion.any():
        return beyond(before, MOVED, MOVED_TURN)
    off = motion - before
    off[2] = wrap(off[2])
    return beyond(off, ODD, ODD_TURN)


def _total(branch: list[Placed]) -> float:
    return sum(one.score for one in branch)


def _same(one: Array, other: Array) -> bool:
    return not beyond(between(one, other), SAME, SAME_TURN)


def _distance(pose: Array, hold: Hold) -> float:
    """Squared Mahalanobis distance of a pose from the one it is held to."""
    off = pose - hold.pose
    off[2] = wrap(off[2])
    return float(off @ hold.information @ off)
