"""The linear Kalman filter, and random logs with correct covariances."""

from collections.abc import Sequence

import numpy as np

from slamduel.backends.programs.textbook_ekf import wrapped
from slamduel.core.factors import Dataset, Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Truth
from slamduel.core.se2 import Array, Ints


class TextbookKalman:
    """The linear Kalman filter of x' = F x + u + w, w ~ N(0, Q), seen through z = H x + v, v ~ N(0, R)."""

    def __init__(self, mean: Array, cov: Array) -> None:
        self.mean = np.array(mean, float)  # (n,)
        self.cov = np.array(cov, float)  # (n, n)

    def predict(self, F: Array, Q: Array, u: Array | float = 0.0) -> None:
        """Predicts: F (n, n), Q (n, n), u (n,)."""
        self.mean = F @ self.mean + u
        self.cov = F @ self.cov @ F.T + Q

    def update(self, z: Array, H: Array, R: Array) -> float:
        """Corrects by the measurement z (k,), H (k, n), R (k, k); returns its normalised innovation squared."""
        innovation = z - H @ self.mean
        S = H @ self.cov @ H.T + R
        K = self.cov @ H.T @ np.linalg.inv(S)
        self.mean = self.mean + K @ innovation
        self.cov = (np.eye(len(self.mean)) - K @ H) @ self.cov
        return float(innovation @ np.linalg.inv(S) @ innovation)


def random_covariance(rng: np.random.Generator, sd: Sequence[float]) -> Array:
    """A correlated, positive definite covariance (n, n) whose standard deviations are about `sd`."""
    n = len(sd)
    mixed = np.eye(n) + 0.4 * np.tril(rng.standard_normal((n, n)), -1)
    return np.diag(sd) @ mixed @ mixed.T @ np.diag(sd)


def random_log(
    rng: np.random.Generator,
    steps: int,
    landmarks: int,
    *,
    noise: float = 1.0,
    errors: float = 1.0,
    radius: float = 5.0,
    blind: float = 0.2,
    width: float = 12.0,
) -> Dataset:
    """A robot wandering in a square of `width` m among `landmarks`, seeing those between 0.5 m and `radius` m away.

    Every covariance is a different random one, with standard deviations near `noise` times 2 cm, 1 cm and 0.01 rad for
    the motion of a step of 0.3 m and 5 cm, 0.02 rad for a sighting. The errors are drawn from these covariances and
    scaled by `errors`: 1 is consistent, 0 an exact log, 2 overconfident. A share `blind` of the steps has no sightings,
    as have those with nothing near. Ids are neither sorted nor consecutive.
    """
    xy = rng.uniform(-width / 2, width / 2, (landmarks, 2))
    ids = rng.choice(10 * landmarks + 10, landmarks, replace=False).astype(np.int64)
    prior_cov = random_covariance(rng, [0.05 * noise, 0.05 * noise, 0.02 * noise])
    prior = Prior(np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)]), prior_cov)
    pose = prior.pose + errors * rng.multivariate_normal(np.zeros(3), prior_cov)
    pose[2] = wrapped(pose[2])
    no_loops = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    poses: list[Array] = []
    log_steps: list[Step] = []
    turn = 0.0
    for k in range(steps):
        odometry = None
        if k > 0:
            inward = wrapped(np.arctan2(-pose[1], -pose[0]) - pose[2])
            turn = 0.7 * turn + 0.1 * rng.standard_normal()
            outside = np.hypot(*pose[:2]) > width / 2
            motion = np.array([0.3, 0.0, turn + (0.2 * inward if outside else 0.0)])
            pose = moved(pose, motion)
            cov = random_covariance(rng, [0.02 * noise, 0.01 * noise, 0.01 * noise])
            odometry = Odometry(motion + errors * rng.multivariate_normal(np.zeros(3), cov), cov)
        poses.append(pose)
        sees = rng.uniform() >= blind
        log_steps.append(Step(0.1 * k, odometry, _look(rng, pose, ids, xy, noise, errors, radius * sees), no_loops))
    t = np.array([step.t for step in log_steps])
    seen = np.unique(np.concatenate([step.sightings.ids for step in log_steps]))
    on_map = np.isin(ids, seen)
    truth = Truth(t, np.array(poses), Map(ids[on_map], xy[on_map], None), None, "truth")
    return Dataset(Log.from_steps("random", prior, log_steps), truth)


def moved(pose: Array, delta: Array) -> Array:
    """The pose (3,) after the body-frame motion `delta` (3,), eq. (5) without its covariance."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array(
        [pose[0] + c * delta[0] - s * delta[1], pose[1] + s * delta[0] + c * delta[1], wrapped(pose[2] + delta[2])]
    )


def _look(
    rng: np.random.Generator, pose: Array, ids: Ints, xy: Array, noise: float, errors: float, radius: float
) -> RangeBearing:
    ranges = np.hypot(*(xy - pose[:2]).T)
    near = rng.permutation(np.flatnonzero((ranges > 0.5) & (ranges < radius)))
    covs = [random_covariance(rng, [0.05 * noise, 0.02 * noise]) for _ in near]
    z: list[Array] = []
    for i, cov in zip(near, covs, strict=True):
        bearing = np.arctan2(xy[i, 1] - pose[1], xy[i, 0] - pose[0]) - pose[2]
        measured = np.array([ranges[i], bearing]) + errors * rng.multivariate_normal(np.zeros(2), cov)
        z.append(np.array([measured[0], wrapped(measured[1])]))
    return RangeBearing(ids[near], np.array(z).reshape(-1, 2), np.array(covs).reshape(-1, 2, 2))
