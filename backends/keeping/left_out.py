"""The poses of marginalised steps, relative to the frame of a submap."""

import numpy as np

from ...core.se2 import Array, Ints, wrap
from .submaps import turn_of


class LeftOut:
    """Poses as they were when they were marginalised, with their covariances given the landmarks around them.

    A frame moves with its landmarks, and these poses with it.
    """

    def __init__(self) -> None:
        self._frame = np.full(0, -1, np.int64)  # of each step; -1 of one that is not marginalised
        self._poses, self._covs = np.zeros((0, 3)), np.zeros((0, 6))  # in that frame

    def add(self, steps: Ints, frame: int, at: Array, poses: Array, left: Array) -> None:
        """Adds the poses (k, 3) of steps, and their covariances `left` (k, 3, 3), as seen from a frame at `at` (3,)."""
        while len(steps) and steps[-1] >= len(self._frame):
            more = max(1024, len(self._frame))
            self._frame = np.concatenate((self._frame, np.full(more, -1, np.int64)))
            self._poses = np.concatenate((self._poses, np.zeros((more, 3))))
            self._covs = np.concatenate((self._covs, np.zeros((more, 6))))
        c, s = np.cos(at[2]), np.sin(at[2])
        dx, dy = (poses[:, :2] - at[:2]).T
        self._frame[steps] = frame
        self._poses[steps] = np.stack((c * dx + s * dy, c * dy - s * dx, wrap(poses[:, 2] - at[2])), axis=-1)
        T = turn_of(-at[2])
        self._covs[steps] = (T @ left @ T.T)[:, *np.triu_indices(3)]

    def fill(self, path: Array, covs: Array, frames: Array, frame_covs: Array) -> None:
        """Fills their rows of a path (n, 3) and of covariances (n, 3, 3), which are in the world.

        `frames` (f, 3) has where the frames are now, `frame_covs` (f, 3, 3) the covariances that poses share with them.
        """
        steps = np.flatnonzero(self._frame[: len(path)] >= 0)
        for some in np.array_split(steps, max(1, len(steps) // 65536)):  # bounded scratch
            of = self._frame[some]
            at, pose = frames[of], self._poses[some]
            c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
            dx, dy = c * pose[:, 0] - s * pose[:, 1], s * pose[:, 0] + c * pose[:, 1]
            path[some] = np.stack((at[:, 0] + dx, at[:, 1] + dy, wrap(at[:, 2] + pose[:, 2])), axis=-1)
            left, T, G = np.zeros((len(some), 3, 3)), np.zeros((len(some), 3, 3)), np.tile(np.eye(3), (len(some), 1, 1))
            left[:, *np.triu_indices(3)] = self._covs[some]
            left += np.triu(left, 1).transpose(0, 2, 1)
            T[:, 0, 0] = T[:, 1, 1] = c
            T[:, 0, 1], T[:, 1, 0], T[:, 2, 2] = -s, s, 1.0
            G[:, 0, 2], G[:, 1, 2] = -dy, dx
            covs[some] = T @ left @ T.transpose(0, 2, 1) + G @ frame_covs[of] @ G.transpose(0, 2, 1)
