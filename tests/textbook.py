"""EKF-SLAM as the ArUco EKF document writes it, with every matrix in full: the yardstick other filters are held to.

Nothing here is quick and nothing is shared with the package's own estimators: the equations stand as printed, (5)-(9)
for the motion, (11)-(16) for a sighting and (17)-(20) for a new landmark, with what the document leaves out put right.
The motion is any body-frame delta, of which the document's midpoint model is one, and its noise is turned to the world
by the heading before the motion; bearings of innovations are wrapped; a new landmark is correlated with everything the
pose is correlated with; the sighting that creates a landmark is used for nothing else.
"""

from collections.abc import Sequence

import numpy as np

from slamduel.frontend.factors import (
    Dataset,
    Log,
    Map,
    Odometry,
    Prior,
    RangeBearing,
    RelativePoses,
    Step,
    Truth,
)
from slamduel.frontend.se2 import Array, Ints


def wrapped(angle: float) -> float:
    """An angle (rad) in (-pi, pi]."""
    turned = float(np.arctan2(np.sin(angle), np.cos(angle)))
    return np.pi if turned == -np.pi else turned


class TextbookKalman:
    """The linear Kalman filter of x' = F x + u + w, w ~ N(0, Q), seen through z = H x + v, v ~ N(0, R)."""

    def __init__(self, mean: Array, cov: Array) -> None:
        self.mean = np.array(mean, float)  # (n,)
        self.cov = np.array(cov, float)  # (n, n)

    def predict(self, F: Array, Q: Array, u: Array | float = 0.0) -> None:
        """Move the belief: F (n, n), Q (n, n), u (n,)."""
        self.mean = F @ self.mean + u
        self.cov = F @ self.cov @ F.T + Q

    def update(self, z: Array, H: Array, R: Array) -> float:
        """Fold the measurement z (k,), H (k, n), R (k, k) in; returns its normalised innovation squared."""
        innovation = z - H @ self.mean
        S = H @ self.cov @ H.T + R
        K = self.cov @ H.T @ np.linalg.inv(S)
        self.mean = self.mean + K @ innovation
        self.cov = (np.eye(len(self.mean)) - K @ H) @ self.cov
        return float(innovation @ np.linalg.inv(S) @ innovation)


