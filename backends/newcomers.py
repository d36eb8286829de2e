"""Delayed initialisation of landmarks.

A landmark starts at its first sighting, and a linear solver makes the whole correction in one step. If that is longer
than the landmark's distance, it passes the robot and leaves the region where the derivatives hold, so sightings of a
new landmark are held back until, together, they determine its position to less than its own distance. And if the first
one is an outlier, a redescending loss rejects all the correct ones that follow; with a loss two must therefore agree.
"""

from collections import deque

import numpy as np

from ..core.factors import Map, Odometry
from ..core.se2 import Array, between, compose, rotation
from .models import place

AGREE = 13.82
"""Squared Mahalanobis distance that 999 of 1000 correct pairs stay within: chi-square, 2 degrees of freedom."""

Sighting = tuple[int, Array, Array]  # the step, the (range, bearing) (2,) and its covariance (2, 2)


class Newcomers:
    """Holds back sightings of a new landmark until they determine its position and, with `two`, two of them agree.

    The motion between two sightings is that of odometry.
    """

    def __init__(self, two: bool) -> None:
        self._two = two
        self._path: list[Array] = []  # dead reckoning from the first step
        self._covs: list[Array] = []  # of the motion before each step, in the frame of the first
        self._held: dict[int, deque[Sighting]] = {}
        self._told: dict[int, Array] = {}  # (2,) 1/m^2, 1/rad^2; information of those held about range and bearing

    def move(self, odometry: Odometry | None) -> None:
        """Adds the motion to the next step; needed only with `two`."""
        if odometry is None:
            self._path.append(np.zeros(3))
            self._covs.append(np.zeros((3, 3)))
        else:
            R = rotation(self._path[-1][2])
            self._covs.append(R @ odometry.cov @ R.T)
            self._path.append(compose(self._path[-1], odometry.delta))

    def sighted(self, landmark: int, now: Sighting, since: int = 0) -> list[Sighting]:
        """Returns everything held of `landmark` once it suffices with `now`, that one last; else nothing.

        Sightings before step `since` are dropped.
        """
        before = self._held.setdefault(landmark, deque())
        told = self._told.setdefault(landmark, np.zeros(2))
        while before and before[0][0] < since:
            told -= 1 / before.popleft()[2].diagonal()
        told += 1 / now[2].diagonal()
        enough = _placed(told, now[1][0]) and (not self._two or any(self._agree(other, now) for other in before))
        before.append(now)
        if not enough:
            return []
        del self._held[landmark], self._told[landmark]
        return list(before)

    def _agree(self, before: Sighting, now: Sighting) -> bool:
        """Tests if two sightings can be of one landmark, located by both in the frame of the first pose."""
        motion, motion_cov = self.motion(before[0], now[0])
        there, _, there_by_z = place(np.zeros(3), before[1])
        here, by_motion, here_by_z = place(motion, now[1])
        cov = there_by_z @ before[2] @ there_by_z.T + here_by_z @ now[2] @ here_by_z.T
        cov += by_motion @ motion_cov @ by_motion.T
        off = here - there
        return bool(off @ np.linalg.solve(cov, off) < AGREE)

    def alone(self) -> dict[int, Sighting]:
        """The last sighting of every landmark that is still held back."""
        return {landmark: held[-1] for landmark, held in self._held.items()}

    def added_to(self, landmarks: Map, path: Array) -> Map:
        """The map with those still held back, without covariance, where their last sighting from `path` (n, 3) is."""
        alone = {i: held for i, held in self.alone().items() if i not in landmarks.ids}
        if not alone:
            return landmarks
        more = np.array([place(path[k], z)[0] for k, z, _ in alone.values()])
        return Map(np.array([*landmarks.ids, *alone], np.int64), np.concatenate((landmarks.xy, more)), None)

    def motion(self, i: int, j: int) -> tuple[Array, Array]:
        """Step j relative to step i, (3,), and its covariance (3, 3) by odometry alone, to first order.

        A motion's error shifts everything after it, and its turn rotates that about the motion's end.
        """
        path, covs = np.array(self._path[i : j + 1]), np.array(self._covs[i + 1 : j + 1]).reshape(-1, 3, 3)
        swing = np.tile(np.eye(3), (j - i, 1, 1))
        swing[:, 0, 2] = path[1:, 1] - path[-1, 1]
        swing[:, 1, 2] = path[-1, 0] - path[1:, 0]
        R = rotation(-path[0, 2])
        cov = (swing @ covs @ swing.transpose(0, 2, 1)).sum(axis=0)
        return between(path[0], path[-1]), R @ cov @ R.T


def _placed(told: Array, distance: float) -> bool:
    """Tells if a landmark's standard deviation is below its distance, and below a radian."""
    by_range, by_bearing = told
    return not np.minimum(by_range * distance**2, by_bearing) <= 1  # NaN is left for GTSAM to reject
