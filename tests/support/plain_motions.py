"""Our J in GTSAM: its own factors, except for our residual of motions as a Python factor."""

from collections.abc import Callable

import gtsam
import numpy as np

from motions import between_jacobians
from slamduel.core.factors import Log, Map
from slamduel.core.se2 import Array, between, rotation, wrap


def optimised(
    log: Log, path: Array, landmarks: Map, loss: gtsam.noiseModel.mEstimator.Base | None = None
) -> tuple[float, Array, dict[int, Array]]:
    """J, the path (n, 3) and landmarks at the optimum near a start, by GTSAM's Levenberg-Marquardt.

    Sightings and loop closures have the `loss`.
    """
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(_factor([0], log.prior.cov, lambda poses: (poses[0] - log.prior.pose, [np.eye(3)])))
    for k, pose in enumerate(path):
        values.insert(k, gtsam.Pose2(*pose))
        if k:
            graph.add(_motion(k - 1, k, log.delta[k], log.delta_cov[k]))
    for k, to, delta, cov in zip(log.loop_step, log.loop_to, log.loop_delta, log.loop_cov, strict=True):
        graph.add(_motion(int(to), int(k), delta, cov, loss))
    key = {landmark: len(path) + i for i, landmark in enumerate(landmarks.ids.tolist())}
    for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
        values.insert(key[landmark], xy)
    for k, landmark, z, cov in zip(log.sighting_step, log.ids.tolist(), log.z, log.z_cov, strict=True):
        model = _model(cov[::-1, ::-1], loss)
        graph.add(gtsam.BearingRangeFactor2D(int(k), key[landmark], gtsam.Rot2(z[1]), z[0], model))
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-15)
    params.setAbsoluteErrorTol(0.0)
    best = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
    poses = [best.atPose2(k) for k in range(len(path))]
    found = np.array([[pose.x(), pose.y(), pose.theta()] for pose in poses])
    return 2 * graph.error(best), found, {landmark: best.atPoint2(k) for landmark, k in key.items()}


def _model(cov: Array, loss: gtsam.noiseModel.mEstimator.Base | None) -> gtsam.noiseModel.Base:
    plain = gtsam.noiseModel.Gaussian.Covariance(cov)
    return plain if loss is None else gtsam.noiseModel.Robust.Create(loss, plain)


def _motion(
    before: int, after: int, delta: Array, cov: Array, loss: gtsam.noiseModel.mEstimator.Base | None = None
) -> gtsam.CustomFactor:
    def residual(poses: list[Array]) -> tuple[Array, list[Array]]:
        return between(*poses) - delta, list(between_jacobians(*poses))

    return _factor([before, after], cov, residual, loss)


def _factor(
    keys: list[int],
    cov: Array,
    residual: Callable[[list[Array]], tuple[Array, list[Array]]],
    loss: gtsam.noiseModel.mEstimator.Base | None = None,
) -> gtsam.CustomFactor:
    """A residual of poses with its derivatives by their coordinates; GTSAM expects them in the frames of the poses."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, H: list[Array] | None) -> Array:
        keys = this.keys()
        at = [values.atPose2(key) for key in keys]
        poses = [np.array([pose.x(), pose.y(), pose.theta()]) for pose in at]
        e, by = residual(poses)
        e[2] = wrap(e[2])
        if H is not None:
            for i, (pose, by_pose) in enumerate(zip(poses, by, strict=True)):
                turn = np.eye(3)
                turn[:2, :2] = rotation(pose[2])[:2, :2]
                H[i] = np.asfortranarray(by_pose @ turn)
        return e

    return gtsam.CustomFactor(_model(cov, loss), keys, error)
