"""Delayed-state EKFs with whole matrices: the textbook EKF and the paper's invariant one, with kept poses."""

from typing import Any

import numpy as np
from scipy.linalg import expm, logm

from dense_invariant import DenseInvariantEkf, derivative, hat, turning
from random_logs import random_covariance
from slamduel.backends.programs.textbook_ekf import TextbookEkf, wrapped
from slamduel.core.factors import Dataset, Log, Prior, RelativePoses, Step
from slamduel.core.se2 import Array, between, wrap

PLACE, TURN = -10, -11
"""Ids of a kept pose's halves, less twice its step: the textbook filter has pairs of entries only."""


def with_loops(
    rng: np.random.Generator, dataset: Dataset, share: float, *, noise: float = 1.0, errors: float = 1.0
) -> Log:
    """The log with one to three loop closures at a share of its steps, two to the same one among them."""
    steps, poses = list(dataset.log), dataset.truth.poses
    for k in range(2, len(steps)):
        if rng.uniform() > share:
            continue
        to = np.sort(rng.integers(0, k, rng.integers(1, 4)))
        cov = np.array([random_covariance(rng, [0.05 * noise, 0.03 * noise, 0.02 * noise]) for _ in to])
        delta = between(poses[to], poses[k])
        delta += errors * np.array([rng.multivariate_normal(np.zeros(3), one) for one in cov])
        delta[:, 2] = wrap(delta[:, 2])
        steps[k] = steps[k]._replace(loops=RelativePoses(to, delta, cov))
    return Log.from_steps("loops", dataset.log.prior, steps)


def relative(pose: Any, other: Any) -> Any:
    """The pose (3,) in the frame of the other one, its turn not wrapped; complex, too."""
    xy = turning(-other[2]) @ (pose[:2] - other[:2])
    return np.array([xy[0], xy[1], pose[2] - other[2]])


def densest(steps: list[int], now: int) -> int:
    """The step between whose neighbours the fewest steps are."""
    line = [*steps, now]
    apart = {here: after - before for before, here, after in zip(line, line[1:], line[2:], strict=False)}
    return min(apart, key=lambda step: apart[step]) if apart else line[0]


class DelayedEkf(TextbookEkf):
    """The textbook EKF that clones its pose after every step; Jacobians of loop closures by complex steps."""

    def __init__(self, prior: Prior, *, most: int = 0, loop_gate: float = np.inf, **options: Any) -> None:
        super().__init__(prior, **options)
        self.kept: dict[int, Array] = {}  # step -> linearisation point
        self.most, self.loop_gate, self.now, self.left_out = most, loop_gate, 0, 0
        self.predicted = self.mean.copy()

    def predict(self, odometry: Any, t: float = 0.0) -> None:
        super().predict(odometry, t)
        self.predicted = self.mean.copy()

    def step(self, step: Step) -> Array:
        super().step(step)
        self.left_out = 0
        for to, z, R in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
            if to in self.kept:
                self.close(to, z, R)
            else:
                self.left_out += 1
        if self.most and len(self.kept) == self.most:
            dropped = densest(list(self.kept), self.now)
            del self.kept[dropped]
            for half in (PLACE, TURN):
                self.forget(half - 2 * dropped)
        self.clone()
        return self.mean[:3].copy()

    def entries(self, step: int) -> list[int]:
        """Of a kept pose's x, y and heading."""
        at, turn = (3 + 2 * self.ids.index(half - 2 * step) for half in (PLACE, TURN))
        return [at, at + 1, turn]

    def close(self, to: int, z: Array, R: Array) -> None:
        own = self.entries(to)
        expecting = self.predicted if self.together else self.mean
        here, there = expecting[:3], expecting[own]
        if self.jacobians != "standard":
            at_here, at_there = self.there, self.kept[to]
        else:
            at_here, at_there = here, there
        H = np.zeros((3, len(self.mean)))
        H[:, :3] = derivative(lambda d: relative(at_here + d, at_there), 3)
        H[:, own] = derivative(lambda d: relative(at_here, at_there + d), 3)
        innovation = z - relative(here, there)
        if self.together:
            moved = self.mean[: len(expecting)] - expecting
            moved[2] = wrapped(moved[2])
            innovation -= H[:, : len(moved)] @ moved
        innovation[2] = wrapped(innovation[2])
        S = H @ self.cov @ H.T + R
        distance = float(innovation @ np.linalg.inv(S) @ innovation)
        if distance > self.loop_gate:
            self.refused += 1
            return
        K = self.cov @ H.T @ np.linalg.inv(S)
        self.mean = self.mean + K @ innovation
        self.mean[2] = wrapped(self.mean[2])
        self.cov = (np.eye(len(self.mean)) - K @ H) @ self.cov
        self.nis, self.nis_dof = self.nis + distance, self.nis_dof + 3

    def clone(self) -> None:
        n = len(self.mean)
        T = np.zeros((n + 4, n))
        T[:n], T[n : n + 3, :3] = np.eye(n), np.eye(3)
        self.mean, self.cov = T @ self.mean, T @ self.cov @ T.T
        self.ids += [half - 2 * self.now for half in (PLACE, TURN)]
        self.kept[self.now] = self.there.copy()
        self.now += 1

    def pose(self, step: int) -> tuple[Array, Array]:
        """A kept pose (3,) and its covariance (3, 3)."""
        own = self.entries(step)
        pose = self.mean[own]
        return np.array([*pose[:2], wrapped(pose[2])]), self.cov[np.ix_(own, own)]


