"""Chooses the path and landmarks that a log's picture shows: true ones if known, else the best estimate."""

from typing import NamedTuple

import numpy as np

from ...backends.api import Solution
from ...core.factors import UNKNOWN, Dataset, Log, Truth
from ...core.se2 import Array, Ints, between, compose
from ...core.truth.errors import named
from ..measure.landmark_places import Places, elsewhere, placed
from ..plan.reference import outliers, reference

LARGEST = 40_000  # steps and sightings up to which the batch optimum is computed without --solve: about half a minute
MISFITS = 0.05  # share of sightings that do not fit the batch optimum from which on a warning is shown


class Shown(NamedTuple):
    """The path and landmarks to draw."""

    words: str  # describes the path
    step: Ints  # (m,) the steps whose pose is known, in order
    poses: Array  # (m, 3)
    reckoned: Array  # (n, 3) dead reckoning from the first of these poses
    xy: Array  # (l, 2) landmarks, without those that are not in one place
    mark: str  # describes such a landmark's place
    places: Places | None  # by the sightings from this path, where no true ones are known, or these are elsewhere
    solved: Truth | None  # the batch optimum, where the path is one

    def pose_at(self, steps: int) -> Ints:
        """Returns for each of the log's steps its row in `poses`, (steps,); -1 where its pose is not known."""
        return _rows(self.step, steps)


def shown(dataset: Dataset, solve: bool | None) -> Shown:
    """Chooses the true path, else the batch optimum if `solve` (None: if the log is small), else dead reckoning."""
    log, truth = dataset
    if truth is None or not len(truth.t):
        truth, words = _solved(named(log, truth), solve)
    else:
        words = (truth.words or "truth") if truth.kind == "truth" else "the batch optimum"
    reckoned = log.dead_reckoned()
    if truth is None:
        step, poses = np.arange(len(log)), reckoned
    else:
        step, poses = np.searchsorted(log.t, truth.t), truth.poses
        reckoned = from_pose(reckoned, int(step[0]), poses[0])
    solved = truth if truth is not None and truth.kind == "reference" else None
    places = placed(log, poses, _rows(step, len(log)), known=truth is not None)
    given = None if truth is None or elsewhere(truth, places) else truth.map
    if (
        given is not None
        and dataset.truth is not None
        and dataset.truth.map is not None
        and dataset.truth.places == "truth"
    ):
        return Shown(words, step, poses, reckoned, given.xy, "landmark", None, solved)
    if given is None:
        xy, mark = places.xy[~places.scattered], "landmark, median of its sightings"
    else:
        xy, mark = given.xy[~np.isin(given.ids, places.ids[places.scattered])], "landmark"
    return Shown(words, step, poses, reckoned, xy, mark, places, solved)


def from_pose(path: Array, k: int, pose: Array) -> Array:
    """Moves the path (n, 3) as a whole so that its step `k` is at `pose` (3,)."""
    n = len(path)
    return compose(np.broadcast_to(pose, (n, 3)), between(np.broadcast_to(path[k], (n, 3)), path))


def _solved(log: Log, solve: bool | None) -> tuple[Truth | None, str]:
    if not len(log.loop_to) and not (log.seen != UNKNOWN).any() and log.fixes is None:
        return None, "dead reckoning, which nothing in the log corrects"
    size = len(log) + log.sighted
    if solve is False or (solve is None and size > LARGEST):
        return None, "dead reckoning" + ("; --solve finds the batch optimum" if solve is None else "")
    truth = reference(log)
    if truth is None:
        return None, "dead reckoning; no batch optimum was found"
    if not truth.words or truth.map is None:
        return truth, truth.words or "the batch optimum, as truth is not known"
    odd = outliers(log, Solution(truth.poses, truth.map))
    look = odd.found > MISFITS * odd.of
    return truth, truth.words + ": sign of bearings, unit, clock, or landmarks that move?" * look


def _rows(step: Ints, steps: int) -> Ints:
    rows = np.full(steps, -1)
    rows[step] = np.arange(len(step))
    return rows
