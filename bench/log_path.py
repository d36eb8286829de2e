"""The path and the landmarks that a picture of a log shows: true where they are known, else the best there is."""

from typing import NamedTuple

import numpy as np

from ..frontend.dead_reckoning import dead_reckoned
from ..frontend.factors import UNKNOWN, Dataset, Log, Truth
from ..frontend.se2 import Array, Ints, act, between, compose

LARGEST = 40_000
"""Steps and sightings up to which the batch optimum is found without being asked for: about half a minute."""


class Shown(NamedTuple):
    """What is drawn."""

    words: str  # what the path is
    step: Ints  # (m,) the steps whose pose is known, in order
    poses: Array  # (m, 3)
    reckoned: Array  # (n, 3) dead reckoning from the first of these poses
    xy: Array  # (l, 2) landmarks
    solved: Truth | None  # the batch optimum, where the path is one

    def pose_at(self, steps: int) -> Ints:
        """(steps,) the row of each step in `poses`, -1 where its pose is not known."""
        return _rows(self.step, steps)


def shown(dataset: Dataset, solve: bool | None) -> Shown:
    """The true path, else the batch optimum, else dead reckoning.

    `solve`: find the optimum where there is no truth; None: where the log is small enough for it.
    """
    log, truth = dataset
    if truth is None or not len(truth.t):
        truth, words = _solved(log, solve)
    else:
        words = "truth" if truth.kind == "truth" else "the batch optimum"
    reckoned = dead_reckoned(log)
    if truth is None:
        step, poses = np.arange(len(log)), reckoned
    else:
        step, poses = np.searchsorted(log.t, truth.t), truth.poses
        reckoned = from_pose(reckoned, int(step[0]), poses[0])
    given = None if truth is None else truth.map
    xy = _placed(log, step, poses) if given is None else given.xy
    return Shown(words, step, poses, reckoned, xy, truth if truth is not None and truth.kind == "reference" else None)


def from_pose(path: Array, k: int, pose: Array) -> Array:
    """The path (n, 3) moved as a whole so that its step `k` is at `pose` (3,)."""
    n = len(path)
    return compose(np.broadcast_to(pose, (n, 3)), between(np.broadcast_to(path[k], (n, 3)), path))


def _solved(log: Log, solve: bool | None) -> tuple[Truth | None, str]:
    if not len(log.loop_to) and not (log.ids != UNKNOWN).any():
        return None, "dead reckoning, which nothing in the log corrects"
    size = len(log) + len(log.ids)
    if solve is False or (solve is None and size > LARGEST):
        return None, "dead reckoning" + ("; --solve finds the batch optimum" if solve is None else "")
    from .reference import reference  # gtsam

    truth = reference(log)
    if truth is None:
        return None, "dead reckoning; no batch optimum was found"
    return truth, truth.words or "the batch optimum, as truth is not known"


def _placed(log: Log, step: Ints, poses: Array) -> Array:
    """The landmarks (l, 2), each at the mean of where its sightings put it from the path's poses."""
    pose_at = _rows(step, len(log))
    seen = (log.ids != UNKNOWN) & (pose_at[log.sighting_step] >= 0)
    _, landmark = np.unique(log.ids[seen], return_inverse=True)
    points = sighted(poses[pose_at[log.sighting_step[seen]]], log.z[seen])
    count = np.bincount(landmark)
    return np.column_stack([np.bincount(landmark, points[:, i]) / count for i in (0, 1)])


def _rows(step: Ints, steps: int) -> Ints:
    rows = np.full(steps, -1)
    rows[step] = np.arange(len(step))
    return rows


def sighted(poses: Array, z: Array) -> Array:
    """Where (s, 2) in the world the sightings `z` (s, 2) made from `poses` (s, 3) are."""
    return act(poses, z[:, :1] * np.column_stack((np.cos(z[:, 1]), np.sin(z[:, 1]))))