class DelayedInvariantEkf(DenseInvariantEkf):
    """The paper's filter with kept poses: each a matrix of SE(2) with an error (heading, x, y) of its own."""

    def __init__(self, prior: Prior) -> None:
        super().__init__(prior)
        self.kept: list[Array] = []  # (3, 3)
        self.poses_cov = np.zeros((0, 0))
        self.cross = np.zeros((0, len(self.cov)))  # of kept poses with the rest
        self.loops_nis = 0.0

    def step(self, step: Step) -> Array:
        super().step(step)
        self.loops_nis = 0.0
        for to, z, R in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
            self.close(to, z, R)
        self.kept.append(self.state[:3, :3].copy())
        own = self.cov[:3]
        across = self.cross[:, :3]
        self.poses_cov = np.block([[self.poses_cov, across], [across.T, own[:, :3]]])
        self.cross = np.concatenate((self.cross, own))
        return np.array([*self.state[:2, 2], np.arctan2(self.state[1, 0], self.state[0, 0])])

    def grown(self, J: Array) -> None:
        self.cross = self.cross @ J[:, : self.cross.shape[1]].T

    def update(self, H: Array, nu: Array, R: Array) -> float:
        return self.joint_update(H, np.zeros((len(nu), len(self.poses_cov))), nu, R)

    def joint_update(self, H: Array, Hk: Array, nu: Array, R: Array) -> float:
        """H of pose and landmarks, Hk of the kept poses."""
        n = len(self.cov)
        P = np.block([[self.cov, self.cross.T], [self.cross, self.poses_cov]])
        both = np.concatenate((H, Hk), axis=1)
        S = both @ P @ both.T + R
        K = P @ both.T @ np.linalg.inv(S)
        xi = K @ nu
        self.state = expm(hat(xi[:n])) @ self.state
        self.kept = [expm(hat(xi[n + 3 * k : n + 3 * k + 3])) @ X for k, X in enumerate(self.kept)]
        after = (np.eye(len(P)) - K @ both) @ P
        self.cov, self.cross, self.poses_cov = after[:n, :n], after[n:, :n], after[n:, n:]
        return float(nu @ np.linalg.inv(S) @ nu)

    def close(self, to: int, z: Array, R: Array) -> None:
        here, there = self.state[:3, :3], self.kept[to]

        def xi(error: Any) -> Any:
            """Of the innovation, by the errors of pose and kept pose, and noise; all small."""
            X, Xk = here + hat(error[:3]) @ here, there + hat(error[3:6]) @ there
            Z = np.linalg.inv(Xk) @ X
            Z[:2, 2] += error[6:8]
            Z[:2, :2] = turning(error[8]) @ Z[:2, :2]
            E = there @ Z @ np.linalg.inv(here)
            return np.array([E[1, 0], E[0, 2], E[1, 2]])

        D = derivative(xi, 9)
        Z = np.eye(3)
        Z[:2, :2], Z[:2, 2] = turning(z[2]), z[:2]
        E = np.real(logm(there @ Z @ np.linalg.inv(here)))
        nu = np.array([E[1, 0], E[0, 2], E[1, 2]])
        H, Hk = np.zeros((3, len(self.cov))), np.zeros((3, len(self.poses_cov)))
        H[:, :3], Hk[:, 3 * to : 3 * to + 3] = D[:, :3], D[:, 3:6]
        self.loops_nis += self.joint_update(H, Hk, nu, D[:, 6:] @ R @ D[:, 6:].T)

    def pose(self, step: int) -> tuple[Array, Array]:
        """A kept pose (3,) and its covariance (3, 3) in plain coordinates."""
        X, own = self.kept[step], slice(3 * step, 3 * step + 3)

        def plain(xi: Any) -> Any:
            moved = X + hat(xi) @ X
            return np.array([moved[0, 2], moved[1, 2], xi[0]])

        J = derivative(plain, 3)
        return np.array([*X[:2, 2], np.arctan2(X[1, 0], X[0, 0])]), J @ self.poses_cov[own, own] @ J.T
