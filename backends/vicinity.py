"""Landmarks by place, for backends that do not keep their covariances at hand: which of them may be in view.

What is remembered of a landmark, and why it is enough, is said in `_vicinity`.
"""

from typing import Protocol

import numpy as np

from ..core.factors import Odometry, Prior, RangeBearing
from ..core.se2 import Array, Ints, compose, rotation
from . import _vicinity
from ._expected import Gaussian, after_motion, near_ones, spreads
from ._vicinity import STATE, SUMS, Places
from .api import Diverged, Expected
from .expected import as_expected, room_for
from .models import place, sight
from .newcomers import Newcomers, Sighting

NOTHING = Expected(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 0)))
"""No landmark is expected."""


SPACE = 32  # landmarks that there is room for at first


class Marginals(Protocol):
    """The part of a backend that is asked."""

    def __call__(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The last pose (3,), these landmarks' places (n, 2), and joint covariance (2n + 3, 2n + 3), the pose last."""
        ...


class Vicinity:
    """The rough places of landmarks.

    With `follows`, `move` is told of every motion, and landmarks are also remembered as seen from the robot.
    """

    def __init__(self, *, follows: bool = False) -> None:
        self._follows = follows
        self._rows: dict[int, int] = {}
        self.count = 0  # of rows, with those of landmarks that are left out
        self._places = _places(SPACE)
        self._expected = room_for(SPACE)
        self._no_cov = np.zeros((3, 3))
        self.motion = np.zeros((4, 3))  # asked about: dx, dy, dtheta and their covariance
        self.used = False

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, landmark: int) -> bool:
        return landmark in self._rows

    def move(self, odometry: Odometry | None) -> None:
        """The robot moves; needed only with `follows`, and once `used`."""
        if odometry is not None:
            self.motion[0], self.motion[1:] = odometry
            _vicinity.move(self._places.address, self.motion)

    @property
    def address(self) -> int:
        """Of the `Places`, for compiled code; `ready` may change it."""
        return self._places.address

    def ready(self, odometry: Odometry | None, new: list[int]) -> bool:
        """Prepares a question: the `motion`, and landmarks that were added. False where there is no motion."""
        self.used = True
        if new:
            self._add(new)
        if odometry is None:
            return False
        self.motion[0], self.motion[1:] = odometry
        return True

    def expected(
        self,
        pose: Array,
        cov: Array | None,
        odometry: Odometry | None,
        seen: RangeBearing,
        gate: float,
        new: list[int],
        marginals: Marginals,
    ) -> Expected:
        """The landmarks of `Expects.expected` for a robot at `pose` with covariance `cov` before the odometry.

        `new` are the landmarks that were added since this was last asked. With `follows`, `cov` is not needed.
        """
        moves, address = self.ready(odometry, new), self._places.address
        n = _vicinity.choose(
            address, self.count, pose, self._no_cov if cov is None else cov, self._follows, moves, self.motion,
            seen.z, seen.cov, gate,
        )  # fmt: skip
        if n == 0:
            return NOTHING
        if n > len(self._expected.ids):
            self._expected = room_for(2 * n)
        here, at, joint = marginals(self._places.ids[self.asked(n)].tolist())
        _vicinity.expect(address, here, at, joint, moves, self.motion, seen.z, seen.cov, gate, self._expected.address)
        return as_expected(self._expected)

    def place(self, xy: Array, sd: Array) -> None:
        """Places the first landmarks, (n, 2) m, with deviations of at most sd (n,) m in any direction."""
        self._places.xy[: len(sd)], self._places.sd[: len(sd)] = xy, sd

    def asked(self, count: int) -> Ints:
        """(count,) rows of the landmarks that `choose` has found."""
        return self._places.asked[:count]

    def forget(self, landmark: int) -> None:
        """Leaves a landmark out."""
        row = self._rows.pop(landmark, None)
        if row is not None:
            self._places.sd[row] = np.nan  # in no comparison

    def _add(self, new: list[int]) -> None:
        """Makes room for landmarks; they are asked for next."""
        new = [landmark for landmark in new if landmark not in self._rows]
        first, self.count = self.count, self.count + len(new)
        if self.count > len(self._places.ids):
            before, self._places = self._places, _places(max(SPACE, 2 * self.count))
            for name in ("ids", "xy", "sd", "off", "apart", "since"):
                getattr(self._places, name)[:first] = getattr(before, name)[:first]
            self._places.odometer[:] = before.odometer
        self._places.ids[first : self.count] = new
        self._rows |= {landmark: first + k for k, landmark in enumerate(new)}


