"""Makes small logs with ground truth for checks of contract and estimates."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...core import se2
from ...core.factors import Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from ...core.se2 import Array, Ints

PRIOR_SD = np.array([0.05, 0.05, 0.02])  # m, m, rad
MOTION_SD = np.array([0.02, 0.01, 0.01])  # m, m, rad, a step
SIGHTING_SD = np.array([0.05, 0.02])  # m, rad
POORER = 6.0  # factor on the odometry's sd where a loop closure is to correct its drift
LOOP_SD = np.array([0.5, 0.5, 0.15])  # m, m, rad
# Errors of the motion to the side and of the turn go together, as do those of a sighting: zeros hide mistakes.
CORRELATION = np.array([[1.0, 0.0, 0.2], [0.0, 1.0, 0.4], [0.2, 0.4, 1.0]])
NO_SIGHTINGS = RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))

IDS = np.array([7, 10**12, 0, 41, 3_000_000_000, 12, 11, 5, 900, 2, 10**9, 77], np.int64)
"""Landmark ids as real logs have them: neither sorted, nor small, nor consecutive."""
RING = np.array([[np.cos(a), np.sin(a)] for a in 2 * np.pi * np.arange(12) / 12]) * np.array([[6.0], [2.5]] * 6)
"""(12, 2) landmarks, m, every other one inside and outside a circle of 4 m radius about the origin"""
CIRCLE = np.array([0.3, 0.0, 0.075])  # the motion of a step along that circle; 84 of them go round
CIRCLE_START = np.array([4.0, 0.0, np.pi / 2])

INDOORS = 5.0  # m, the sensor's range in every direction


class SmallLog(NamedTuple):
    """A log with the true path and map."""

    log: Log
    path: Array  # (n, 3)
    map: Map


def drive(
    rng: np.random.Generator,
    motions: Array,
    *,
    start: Array = CIRCLE_START,
    ids: Ints = IDS,
    xy: Array = RING,
    scale: float = 1.0,
    errors: float = 1.0,
    bias: Array | None = None,
    reach: float = INDOORS,
    sees: Callable[[int, int], bool] | None = None,
) -> SmallLog:
    """Makes the log of a robot with `motions` (n - 1, 3) from about `start` (3,) among landmarks `ids` at `xy`.

    Standard deviations are those above times `scale`; the errors drawn from them are multiplied by `errors` (0: an
    exact log), and `bias` (3,) is added to every odometry delta. `sees(k, i)` says whether landmark `ids[i]`, if within
    `reach`, is sighted at step k; None: it is. The prior is `start`, and the robot is off it as stated.
    """
    motion_cov = scale**2 * CORRELATION * np.outer(MOTION_SD, MOTION_SD)
    sighting_cov = scale**2 * CORRELATION[1:, 1:] * np.outer(SIGHTING_SD, SIGHTING_SD)
    motion_root, sighting_root = np.linalg.cholesky(motion_cov), np.linalg.cholesky(sighting_cov)
    prior = Prior(start, np.diag((scale * PRIOR_SD) ** 2))
    pose = start + errors * scale * PRIOR_SD * rng.standard_normal(3)
    pose[2] = se2.wrap(pose[2])
    poses = [pose]
    for motion in motions:
        poses.append(se2.compose(poses[-1], motion))
    path = np.array(poses)
    steps: list[Step] = []
    for k, pose in enumerate(path):
        odometry = None
        if k > 0:
            delta = motions[k - 1] + errors * motion_root @ rng.standard_normal(3)
            odometry = Odometry(delta if bias is None else delta + bias, motion_cov)
        seen = [i for i in range(len(ids)) if np.hypot(*(xy[i] - pose[:2])) < reach and (not sees or sees(k, i))]
        z = sight(pose, xy[seen]) + errors * rng.standard_normal((len(seen), 2)) @ sighting_root.T
        z[:, 1] = se2.wrap(z[:, 1])
        sightings = RangeBearing(ids[seen], z, np.broadcast_to(sighting_cov, (len(seen), 2, 2)))
        steps.append(Step(0.1 * k, odometry, sightings, NO_LOOPS))
    log = Log.from_steps("conformance", prior, steps)
    on_map = np.isin(ids, log.ids)
    return SmallLog(log, path, Map(ids[on_map], xy[on_map], None))


def around(steps: int) -> Array:
    """The motions (steps - 1, 3) of `steps` steps along the circle."""
    return np.tile(CIRCLE, (steps - 1, 1))


def behind(rng: np.random.Generator, heading: float, scale: float = 1.0, errors: float = 1.0) -> SmallLog:
    """Makes a drive of 16 m straight ahead, from a landmark 2 m behind towards one far ahead."""
    ahead = np.array([np.cos(heading), 0.0])  # exactly, where the heading is 0 or pi
    places, motions = np.array([-2.0 * ahead, 30.0 * ahead]), np.tile([0.2, 0.0, 0.0], (79, 1))
    start = np.array([0.0, 0.0, heading])
    return drive(rng, motions, start=start, ids=IDS[:2], xy=places, scale=scale, errors=errors, reach=40.0)


def sight(pose: Array, xy: Array) -> Array:
    """Computes exact ranges and bearings (k, 2) of landmarks `xy` (k, 2) from `pose`, ArUco EKF SLAM, eq. (12)."""
    dx, dy = (xy - pose[:2]).T
    return np.stack((np.hypot(dx, dy), se2.wrap(np.arctan2(dy, dx) - pose[2])), axis=-1)


def with_map(drive: SmallLog, cov: Array | None, rng: np.random.Generator) -> SmallLog:
    """Gives a map: the true one, held fixed, or one drawn with joint covariance `cov` (2n, 2n)."""
    ids, xy, _ = drive.map
    if cov is not None:
        xy = xy + rng.multivariate_normal(np.zeros(xy.size), cov).reshape(-1, 2)
    prior = drive.log.prior._replace(map=Map(ids, xy, cov))
    return drive._replace(log=Log.from_steps(drive.log.name, prior, list(drive.log)))


def with_loop(drive: SmallLog, to: int) -> SmallLog:
    """Removes sightings and adds an exact loop closure, stated to LOOP_SD, from the last step to `to`.

    The odometry is stated so poor that its drift agrees with the loop: a gate or a robust loss would reject it else.
    """
    steps = [step._replace(sightings=NO_SIGHTINGS) for step in drive.log]
    steps[1:] = [
        step._replace(odometry=step.odometry._replace(cov=POORER**2 * step.odometry.cov))
        for step in steps[1:]
        if step.odometry is not None
    ]
    delta = se2.between(drive.path[to], drive.path[-1])
    steps[-1] = steps[-1]._replace(loops=RelativePoses(np.array([to]), delta[None], np.diag(np.square(LOOP_SD))[None]))
    return drive._replace(log=Log.from_steps(drive.log.name, drive.log.prior, steps))


def with_loops(drive: SmallLog, rng: np.random.Generator, errors: float = 1.0, scale: float = 1.0) -> SmallLog:
    """Adds to every third step from the tenth on loop closures to two earlier steps, with noise as of a motion."""
    cov = scale**2 * CORRELATION * np.outer(MOTION_SD, MOTION_SD)
    noise, steps = errors * np.linalg.cholesky(cov), list(drive.log)
    for k in range(10, len(steps), 3):
        to = np.sort(rng.choice(k - 1, 2, replace=False))
        delta = se2.between(drive.path[to], drive.path[k]) + rng.standard_normal((2, 3)) @ noise.T
        delta[:, 2] = se2.wrap(delta[:, 2])
        steps[k] = steps[k]._replace(loops=RelativePoses(to, delta, np.broadcast_to(cov, (2, 3, 3))))
    return drive._replace(log=Log.from_steps(drive.log.name, drive.log.prior, steps))


def dead_reckoned(log: Log) -> tuple[Array, Array]:
    """The path (n, 3) of prior and odometry alone, and its covariances (n, 3, 3), to first order."""
    path, covs = [log.prior.pose], [log.prior.cov]
    for step in log:
        if step.odometry is not None:
            by_pose, by_delta = se2.compose_jacobians(path[-1], step.odometry.delta)
            covs.append(by_pose @ covs[-1] @ by_pose.T + by_delta @ step.odometry.cov @ by_delta.T)
            path.append(se2.compose(path[-1], step.odometry.delta))
    return np.array(path), np.array(covs)


def a_round() -> Log:
    """Makes a drive of just over one round of the circle, so that landmarks return and the heading crosses pi."""
    return drive(np.random.default_rng(1), around(90)).log
