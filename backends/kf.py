"""The linear Kalman filter of the survey slides: SLAM linearised at the heading that odometry gives.

The slides' algorithm Kalman_filter, lines 2-8: x_t = A x_{t-1} + B u_t + noise of covariance R, z_t = H x_t + noise of
covariance Q, where A, B and H may change with time but must not depend on the state. The state is (x, y, heading,
m1x, m1y, ...). What makes the models linear is that the heading is taken as given, as by a compass: h, the prior's and
the turns that odometry reports, summed. It turns motions and sightings, and their covariances, into the world; a
sighting (range, bearing) becomes an offset in metres there, the middle of the arc on which the landmark may be. With
w = Rot(h) (dx, dy) for the motion, or for the sighted offset, and w' the same turned left by a right angle,

    x, y   +=  w + w' (heading - h)          w  =  m - (x, y) - w' (heading - h)

the terms with heading - h being what a heading a little off does, to first order. The extended Kalman filter differs in
this alone, that it turns by its own estimate of the heading. Where dead reckoning knows the heading the two agree, and
are the best there is; where it does not, the linear filter is linearised in the wrong place, and unaware of it.
"""

from math import cos, exp, sin

import numpy as np

from ..frontend.factors import Map, Odometry, Prior, Step
from ..frontend.se2 import Array, wrap
from .api import Belief, Builder, Diverged, NoOptions, Pose


class Kf:
    """The linear Kalman filter of the survey slides: it trusts dead reckoning with the heading, unlike the EKF."""

    def __init__(self, prior: Prior, options: NoOptions, rng: np.random.Generator) -> None:
        del options, rng
        self._heading = float(prior.pose[2])  # the given one, which the state's deviates from
        self._mean, self._cov = np.array(prior.pose), np.array(prior.cov)
        self._row: dict[int, int] = {}  # landmark id -> where its x is in the state
        self._nis, self._nis_dof = 0.0, 0
        if prior.map is not None:
            ids, xy, cov = prior.map
            self._row = {landmark: 3 + 2 * i for i, landmark in enumerate(ids.tolist())}
            self._grow(xy.ravel(), np.zeros((3, 2 * len(ids))), np.zeros((2 * len(ids),) * 2) if cov is None else cov)

    def step(self, step: Step) -> Pose:
        """Predict with the odometry, then correct with one sighting after another, or add its landmark."""
        if step.odometry is not None:
            self._predict(step.odometry)
        self._nis, self._nis_dof = 0.0, 0
        to_world = _rotation(self._heading)
        for landmark, (r, bearing), polar in zip(step.sightings.ids.tolist(), *step.sightings[1:], strict=True):
            c, s, v = cos(bearing), sin(bearing), float(polar[1, 1])
            ahead = to_world @ np.array([c, s])
            by_polar = np.stack((ahead, r * _left(ahead)), axis=-1)
            w = exp(-v / 2) * r * ahead
            Q = by_polar @ polar @ by_polar.T + (r * v) ** 2 / 2 * ahead[:, None] * ahead
            if landmark in self._row:
                self._correct(landmark, w, Q)
            else:
                self._add(landmark, w, Q)
        pose = self._mean[:3].copy()
        pose[2] = wrap(pose[2])
        if not np.isfinite(pose).all():
            raise Diverged("the pose is not finite")
        return pose

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the sightings of landmarks already known."""
        pose = self._mean[:3].copy()
        pose[2] = wrap(pose[2])
        return Belief(pose, self._cov[:3, :3].copy(), self._nis if self._nis_dof else None, self._nis_dof)

    def map(self) -> Map:
        """All landmarks in the order in which they were first seen, with their joint covariance."""
        ids = np.fromiter(self._row, np.int64, len(self._row))
        return Map(ids, self._mean[3:].reshape(-1, 2).copy(), self._cov[3:, 3:].copy())

    def finish(self) -> None:
        """None: a filter does not look back."""

    def _predict(self, odometry: Odometry) -> None:
        """Lines 3 and 4."""
        to_world = np.eye(3)
        to_world[:2, :2] = _rotation(self._heading)
        w = to_world @ odometry.delta
        turned = _left(w)
        self._mean[:2] += turned * self._deviation
        self._mean[:3] += w
        self._cov[:2] += turned[:, None] * self._cov[2]  # A P, then (A P) A^T
        self._cov[:, :2] += self._cov[:, 2, None] * turned
        self._cov[:3, :3] += to_world @ odometry.cov @ to_world.T
        self._heading += float(odometry.delta[2])

    def _correct(self, landmark: int, w: Array, Q: Array) -> None:
        """Lines 6 to 8 for a sighted offset w (2,) of covariance Q (2, 2), both in the world's frame."""
        row, turned = self._row[landmark], _left(w)
        HP = self._cov[row : row + 2] - self._cov[:2] - turned[:, None] * self._cov[2]
        S = HP[:, row : row + 2] - HP[:, :2] - HP[:, 2, None] * turned + Q
        innovation = w - (self._mean[row : row + 2] - self._mean[:2] - turned * self._deviation)
        try:
            root = np.linalg.cholesky(S)
        except np.linalg.LinAlgError:
            raise Diverged(f"the innovation covariance of landmark {landmark} is not positive definite") from None
        white, W = np.linalg.solve(root, innovation), np.linalg.solve(root, HP)
        self._mean += W.T @ white  # K = P H^T S^-1 = W^T L^-1
        self._cov -= W.T @ W  # (I - K H) P, symmetric to the last bit
        self._nis += float(white @ white)
        self._nis_dof += 2

    def _add(self, landmark: int, w: Array, Q: Array) -> None:
        """A new landmark at the sighted offset, with its cross-covariance with everything else."""
        self._row[landmark] = len(self._mean)
        turned = _left(w)
        cross = self._cov[:, :2] + self._cov[:, 2, None] * turned
        cov = cross[:2] + turned[:, None] * cross[2] + Q
        self._grow(self._mean[:2] + w + turned * self._deviation, cross, cov)

    @property
    def _deviation(self) -> float:
        """How far the state's heading is off the given one, rad."""
        return float(self._mean[2]) - self._heading

    def _grow(self, mean: Array, cross: Array, cov: Array) -> None:
        """More state: `mean` (k,), its covariance (k, k), and `cross` (n, k) with the n entries there are."""
        self._mean = np.concatenate((self._mean, mean))
        self._cov = np.block([[self._cov, cross], [cross.T, cov]])


def _rotation(heading: float) -> Array:
    """(2, 2) from the body's frame to the world's."""
    c, s = cos(heading), sin(heading)
    return np.array([[c, -s], [s, c]])


def _left(w: Array) -> Array:
    """The first two of `w`, turned left by a right angle: what they change by with the heading."""
    return np.array([-w[1], w[0]])


build = Builder(Kf, linear=True)