def _places(landmarks: int) -> Places:
    """Room for that many, nothing being known of them."""
    n = landmarks
    return Places(
        ids=np.zeros(n, np.int64),
        asked=np.zeros(n, np.int64),
        xy=np.zeros((n, 2)),
        sd=np.full(n, np.inf),
        off=np.zeros((n, 2)),
        apart=np.full(n, np.inf),
        since=np.zeros((n, SUMS)),
        odometer=np.zeros(STATE),
    )


def first_expected(prior: Prior, seen: RangeBearing, gate: float) -> Expected:
    """The expectation at the first step: the landmarks of a given map with covariance, independent of the pose."""
    known = prior.map
    if known is None or known.cov is None or not len(known.ids):
        return NOTHING
    z, R = seen.z, seen.cov
    pose, P = np.array(prior.pose), np.array(prior.cov)
    sd = spreads(np.array(known.cov), len(known.ids))
    near = near_ones(pose, P, np.array(known.xy), sd, z, R, gate)
    entries = np.stack((2 * near, 2 * near + 1), axis=1).ravel()
    L, C = np.ascontiguousarray(known.cov[np.ix_(entries, entries)]), np.zeros((3, 2 * len(near)))
    belief = Gaussian(pose, P, np.ascontiguousarray(known.xy[near]), C, L)
    index, expected, cov = after_motion(belief, False, np.zeros((4, 3)), z, R, gate)
    return Expected(known.ids[near[index]], expected, cov)


def with_held(
    found: Expected, held: dict[int, Sighting], newcomers: Newcomers, odometry: Odometry | None, last: int
) -> Expected:
    """Adds landmarks that a backend holds back, by their last sighting and the odometry from there: `last` + 1 is now.

    Their errors are taken to be independent of the others': what they have in common is the pose, which they do not
    depend on.
    """
    ids, z, blocks = list[int](), list[Array](), list[Array]()
    for landmark, (step, seen, cov) in held.items():
        motion, motion_cov = newcomers.motion(step, last)
        if odometry is not None:
            R = rotation(motion[2])
            ahead_of = compose(motion, odometry.delta)
            F = np.eye(3)
            F[0, 2], F[1, 2] = motion[1] - ahead_of[1], ahead_of[0] - motion[0]
            motion_cov = F @ motion_cov @ F.T + R @ odometry.cov @ R.T
            motion = ahead_of
        spot, _, by_z = place(np.zeros(3), seen)
        try:
            expected, by_pose, by_spot = sight(motion, spot)
        except Diverged:
            continue
        ids.append(landmark)
        z.append(expected)
        blocks.append(by_pose @ motion_cov @ by_pose.T + by_spot @ by_z @ cov @ by_z.T @ by_spot.T)
    if not ids:
        return found
    n = 2 * len(found.ids)
    joint = np.zeros((n + 2 * len(ids), n + 2 * len(ids)))
    joint[:n, :n] = found.cov
    for k, block in enumerate(blocks):
        joint[n + 2 * k : n + 2 * k + 2, n + 2 * k : n + 2 * k + 2] = (block + block.T) / 2
    return Expected(np.array([*found.ids.tolist(), *ids], np.int64), np.array([*found.z, *z]), joint)
