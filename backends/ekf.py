"""EKF-SLAM with known correspondence, as in ArUco EKF SLAM, eqs (5)-(20).

The state is (x, y, heading, m1x, m1y, m2x, ...) with one joint covariance. Only the blocks that an equation changes are
touched: a motion changes the pose's three rows and columns, a sighting is a rank-2 correction of the whole.
"""

import numpy as np

from ..frontend.factors import Map, Prior, RangeBearing, Step
from ..frontend.se2 import wrap
from .api import Belief, Builder, Diverged, NoOptions, Pose
from .models import innovation, place, predict, sight

SPACE = 64
"""State entries reserved at first; doubled whenever they run out."""


class Ekf:
    """The extended Kalman filter of ArUco EKF SLAM: one sighting after another, the map grown as markers appear."""

    def __init__(self, prior: Prior, options: NoOptions, rng: np.random.Generator) -> None:
        del options, rng
        self._slot: dict[int, int] = {}  # landmark id -> its x's place in the state
        self._mean = np.zeros(SPACE)
        self._cov = np.zeros((SPACE, SPACE))
        self._mean[:3], self._cov[:3, :3] = prior.pose, prior.cov
        self._size = 3
        self._nis, self._nis_dof = 0.0, 0
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Predict with the odometry, then take one sighting after another: correct, or add a marker not yet known."""
        if step.odometry is not None:
            self._predict(step)
        self._nis, self._nis_dof = 0.0, 0
        for k, landmark in enumerate(step.sightings.ids.tolist()):
            if landmark in self._slot:
                self._correct(step.sightings, k)
            else:
                self._add(step.sightings, k)
        return self._mean[:3].copy()

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the step's sightings of landmarks already known."""
        nis = self._nis if self._nis_dof else None
        return Belief(self._mean[:3].copy(), self._cov[:3, :3].copy(), nis, self._nis_dof)

    def map(self) -> Map:
        """All landmarks with their joint covariance, in the order in which they were first seen."""
        n = self._size
        ids = np.fromiter(self._slot, np.int64, len(self._slot))
        return Map(ids, self._mean[3:n].reshape(-1, 2).copy(), self._cov[3:n, 3:n].copy())

    def finish(self) -> None:
        """None: a filter does not look back."""

    def _predict(self, step: Step) -> None:
        """Eqs (5)-(9): the pose's block becomes G C G' + N, its cross-covariance with the map G C."""
        assert step.odometry is not None
        n, P = self._size, self._cov
        self._mean[:3], G, N = predict(self._mean[:3], step.odometry)
        P[:3, :n] = G @ P[:3, :n]
        P[3:n, :3] = P[:3, 3:n].T
        block = P[:3, :3] @ G.T + N
        P[:3, :3] = (block + block.T) / 2

    def _correct(self, seen: RangeBearing, k: int) -> None:
        """Eqs (11)-(16) for one known landmark, written as P - W W' with W = P H' L^-T and S = L L'."""
        n, P = self._size, self._cov
        at = self._slot[int(seen.ids[k])]
        expected, by_pose, by_landmark = sight(self._mean[:3], self._mean[at : at + 2])
        PHt = P[:n, :3] @ by_pose.T + P[:n, at : at + 2] @ by_landmark.T
        S = by_pose @ PHt[:3] + by_landmark @ PHt[at : at + 2] + seen.cov[k]
        try:
            L_inv = np.linalg.inv(np.linalg.cholesky(S))
        except np.linalg.LinAlgError:
            raise Diverged(f"the innovation covariance of landmark {seen.ids[k]} is not positive definite") from None
        nu = L_inv @ innovation(seen.z[k], expected)
        W = PHt @ L_inv.T
        self._mean[:n] += W @ nu
        self._mean[2] = wrap(self._mean[2])
        P[:n, :n] -= W @ W.T
        self._nis += float(nu @ nu)
        self._nis_dof += 2

    def _add(self, seen: RangeBearing, k: int) -> None:
        """Eqs (17)-(20), and the cross-covariance of the new landmark with all the rest: Gp times the pose's rows."""
        n, P = self._grown(2), self._cov
        xy, by_pose, by_z = place(self._mean[:3], seen.z[k])
        cross = by_pose @ P[:3, :n]
        own = cross[:, :3] @ by_pose.T + by_z @ seen.cov[k] @ by_z.T
        self._mean[n : n + 2] = xy
        P[n : n + 2, :n] = cross
        P[:n, n : n + 2] = cross.T
        P[n : n + 2, n : n + 2] = (own + own.T) / 2
        self._slot[int(seen.ids[k])] = n

    def _adopt(self, known: Map) -> None:
        """Start from a given map; one without covariance is held fixed: its block stays zero, and so does its gain."""
        n, m = self._grown(2 * len(known.ids)), self._size
        self._mean[n:m] = known.xy.ravel()
        if known.cov is not None:
            self._cov[n:m, n:m] = known.cov
        self._slot = {int(i): n + 2 * k for k, i in enumerate(known.ids)}

    def _grown(self, more: int) -> int:
        """Make the state `more` entries longer and return its size before."""
        before = self._size
        self._size += more
        space = len(self._mean)
        if self._size > space:
            space = max(2 * space, self._size)
            mean, cov = np.zeros(space), np.zeros((space, space))
            mean[:before], cov[:before, :before] = self._mean[:before], self._cov[:before, :before]
            self._mean, self._cov = mean, cov
        return before


build = Builder(Ekf)