class TextbookEkf:
    """Dense EKF-SLAM with known ids; the state is (x, y, heading, then x and y of each landmark).

    One sighting after another, in the log's order, each linearised where the last one left the mean. With `together`
    the sightings of landmarks known before the step are stacked into a single update, linearised at the prediction,
    and the new landmarks are added after it: a different filter, equal only where the models are linear.
    """

    def __init__(self, prior: Prior, *, together: bool = False) -> None:
        known = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None) if prior.map is None else prior.map
        n = 3 + 2 * len(known.ids)
        self.mean = np.concatenate((prior.pose, known.xy.ravel()))
        self.cov = np.zeros((n, n))  # a map without covariance is held fixed: its rows stay zero
        self.cov[:3, :3] = prior.cov
        if known.cov is not None:
            self.cov[3:, 3:] = known.cov
        self.ids = known.ids.tolist()  # landmark i of the map is ids[i]
        self.together = together
        self.nis = 0.0  # of the last step's sightings, summed
        self.nis_dof = 0

    def step(self, step: Step) -> Array:
        """Predict, then fold the sightings in; returns the pose (3,)."""
        self.nis, self.nis_dof = 0.0, 0
        if step.odometry is not None:
            self.predict(step.odometry)
        seen = list(zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True))
        if self.together:
            self.update([sighting for sighting in seen if sighting[0] in self.ids])
            seen = [sighting for sighting in seen if sighting[0] not in self.ids]
        for landmark, z, Q in seen:
            if landmark in self.ids:
                self.update([(landmark, z, Q)])
            else:
                self.add(landmark, z, Q)
        return self.mean[:3].copy()

    def predict(self, odometry: Odometry) -> None:
        """The motion, eqs (5)-(9)."""
        n = len(self.mean)
        theta = self.mean[2]
        dx, dy, dtheta = odometry.delta
        F = np.eye(3, n)  # takes the pose out of the state; its transpose is F of eq. (5)
        V = np.array([[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1]])
        G = np.eye(n)  # eq. (7)
        G[0, 2] = -np.sin(theta) * dx - np.cos(theta) * dy  # eq. (3)
        G[1, 2] = np.cos(theta) * dx - np.sin(theta) * dy
        self.mean = self.mean + F.T @ V @ np.array([dx, dy, dtheta])  # eq. (5)
        self.mean[2] = wrapped(self.mean[2])
        self.cov = G @ self.cov @ G.T + F.T @ V @ odometry.cov @ V.T @ F  # eqs (6), (8), (9)

    def update(self, sightings: Sequence[tuple[int, Array, Array]]) -> None:
        """Sightings (id, z, Q) of landmarks that are on the map, stacked into one update: eqs (11)-(16)."""
        if not sightings:
            return
        k = len(sightings)
        H = np.zeros((2 * k, len(self.mean)))
        Q = np.zeros((2 * k, 2 * k))
        innovation = np.zeros(2 * k)
        for i, (landmark, z, cov) in enumerate(sightings):
            rows = slice(2 * i, 2 * i + 2)
            expected, H[rows] = self.expected(landmark)
            innovation[rows] = z[0] - expected[0], wrapped(z[1] - expected[1])
            Q[rows, rows] = cov
        S = H @ self.cov @ H.T + Q
        K = self.cov @ H.T @ np.linalg.inv(S)  # eq. (15)
        self.mean = self.mean + K @ innovation
        self.mean[2] = wrapped(self.mean[2])
        self.cov = (np.eye(len(self.mean)) - K @ H) @ self.cov
        self.nis += float(innovation @ np.linalg.inv(S) @ innovation)
        self.nis_dof += 2 * k

    def expected(self, landmark: int) -> tuple[Array, Array]:
        """The sighting (2,) of a landmark as the mean has it, eqs (12), (16), and its Jacobian (2, n), eq. (14)."""
        j = 3 + 2 * self.ids.index(landmark)
        x, y, theta = self.mean[:3]
        delta_x, delta_y = self.mean[j] - x, self.mean[j + 1] - y
        q = delta_x**2 + delta_y**2
        r = np.sqrt(q)
        H_v = np.array(
            [
                [-r * delta_x, -r * delta_y, 0, r * delta_x, r * delta_y],
                [delta_y, -delta_x, -q, -delta_y, delta_x],
            ]
        )
        F_i = np.zeros((5, len(self.mean)))
        F_i[:3, :3] = np.eye(3)
        F_i[3:, j : j + 2] = np.eye(2)
        return np.array([r, wrapped(np.arctan2(delta_y, delta_x) - theta)]), H_v @ F_i / q

    def add(self, landmark: int, z: Array, Q: Array) -> None:
        """A landmark seen for the first time, eqs (17)-(20), and its cross-covariance with all that was there."""
        x, y, theta = self.mean[:3]
        r, phi = z
        c, s = np.cos(theta + phi), np.sin(theta + phi)
        G_p = np.array([[1, 0, -r * s], [0, 1, r * c]])  # eq. (19)
        G_z = np.array([[c, -r * s], [s, r * c]])  # eq. (20)
        cross = G_p @ self.cov[:3, :]  # (2, n)
        own = G_p @ self.cov[:3, :3] @ G_p.T + G_z @ Q @ G_z.T  # eq. (18)
        self.mean = np.concatenate((self.mean, [x + r * c, y + r * s]))  # eq. (17)
        self.cov = np.block([[self.cov, cross.T], [cross, own]])
        self.ids.append(landmark)


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

    Every covariance is another random one, with standard deviations near `noise` times 2 cm, 1 cm and 0.01 rad for the
    motion of a step of 0.3 m and 5 cm, 0.02 rad for a sighting. The errors are drawn from these very covariances and
    multiplied by `errors`: 1 is honest, 0 an exact log, 2 one that claims to be better than it is. At a step in
    `blind` of all there are no sightings, nor at one where nothing is near. Ids are neither sorted nor consecutive.
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
