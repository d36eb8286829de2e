"""Landmarks by place, for backends that do not keep their covariances at hand: which of them may be in view.

A landmark's standard deviation is remembered from when it was last asked for. It falls as sightings come in, so that
what is remembered is an upper bound.
"""

from typing import Protocol

import numpy as np

from ..frontend.factors import Odometry, Prior, RangeBearing
from ..frontend.se2 import Array, compose, rotation
from ._expected import after_motion, ahead, near_ones, spreads
from .api import Diverged, Expected
from .models import place, sight
from .newcomers import Newcomers, Sighting

NOTHING = Expected(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 0)))
"""No landmark is expected."""


class Marginals(Protocol):
    """The part of a backend that is asked."""

    def __call__(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The last pose (3,), these landmarks' places (n, 2), and joint covariance (2n + 3, 2n + 3), the pose last."""
        ...


class Vicinity:
    """Where landmarks are, about."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.int64)
        self._rows: dict[int, int] = {}
        self._xy, self._sd = np.zeros((0, 2)), np.zeros(0)
        self._motion = np.zeros((4, 3))

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, landmark: int) -> bool:
        return landmark in self._rows

    def expected(
        self,
        pose: Array,
        cov: Array,
        odometry: Odometry | None,
        seen: RangeBearing,
        gate: float,
        new: list[int],
        marginals: Marginals,
    ) -> Expected:
        """What `Expects.expected` has to return, for a robot at `pose` with covariance `cov` before the odometry.

        `new` are the landmarks that were added since this was last asked.
        """
        motion = self._motion
        if odometry is not None:
            motion[0], motion[1:] = odometry
        z, R = seen.z, seen.cov
        x, P = ahead(pose, cov, odometry is not None, motion)
        near = self._ids[near_ones(x, P, self._xy, self._sd, z, R, gate)].tolist()
        landmarks = near + [landmark for landmark in new if landmark not in self._rows]
        if not landmarks:
            return NOTHING
        here, at, joint = marginals(landmarks)
        n = 2 * len(landmarks)
        self._learn(landmarks, at, spreads(joint, len(landmarks)))
        index, expected, together = after_motion(
            here, joint[n:, n:].copy(), at, joint[n:, :n].copy(), joint[:n, :n].copy(), odometry is not None, motion,
            z, R, gate,
        )  # fmt: skip
        return Expected(np.array(landmarks, np.int64)[index], expected, together)

    def forget(self, landmark: int) -> None:
        """Leaves a landmark out."""
        row = self._rows.pop(landmark, None)
        if row is not None:
            self._sd[row] = np.nan  # in no comparison

    def _learn(self, landmarks: list[int], at: Array, sd: Array) -> None:
        """Takes places and standard deviations as they are now."""
        new = [landmark for landmark in landmarks if landmark not in self._rows]
        if new:
            self._rows |= {landmark: len(self._ids) + k for k, landmark in enumerate(new)}
            self._ids = np.concatenate((self._ids, np.array(new, np.int64)))
            self._xy = np.concatenate((self._xy, np.zeros((len(new), 2))))
            self._sd = np.concatenate((self._sd, np.zeros(len(new))))
        rows = [self._rows[landmark] for landmark in landmarks]
        self._xy[rows], self._sd[rows] = at, sd


def first_expected(prior: Prior, seen: RangeBearing, gate: float) -> Expected:
    """What is expected at the first step: the landmarks of a given map with covariance, independent of the pose."""
    known = prior.map
    if known is None or known.cov is None or not len(known.ids):
        return NOTHING
    z, R = seen.z, seen.cov
    pose, P = np.array(prior.pose), np.array(prior.cov)
    sd = spreads(np.array(known.cov), len(known.ids))
    near = near_ones(pose, P, np.array(known.xy), sd, z, R, gate)
    entries = np.stack((2 * near, 2 * near + 1), axis=1).ravel()
    L, C = np.ascontiguousarray(known.cov[np.ix_(entries, entries)]), np.zeros((3, 2 * len(near)))
    index, expected, cov = after_motion(
        pose, P, np.ascontiguousarray(known.xy[near]), C, L, False, np.zeros((4, 3)), z, R, gate
    )
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
