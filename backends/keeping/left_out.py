"""The poses of marginalised steps, and where they are once the landmarks around them have moved."""

import numpy as np

from ...core.se2 import Array, Ints
from ._following import follow, with_frames


class LeftOut:
    """Poses as they were when they were marginalised, with their covariances given the landmarks around them.

    Beside these, the map of each time: landmarks are named by their row there, and keep it.
    """

    def __init__(self) -> None:
        self._of = np.full((0, 2), -1, np.int32)  # of each step, the map and the submap; -1: it is not marginalised
        self._poses, self._covs = np.zeros((0, 3)), np.zeros((0, 6))
        self._maps = list[Array]()

    def begin(self, landmarks: Array) -> None:
        """Takes the map (l, 2) of the poses that are added next."""
        self._maps.append(landmarks)

    def add(self, steps: Ints, submap: int, poses: Array, left: Array) -> None:
        """Adds the poses (k, 3) of steps that are told of in a submap, and their covariances `left` (k, 3, 3)."""
        while len(steps) and steps[-1] >= len(self._of):
            more = max(1024, len(self._of))
            self._of = np.concatenate((self._of, np.full((more, 2), -1, np.int32)))
            self._poses = np.concatenate((self._poses, np.zeros((more, 3))))
            self._covs = np.concatenate((self._covs, np.zeros((more, 6))))
        self._of[steps] = len(self._maps) - 1, submap
        self._poses[steps] = poses
        self._covs[steps] = left[:, *np.triu_indices(3)]

    def fill(
        self, path: Array, covs: Array, landmarks: Array, around: list[Ints], frames: Array, shared: Array, reach: float
    ) -> None:
        """Fills their rows of a path (n, 3) and of covariances (n, 3, 3).

        They follow the `landmarks` (l, 2), of which `around` (f,) has the rows for each submap, and those within
        `reach` (m) most of all. `frames` (f, 3) are the submaps' poses, and `shared` (f, 3, 3) what covariances of
        poses nearby have in common with them.
        """
        n = min(len(path), len(self._of))
        sizes = [len(rows) for rows in around]
        ends, rows = np.cumsum([0, *sizes]), np.concatenate(around)
        steps = np.flatnonzero(self._of[:n, 0] >= 0)
        bounds = np.flatnonzero(np.diff(self._of[steps, 0], prepend=-1))  # one map after the other
        for some in np.split(steps, bounds[1:]):
            submaps = self._of[some, 1].astype(np.int64)
            poses, left = self._poses[some], self._covs[some]
            follow(poses, left, self._maps[self._of[some[0], 0]], landmarks, submaps, ends, rows, reach)
            path[some], out = poses, np.empty((len(some), 3, 3))
            with_frames(poses, left, frames, shared, submaps, out)
            covs[some] = out
