"""EKF-SLAM that relinearises each sighting's update at its result, a given number of times.

Iterating is Gauss-Newton on the posterior (Bell and Cathey 1993, The iterated Kalman filter update as a Gauss-Newton
method, IEEE Transactions on Automatic Control 38(2)); with one iteration it is the EKF.
"""

from dataclasses import dataclass

import numpy as np

from slamduel.backends import api


@dataclass(frozen=True)
class Options:
    """Number of iterations."""

    iterations: int = api.option(3, "Gauss-Newton iterations of each sighting's update", minimum=1)


class IteratedEkf:
    """Iterated EKF: each sighting's update is relinearised at its result."""

    def __init__(self, prior: api.Prior, options: Options, rng: np.random.Generator) -> None:
        known = prior.map or api.Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)
        self.options, self.ids = options, known.ids.tolist()
        self.mean = np.concatenate((prior.pose, known.xy.ravel()))
        self.cov = np.zeros((len(self.mean), len(self.mean)))  # a fixed map keeps zero covariance, and so does not move
        self.cov[:3, :3] = prior.cov
        if known.cov is not None:
            self.cov[3:, 3:] = known.cov

    def step(self, step: api.Step) -> api.Pose:
        """Predicts, then processes the sightings one by one."""
        if step.odometry is not None:
            G = np.eye(len(self.mean))
            G[:3, :3], V = api.compose_jacobians(self.mean[:3], step.odometry.delta)
            self.mean[:3] = api.compose(self.mean[:3], step.odometry.delta)
            self.cov = G @ self.cov @ G.T
            self.cov[:3, :3] += V @ step.odometry.cov @ V.T
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark in self.ids:
                self.update(3 + 2 * self.ids.index(landmark), z, R)
            else:
                self.add(landmark, z, R)
        return self.mean[:3].copy()

    def update(self, j: int, z: api.Array, R: api.Array) -> None:
        """Corrects by a sighting of the landmark at rows j, j + 1 of the state."""
        at, known = self.iterate(self.mean, j, z, R)
        for _ in range(self.options.iterations - 1):
            at, known = self.iterate(at, j, z, R)
        self.mean, self.cov = at, self.cov - known @ self.cov
        self.mean[2] = api.wrap(at[2])

    def iterate(self, at: api.Array, j: int, z: api.Array, R: api.Array) -> tuple[api.Array, api.Array]:
        """x + K (z - h(at) - H (x - at)) and K H, with h and H of ArUco EKF SLAM, eqs (12) and (14), at `at`."""
        dx, dy = at[j : j + 2] - at[:2]
        r = np.hypot(dx, dy)
        H = np.zeros((2, len(at)))
        H[:, j : j + 2] = [[dx / r, dy / r], [-dy / r**2, dx / r**2]]
        H[:, :2] = -H[:, j : j + 2]
        H[1, 2] = -1.0
        innovation = z - [r, np.arctan2(dy, dx) - at[2]] - H @ (self.mean - at)
        innovation[1] = api.wrap(innovation[1])
        K = self.cov @ H.T @ np.linalg.inv(H @ self.cov @ H.T + R)
        return self.mean + K @ innovation, K @ H

    def add(self, landmark: int, z: api.Array, R: api.Array) -> None:
        """Adds a landmark, ArUco EKF SLAM, eqs (17) to (20), with its covariance with the whole state."""
        c, s = np.cos(z[1]), np.sin(z[1])
        by_pose, by_xy = api.act_jacobians(self.mean[:3], z[0] * np.array([c, s]))
        by_z = by_xy @ np.array([[c, -z[0] * s], [s, z[0] * c]])
        cross = by_pose @ self.cov[:3]
        self.mean = np.append(self.mean, api.act(self.mean[:3], z[0] * np.array([c, s])))
        self.cov = np.block([[self.cov, cross.T], [cross, cross[:, :3] @ by_pose.T + by_z @ R @ by_z.T]])
        self.ids.append(landmark)

    def belief(self) -> api.Belief:
        """The pose and its covariance."""
        return api.Belief(self.mean[:3].copy(), self.cov[:3, :3].copy())

    def map(self) -> api.Map:
        """The landmarks in order of first sighting."""
        cov = self.cov[3:, 3:].copy()
        return api.Map(np.array(self.ids, np.int64), self.mean[3:].reshape(-1, 2).copy(), cov if cov.any() else None)

    def finish(self) -> api.Solution | None:
        """None: a filter does not smooth."""
        return None


build = api.Builder(IteratedEkf, options=Options)
