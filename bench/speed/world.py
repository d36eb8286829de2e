"""Makes the world in which backends are timed: a square of landmarks, surveyed first, then driven at random.

One landmark stands on every 4 m², anywhere, so that only the map's size changes with their number. The survey goes over
the square in rows, 2 m a step, and sights every landmark; the timed drive goes on from there 0.1 m a step, and at each
sights the nearest landmarks, or as many anywhere on the map. Errors are drawn from the stated covariances.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from ...core.se2 import Array, Ints, between, compose, wrap

AREA = 4.0  # m² for each landmark
NEAREST = 1.0  # m; nearer landmarks are not sighted: their bearing would be nearly uninformative
REACH = 3.2  # m, range of the survey's sensor; its steps are so close that no landmark is left out
PACE, ROW, STRIDE = 2.0, 4.0, 0.1  # m: step and row distance of the survey at most, and a step of the drive
ODOMETRY_SD = (0.01, 0.002, 0.01)  # m, m, rad a step: ahead, sideways, turning
SIGHTING_SD = (0.1, 0.03)  # m, rad
PRIOR_SD = (0.01, 0.01, 0.001)  # m, m, rad; of the start of a survey, or of a filter with a given map

NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


class World(NamedTuple):
    """An unknown map, and the path through it."""

    prior: Prior  # at the survey's first step, without a map
    survey: list[Step]  # every landmark is sighted
    drive: list[Step]  # what is timed; its first step follows the survey's last
    map: Map  # the true one, without covariance
    start: Array  # (3,) the true pose at the survey's last step


def world(landmarks: int, steps: int, sightings: int, seed: int, *, scattered: bool = False) -> World:
    """Makes `landmarks`, and a drive of `steps` that sight the `sightings` nearest; `scattered`: any of them."""
    rng = np.random.default_rng([seed, landmarks])
    side = float(np.sqrt(AREA * landmarks))
    ids = rng.permutation(landmarks).astype(np.int64)
    xy = rng.uniform(-side / 2, side / 2, (landmarks, 2))
    there = _rows(side)
    through = _wander(there[-1], steps, side, rng)
    poses = np.vstack((there, through))
    prior = Prior(poses[0], np.diag(np.square(PRIOR_SD)))
    every: list[Step] = []
    for k, pose in enumerate(poses):
        away = np.hypot(*(xy - pose[:2]).T)
        if k < len(there):
            seen = np.flatnonzero((away > NEAREST) & (away < REACH))
        else:
            seen = _chosen(away, sightings, rng if scattered else None)
        odometry = None
        if k:
            delta = between(poses[k - 1], pose) + np.array(ODOMETRY_SD) * rng.standard_normal(3)
            odometry = Odometry(delta, np.diag(np.square(ODOMETRY_SD)))
        every.append(Step(0.1 * k, odometry, _sightings(pose, ids[seen], xy[seen], rng), NO_LOOPS))
    steps_of = list(Log.from_steps(f"square of {landmarks} landmarks", prior, every))
    return World(prior, steps_of[: len(there)], steps_of[len(there) :], Map(ids, xy, None), there[-1])


def without_ids(steps: Sequence[Step]) -> list[Step]:
    """The steps with sightings of unknown landmarks."""
    found: list[Step] = []
    for step in steps:
        ids = np.full(len(step.sightings.ids), UNKNOWN)
        ids.flags.writeable = False  # as a log's: kernels are compiled for one kind
        found.append(step._replace(sightings=step.sightings._replace(ids=ids)))
    return found


def _rows(side: float) -> Array:
    """The survey's poses (n, 3): rows over the square, to and fro."""
    along = np.linspace(-side / 2, side / 2, int(np.ceil(side / PACE)) + 1)
    rows = [
        np.column_stack((along[::way], np.full(len(along), y), np.full(len(along), 0.0 if way > 0 else np.pi)))
        for y, way in zip(np.linspace(-side / 2, side / 2, int(np.ceil(side / ROW)) + 1), _TO_AND_FRO, strict=False)
    ]
    return np.vstack(rows)


_TO_AND_FRO = [1, -1] * 10_000


def _wander(pose: Array, steps: int, side: float, rng: np.random.Generator) -> Array:
    """Returns poses (steps, 3) of a drive that bends at random, and turns back where it leaves the square."""
    poses, turn = np.empty((steps, 3)), 0.0
    for k in range(steps):
        turn = 0.9 * turn + 0.02 * rng.standard_normal()
        outside = np.abs(pose[:2]).max() > 0.45 * side
        inward = wrap(np.arctan2(-pose[1], -pose[0]) - pose[2]) if outside else 0.0
        pose = poses[k] = compose(pose, np.array((STRIDE, 0.0, turn + 0.1 * inward)))
    return poses


def _chosen(away: Array, count: int, rng: np.random.Generator | None) -> Ints:
    """Chooses the sighted landmarks by their distances (n,): the nearest, or with `rng` any; fewer where fewer are."""
    seen = np.flatnonzero(away > NEAREST)
    if len(seen) <= count:
        return seen
    if rng is not None:
        return rng.choice(seen, count, replace=False)
    return seen[np.argpartition(away[seen], count - 1)[:count]]


def _sightings(pose: Array, ids: Ints, xy: Array, rng: np.random.Generator) -> RangeBearing:
    dx, dy = (xy - pose[:2]).T
    z = np.column_stack((np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2]))
    z += np.array(SIGHTING_SD) * rng.standard_normal(z.shape)
    z[:, 1] = wrap(z[:, 1])
    return RangeBearing(ids, z, np.tile(np.diag(np.square(SIGHTING_SD)), (len(ids), 1, 1)))
