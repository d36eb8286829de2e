"""Our factors as GTSAM's: the order of a measurement, the frame of a covariance and the names of variables change here.

GTSAM measures (bearing, range), and keeps pose covariances in the frame of the pose itself, where ours are in the world
frame, or, for odometry, in the frame before the motion. Every rotation between the two is done in this file.
"""

import gtsam
import numpy as np

from ..frontend.factors import Map, Prior, Step
from ..frontend.se2 import Array, rotation
from .models import place

FIXED_SD = 1e-6
"""m; how firmly a landmark that is given without covariance is held in place."""


class Keys:
    """Variable names: x0, x1, ... for the poses, l0, l1, ... for landmarks in the order in which they were first seen.

    An id may be any 64-bit number; GTSAM's symbols hold 56 bits.
    """

    def __init__(self) -> None:
        self.landmarks: dict[int, int] = {}

    @staticmethod
    def pose(step: int) -> int:
        """The key of the pose at `step`."""
        return gtsam.symbol("x", step)

    def landmark(self, landmark: int) -> int:
        """The key of a landmark's position, made up where the id is new."""
        return self.landmarks.setdefault(landmark, gtsam.symbol("l", len(self.landmarks)))


def pose2(pose: Array) -> gtsam.Pose2:
    """(3,) as a Pose2."""
    return gtsam.Pose2(pose[0], pose[1], pose[2])


def array(pose: gtsam.Pose2) -> Array:
    """A Pose2 as (3,)."""
    return np.array((pose.x(), pose.y(), pose.theta()))


def noise(cov: Array) -> gtsam.noiseModel.Gaussian:
    """A full covariance as a noise model."""
    return gtsam.noiseModel.Gaussian.Covariance(cov)


def to_world(pose: Array, cov: Array) -> Array:
    """GTSAM's marginal covariance (3, 3) of a pose, which is in the pose's own frame, in the world frame."""
    R = rotation(pose[2])
    return R @ cov @ R.T


def prior_factors(keys: Keys, prior: Prior) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The belief at step 0, the given map included, and its values."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    R = rotation(prior.pose[2])
    graph.add(gtsam.PriorFactorPose2(keys.pose(0), pose2(prior.pose), noise(R.T @ prior.cov @ R)))
    values.insert(keys.pose(0), pose2(prior.pose))
    if prior.map is not None:
        _add_known_map(prior.map, keys, graph, values)
    return graph, values


def step_factors(keys: Keys, k: int, step: Step, guess: Array) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The factors of step `k`, and first values of what they are the first to mention, seen from pose `guess` (3,).

    A landmark seen for the first time is put where ArUco EKF SLAM, eq. (17), has it.
    """
    graph, values, here = gtsam.NonlinearFactorGraph(), gtsam.Values(), keys.pose(k)
    if step.odometry is not None:
        values.insert(here, pose2(guess))
        graph.add(_between(keys.pose(k - 1), here, step.odometry.delta, step.odometry.cov))
    for to, delta, cov in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
        graph.add(_between(keys.pose(to), here, delta, cov))
    for landmark, z, cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
        if landmark not in keys.landmarks:
            values.insert(keys.landmark(landmark), place(guess, z)[0])
        swapped = noise(cov[::-1, ::-1])
        graph.add(gtsam.BearingRangeFactor2D(here, keys.landmark(landmark), gtsam.Rot2(z[1]), z[0], swapped))
    return graph, values


def path_and_map(keys: Keys, steps: int, values: gtsam.Values) -> tuple[Array, Map]:
    """The poses (steps, 3) and the landmarks, without covariance, in `values`."""
    path = np.array([array(values.atPose2(keys.pose(k))) for k in range(steps)])
    xy = np.array([values.atPoint2(key) for key in keys.landmarks.values()]).reshape(-1, 2)
    return path, Map(np.fromiter(keys.landmarks, np.int64, len(keys.landmarks)), xy, None)


def joint_covariance(keys: Keys, marginals: gtsam.Marginals | gtsam.ISAM2) -> Array:
    """(2n, 2n) of all landmarks in the order of `keys`, which is GTSAM's too."""
    if not keys.landmarks:
        return np.zeros((0, 0))
    return marginals.jointMarginalCovariance(list(keys.landmarks.values())).fullMatrix()


def failure(error: RuntimeError) -> str:
    """GTSAM's words for a failure, on one line and without its page of advice."""
    return "GTSAM: " + " ".join(str(error).split()).partition(" Thrown when")[0]


def _between(before: int, after: int, delta: Array, cov: Array) -> gtsam.BetweenFactorPose2:
    """A motion between two poses; its covariance turned from the frame before the motion into the one after it."""
    R = rotation(delta[2])
    return gtsam.BetweenFactorPose2(before, after, pose2(delta), noise(R.T @ cov @ R))


def _add_known_map(known: Map, keys: Keys, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """Put a given map into `graph` and `values`: one joint Gaussian, or each landmark held fixed where cov is None."""
    for landmark, xy in zip(known.ids.tolist(), known.xy, strict=True):
        values.insert(keys.landmark(landmark), xy)
    if known.cov is None:
        held = gtsam.noiseModel.Isotropic.Sigma(2, FIXED_SD)
        for landmark, xy in zip(known.ids.tolist(), known.xy, strict=True):
            graph.add(gtsam.PriorFactorPoint2(keys.landmark(landmark), xy, held))
    else:
        graph.add(_joint_prior([keys.landmark(i) for i in known.ids.tolist()], known.cov, values))


def _joint_prior(keys: list[int], cov: Array, values: gtsam.Values) -> gtsam.LinearContainerFactor:
    """The Gaussian with covariance `cov` (2n, 2n) around `values`, as one factor on all of `keys`.

    Factors of any number of keys cannot be made from Python directly; a sum of pairwise quadratic ones can, and it is
    the whole that is positive definite.
    """
    information = np.linalg.inv(cov)
    block = [[information[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] for j in range(len(keys))] for i in range(len(keys))]
    zero, none = np.zeros(2), np.zeros((2, 2))
    pairs = gtsam.GaussianFactorGraph()
    for i, key in enumerate(keys):
        pairs.add(gtsam.HessianFactor(key, block[i][i], zero, 0.0))
        for j in range(i + 1, len(keys)):
            pairs.add(gtsam.HessianFactor(key, keys[j], none, block[i][j], zero, none, zero, 0.0))
    here = gtsam.Values()
    for key in keys:
        here.insert(key, values.atPoint2(key))
    return gtsam.LinearContainerFactor(gtsam.JacobianFactor(gtsam.HessianFactor(pairs)), here)
