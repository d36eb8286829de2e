"""EKF-SLAM as the ArUco EKF document writes it, with every matrix in full: to be read beside it, and a reference.

It is slow and shares nothing with the package's own estimators: the equations stand as printed, (5)-(9) for the motion,
(11)-(16) for a sighting and (17)-(20) for a new landmark, with corrections of what the document leaves out. The motion
is any body-frame delta, of which the document's midpoint model is one, and its noise is turned to the world by the
heading before the motion; bearings of innovations are wrapped; a new landmark is correlated with everything the pose is
correlated with; the sighting that creates a landmark is used for nothing else.

`start=unit` starts landmarks as the code in appendix A of the Matlab report (Fan Zhenhui, 2018) does, in place of eqs
(18)-(20): every landmark that a step sees for the first time has variances of 1 m^2 (`PX(covars + 1, covars + 1) = 1`)
and no cross-covariance, however uncertain pose and sighting are, and then its first sighting is used as all others are.

On a log with signatures the state is the survey's: x, y and signature of each landmark, and a sighting is (r, phi, s).
Numbers of lines are those of its algorithm "Extended Kalman Filter for SLAM". Its third row has neither the pose nor a
place in it, so that each signature is estimated as by a scalar filter of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.factors import Map, Odometry, Prior, Step, Truth
from ...core.options import option
from ...core.se2 import Array
from ..api import Belief, Builder

Sighting = tuple[int, Array, Array]  # id, z (2,) and its covariance (2, 2); with a signature (3,) and (3, 3)

MODEL, UNIT = "model", "unit"


@dataclass(frozen=True)
class Options:
    """Settings."""

    update: str = option(
        "sequential", "process sightings one by one, or those of a frame jointly", choices=("sequential", "joint")
    )
    start: str = option(
        MODEL,
        "start of a new landmark: the model's, or the Matlab report's appendix': variances of 1 m², no "
        "cross-covariance, and its first sighting used again",
        choices=(MODEL, UNIT),
    )


class TextbookEkf:
    """Dense EKF-SLAM with known ids; the state is (x, y, heading, then x and y of each landmark).

    On a log with signatures x, y and s of each. That of a given landmark is started by its first sighting's.

    One sighting after another, in the log's order, each linearised where the last one left the mean. With `together`
    the sightings of landmarks known before the step are stacked into a single update, linearised at the prediction, and
    new landmarks are added after it: a different filter, equal only where the models are linear. With `start` "unit"
    landmarks start as in the Matlab report's appendix, all new ones of a step at its prediction.

    `jacobians`: "standard" takes them at the mean; "first-estimates" (Huang, Mourikis and Roumeliotis, IJRR 29(5),
    2010) at the pose's predictions and at each landmark's first estimate; "ideal" at `truth`. `gate`: a sighting whose
    squared Mahalanobis distance exceeds it is rejected, or makes the landmark again if fewer than `confirm` sightings
    have agreed with it.
    """

    def __init__(
        self,
        prior: Prior,
        *,
        together: bool = False,
        start: str = MODEL,
        jacobians: str = "standard",
        truth: Truth | None = None,
        gate: float = np.inf,
        confirm: int = 3,
    ) -> None:
        known = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None) if prior.map is None else prior.map
        self.wide = 3 if prior.signatures else 2  # entries of the state for each landmark
        n = 3 + self.wide * len(known.ids)
        self.mean = np.zeros(n)
        self.mean[:3] = prior.pose
        self.cov = np.zeros((n, n))  # a map without covariance is held fixed: its rows stay zero
        self.cov[:3, :3] = prior.cov
        self.ids: list[int] = known.ids.tolist()  # landmark i of the map is ids[i]
        self.unsigned = set(self.ids) if prior.signatures else set[int]()  # given landmarks not sighted yet
        self.mean[self.places()] = known.xy.ravel()
        if known.cov is not None:
            self.cov[np.ix_(self.places(), self.places())] = known.cov
        self.together, self.start = together, start
        self.jacobians, self.truth, self.gate, self.confirm = jacobians, truth, gate, confirm
        self.nis = 0.0  # of the last step's sightings, summed
        self.nis_dof = 0
        self.refused = 0
        self.agreed = dict.fromkeys(self.ids, confirm)
        self.first = dict(zip(self.ids, known.xy, strict=True))  # each landmark's first estimate
        self.there = self.pose_to_linearise_at(0.0) if truth is not None else self.mean[:3].copy()

    def step(self, step: Step) -> Array:
        """Predicts, then corrects by the sightings; returns the pose (3,)."""
        self.nis, self.nis_dof, self.refused = 0.0, 0, 0
        if step.odometry is not None:
            self.predict(step.odometry, step.t)
        elif self.truth is not None:
            self.there = self.pose_to_linearise_at(step.t)
        seen = self.sighted(step)
        if self.start == UNIT:
            for landmark, z, _ in seen:
                if landmark not in self.ids:
                    self.append(landmark, z)
        if self.together:
            replaced = self.update([sighting for sighting in seen if sighting[0] in self.ids])
            for sighting in seen:
                if sighting[0] in replaced or sighting[0] not in self.ids:
                    self.add(*sighting)
        else:
            for sighting in seen:
                if sighting[0] not in self.ids or self.update([sighting]):
                    self.add(*sighting)
        return self.mean[:3].copy()

    def sighted(self, step: Step) -> list[Sighting]:
        """The step's sightings, lines 6 and 7."""
        ids, z, cov = step.sightings
        if self.wide == 3:
            z = np.column_stack((z, step.signatures.s))
            both = np.zeros((len(ids), 3, 3))  # Q of line 6
            both[:, :2, :2], both[:, 2, 2] = cov, step.signatures.var
            cov = both
        return list(zip(ids.tolist(), z, cov, strict=True))

    def places(self) -> list[int]:
        """Entries of the state that are x and y of landmarks."""
        return [3 + self.wide * i + h for i in range(len(self.ids)) for h in (0, 1)]

    def signatures(self) -> tuple[Array, Array]:
        """Mean and variance (n,) of the landmarks' signatures."""
        rows = [5 + 3 * i for i in range(len(self.ids))]
        return self.mean[rows], self.cov[rows, rows]

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the last step's sightings of mapped landmarks."""
        nis = self.nis if self.nis_dof else None
        return Belief(self.mean[:3].copy(), self.cov[:3, :3].copy(), nis, self.nis_dof, refused=self.refused)

    def map(self) -> Map:
        """The landmarks with their joint covariance."""
        rows = self.places()
        cov = self.cov[np.ix_(rows, rows)]
        return Map(np.array(self.ids, np.int64), self.mean[rows].reshape(-1, 2), cov if cov.any() else None)

    def finish(self) -> None:
        """None: a filter keeps no path."""

    def predict(self, odometry: Odometry, t: float = 0.0) -> None:
        """Predicts the motion, eqs (5)-(9)."""
        n = len(self.mean)
        before = self.mean[:3] if self.jacobians == "standard" else self.there
        theta = self.mean[2]
        dx, dy, dtheta = odometry.delta
        F = np.eye(3, n)  # takes the pose out of the state; its transpose is F of eq. (5)
        V, noisy = turn(theta), turn(before[2] if self.jacobians == "ideal" else theta)
        self.mean = self.mean + F.T @ V @ np.array([dx, dy, dtheta])  # eq. (5)
        self.mean[2] = wrapped(self.mean[2])
        G = np.eye(n)  # eq. (7)
        if self.jacobians == "standard":
            G[0, 2] = -np.sin(theta) * dx - np.cos(theta) * dy  # eq. (3)
            G[1, 2] = np.cos(theta) * dx - np.sin(theta) * dy
            self.there = self.mean[:3].copy()
        else:
            after = self.pose_to_linearise_at(t)
            G[0, 2] = -(after[1] - before[1])
            G[1, 2] = after[0] - before[0]
            self.there = after
        self.cov = G @ self.cov @ G.T + F.T @ noisy @ odometry.cov @ noisy.T @ F  # eqs (6), (8), (9)

    def update(self, sightings: Sequence[Sighting]) -> list[int]:
        """Updates by sightings of mapped landmarks at once, eqs (11)-(16); returns landmarks to be replaced."""
        if not sightings:
            return []
        k, wide = len(sightings), self.wide
        H = np.zeros((wide * k, len(self.mean)))
        Q = np.zeros((wide * k, wide * k))
        innovation = np.zeros(wide * k)
        for i, (landmark, z, cov) in enumerate(sightings):
            rows = slice(wide * i, wide * i + wide)
            expected, H[rows] = self.predict_sighting(landmark)
            innovation[rows] = z - expected
            innovation[wide * i + 1] = wrapped(z[1] - expected[1])
            Q[rows, rows] = cov
            if landmark in self.unsigned:  # nothing is known of its signature
                innovation[wide * i + 2], H[wide * i + 2] = 0.0, 0.0
        replaced: list[int] = []
        if np.isfinite(self.gate):
            used, replaced = self.gated([landmark for landmark, _, _ in sightings], innovation, H @ self.cov @ H.T + Q)
            H, innovation, Q = H[used], innovation[used], Q[np.ix_(used, used)]  # pyright: ignore[reportConstantRedefinition]
        S = H @ self.cov @ H.T + Q
        K = self.cov @ H.T @ np.linalg.inv(S)  # eq. (15)
        self.mean = self.mean + K @ innovation
        self.mean[2] = wrapped(self.mean[2])
        self.cov = (np.eye(len(self.mean)) - K @ H) @ self.cov
        self.nis += float(innovation @ np.linalg.inv(S) @ innovation)
        self.nis_dof += len(innovation)
        for landmark, z, cov in sightings:
            if landmark in self.unsigned:
                j = 5 + wide * self.ids.index(landmark)
                self.mean[j], self.cov[j, j] = z[2], cov[2, 2]
                self.unsigned.remove(landmark)
                self.nis_dof -= 1
        return replaced

    def gated(self, landmarks: list[int], innovation: Array, S: Array) -> tuple[list[int], list[int]]:
        """Gates each pair of rows given the accepted ones before; returns accepted rows and landmarks to replace."""
        used, replaced = list[int](), list[int]()
        for i, landmark in enumerate(landmarks):
            rows = list(range(self.wide * i, self.wide * i + self.wide))
            explained = S[np.ix_(rows, used)] @ np.linalg.inv(S[np.ix_(used, used)])
            new = innovation[rows] - explained @ innovation[used]
            cov = S[np.ix_(rows, rows)] - explained @ S[np.ix_(used, rows)]
            if new @ np.linalg.inv(cov) @ new <= self.gate:
                used += rows
                self.agreed[landmark] += 1
            elif self.agreed[landmark] < self.confirm:
                replaced.append(landmark)
            else:
                self.refused += 1
        return used, replaced

    def predict_sighting(self, landmark: int) -> tuple[Array, Array]:
        """Predicts the sighting (2,) of a landmark, eqs (12), (16), and its Jacobian (2, n), eq. (14).

        With a signature (3,), line 14, and (3, n), line 16.
        """
        j = 3 + self.wide * self.ids.index(landmark)
        x, y, theta = self.mean[:3]
        delta_x, delta_y = self.mean[j] - x, self.mean[j + 1] - y
        z = np.array([np.hypot(delta_x, delta_y), wrapped(np.arctan2(delta_y, delta_x) - theta)])
        delta_x, delta_y = self.lever(landmark)
        q = delta_x**2 + delta_y**2
        r = np.sqrt(q)
        H_v = np.array(
            [[-r * delta_x, -r * delta_y, 0, r * delta_x, r * delta_y], [delta_y, -delta_x, -q, -delta_y, delta_x]]
        )
        F_i = np.zeros((5, len(self.mean)))
        F_i[:3, :3] = np.eye(3)
        F_i[3:, j : j + 2] = np.eye(2)
        H = H_v @ F_i / q
        if self.wide == 3:
            z, H = np.append(z, self.mean[j + 2]), np.vstack((H, np.eye(1, len(self.mean), j + 2)))  # pyright: ignore[reportConstantRedefinition]
        return z, H

    def add(self, landmark: int, z: Array, Q: Array) -> None:
        """Adds a landmark, eqs (17)-(20), with its cross-covariance; a mapped one is first marginalised out."""
        if landmark in self.ids:
            self.forget(landmark)
        self.append(landmark, z)
        dx, dy = self.lever(landmark)
        r = np.hypot(dx, dy)
        G_p = np.array([[1, 0, -dy], [0, 1, dx]])  # eq. (19)
        G_z = np.array([[dx / r, -dy], [dy / r, dx]])  # eq. (20)
        n = len(self.cov) - self.wide
        cross = G_p @ self.cov[:3, :n]  # (2, n)
        self.cov[n : n + 2, :n], self.cov[:n, n : n + 2] = cross, cross.T
        self.cov[n : n + 2, n : n + 2] = G_p @ self.cov[:3, :3] @ G_p.T + G_z @ Q[:2, :2] @ G_z.T  # eq. (18)
        if self.wide == 3:
            self.cov[-1, -1] = Q[2, 2]

    def append(self, landmark: int, z: Array) -> None:
        """Appends a landmark where its sighting (2,) puts it, eq. (17), with variances of 1 m^2 and no correlation.

        With a signature as its sighting (3,) has it, line 10.
        """
        x, y, theta = self.mean[:3]
        r, phi = z[:2]
        place = np.array([x + r * np.cos(theta + phi), y + r * np.sin(theta + phi)])
        self.mean = np.concatenate((self.mean, place, z[2:]))
        self.ids.append(landmark)
        self.first[landmark] = place
        self.agreed[landmark] = 0
        n, own = len(self.cov), self.wide
        self.cov = np.block([[self.cov, np.zeros((n, own))], [np.zeros((own, n)), np.eye(own)]])

    def forget(self, landmark: int) -> None:
        """Removes a landmark from the map."""
        i = self.ids.index(landmark)
        rows = list(range(3 + self.wide * i, 3 + self.wide * i + self.wide))
        self.mean = np.delete(self.mean, rows)
        self.cov = np.delete(np.delete(self.cov, rows, 0), rows, 1)
        del self.ids[i]

    def lever(self, landmark: int) -> Array:
        """Returns (2,) m, from the pose to a landmark, both at the linearisation point, as Jacobians need it."""
        if self.jacobians == "standard":
            j = 3 + self.wide * self.ids.index(landmark)
            return self.mean[j : j + 2] - self.mean[:2]
        if self.jacobians == "first-estimates":
            return self.first[landmark] - self.there[:2]
        if self.truth is None or self.truth.map is None:
            raise ValueError("ideal Jacobians need a truth with a map")
        return self.truth.map.xy[self.truth.map.ids.tolist().index(landmark)] - self.there[:2]

    def pose_to_linearise_at(self, t: float) -> Array:
        """The mean's pose (3,), or the true one at time t (s)."""
        if self.truth is None:
            return self.mean[:3].copy()
        return self.truth.poses[int(np.argmin(np.abs(self.truth.t - t)))]


def turn(theta: float) -> Array:
    """The (3, 3) that turns a body-frame motion by a heading (rad)."""
    return np.array([[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1]])


def wrapped(angle: float) -> float:
    """Wraps an angle (rad) into (-pi, pi]."""
    turned = float(np.arctan2(np.sin(angle), np.cos(angle)))
    return np.pi if turned == -np.pi else turned


def textbook_ekf(prior: Prior, options: Options, rng: np.random.Generator) -> TextbookEkf:
    """The ArUco EKF document's equations in NumPy, every matrix in full: slow, to be read beside them."""
    del rng
    return TextbookEkf(prior, together=options.update == "joint", start=options.start)


build = Builder(textbook_ekf, options=Options, implementation="NumPy, as printed")
