"""Guesses of a scan's pose before it is matched: by the wheels, by the motion before, standing still."""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, compose, rotation, wrap
from ...core.small_matrices import inverse
from ._matching import Hold
from .settings import Settings

ODD, ODD_TURN = 0.3, 0.4
"""m and rad between the wheels' motion and the motion before that no robot does from one scan to the next."""

MOVED, MOVED_TURN = 0.03, 0.03
"""m and rad of the motion before; a robot that moved less may well stand still."""

STEADY, STEADY_TURN = 0.02, 0.03
"""sd, m and rad, of the difference between the motions to two scans, at the least."""

SPEEDS_UP, TURNS_UP = 0.8, 2.0
"""sd, m/s² and rad/s², of a robot's acceleration."""

SECOND = 1.0
"""s; scans farther apart tell nothing of the acceleration."""


class Anchor(NamedTuple):
    """The last scan up to which wheels and scans agreed, where they do not any more.

    Readings that come late, or too early, leave the sum of the motions since then as it was.
    """

    t: float
    pose: Array  # (3,) on the matcher's path
    moved: Array  # (3,) by the wheels since then


class Guesses(NamedTuple):
    """Poses (3,) that a scan may have."""

    wheels: Hold | None  # by their motion since the scan before; None without wheels
    since: Hold | None  # by their motion since the anchor; None without one
    last: Array  # (3,) where the scan before was
    carried: Array  # (3,) by the motion before
    odd: bool  # the wheels do what no robot does
    cov: Array  # (3,) variances of the difference between the motions to two scans, m² and rad²
    blind: float  # sd, m and rad, of a motion that only the motion before tells

    @property
    def first(self) -> Hold:
        """The most trusted one."""
        return self.wheels or self._by_motion()[0]

    @property
    def all(self) -> list[Hold]:
        """All that there are, the most trusted one first; most scans need no more than that."""
        return [one for one in (self.wheels, self.since, *self._by_motion()) if one is not None]

    def _by_motion(self) -> tuple[Hold, Hold]:
        """By the motion before, and standing still."""
        blind = np.eye(3) / self.blind**2
        if self.wheels is None:
            return Hold(self.carried, blind), Hold(self.last, blind)
        R = rotation(float(self.last[2]))
        cov = R @ np.diag(np.minimum(self.cov, self.blind**2)) @ R.T
        return Hold(self.carried, inverse(cov)), Hold(self.last, blind)

    @property
    def vague(self) -> float:
        """The logarithm of the volume in which the motion before has the pose, over that of a steady robot."""
        return 0.5 * float(np.log(self.cov / np.array([STEADY, STEADY, STEADY_TURN]) ** 2).sum())

    def surprise(self, pose: Array) -> float:
        """Squared distance of the motion to `pose` from the motion before it."""
        off = between(self.last, pose) - between(self.last, self.carried)
        off[2] = wrap(off[2])
        return float((off * off / self.cov).sum())


def guesses(
    last: Array, moved: Array, times: tuple[float, float], motion: Array | None, anchor: Anchor | None, s: Settings
) -> Guesses:
    """Guesses the pose of a scan that was taken after the one at `last` (3,), to which the robot `moved` (3,).

    `times` are the seconds of that motion and those since then: where they differ, stamps jitter. `motion` (3,) is the
    wheels' since then.
    """
    before = moved * min(times[1] / max(times[0], 1e-3), 2.0)
    longer = max(times)
    d, uneven = min(longer, SECOND) ** 2, abs(times[1] - times[0]) / max(longer, 1e-3)
    way = STEADY + SPEEDS_UP * d + uneven * float(np.hypot(moved[0], moved[1]))
    sd = np.array([way, way, STEADY_TURN + TURNS_UP * d + uneven * abs(moved[2])])
    carried = compose(last, before)
    if motion is None:
        return Guesses(None, None, last, carried, False, sd * sd, s.blind)
    off = motion - before
    off[2] = wrap(off[2])
    if motion.any():
        odd = beyond(off, max(ODD, 3 * sd[0]), max(ODD_TURN, 3 * sd[2]))
    else:
        odd = beyond(before, MOVED, MOVED_TURN)
    by_wheels = held(last, motion, wheels_cov(motion, s))
    since = None
    if anchor is not None:
        moved = compose(anchor.moved, motion)
        since = held(anchor.pose, moved, wheels_cov(moved, s))
    return Guesses(by_wheels, since, last, carried, odd, sd * sd, s.blind)


def held(start: Array, motion: Array, cov: Array) -> Hold:
    """The hold of a pose by the motion (3,) from `start` (3,), whose covariance (3, 3) is in its axes."""
    R = rotation(float(start[2]))
    return Hold(compose(start, motion), inverse(R @ cov @ R.T))


def wheels_cov(motion: Array, s: Settings) -> Array:
    """Covariance of a motion by the wheels: wide enough for slipping ones."""
    way, turned = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
    sd = s.still + s.by_way * way
    turn_sd = s.turn_still + s.by_turn * turned + s.turn_by_way * way
    return np.diag([sd**2, sd**2, turn_sd**2])


def distance(pose: Array, hold: Hold) -> float:
    """Squared Mahalanobis distance of a pose from the one it is held to."""
    off = pose - hold.pose
    off[2] = wrap(off[2])
    return float(off @ hold.information @ off)


def beyond(motion: Array, way: float, turn: float) -> bool:
    """Tells if a motion goes farther, m, or turns more, rad."""
    return bool(np.hypot(motion[0], motion[1]) > way or abs(motion[2]) > turn)
