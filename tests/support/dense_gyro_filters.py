"""The unscented and the invariant filter with a gyro's bias in their state, dense and written out."""

from typing import Any

import numpy as np
from scipy.linalg import expm

from dense_delayed import DelayedInvariantEkf
from dense_invariant import DenseInvariantEkf, derivative, hat, turning
from dense_ukf import DenseUkf
from slamduel.backends.unscented.ukf import Options
from slamduel.core.factors import Log, Odometry, Step
from slamduel.core.gyro import Turn
from slamduel.core.se2 import Array, compose, wrap

NOBODY = -99
"""The id of the pair that the bias is the first of."""


def conditioned(mean: Array, cov: Array, turn: Turn, bias: int, step: int) -> tuple[Array, Array]:
    """A Gaussian given a turn, the entry `step` plus `bias` times dt plus noise: its move, and covariance."""
    row = np.zeros(len(mean))
    row[bias], row[step] = turn.dt, 1.0
    gain = cov @ row / (row @ cov @ row + turn.var)
    return gain * float(wrap(np.array(turn.turn - row @ mean))), cov - np.outer(gain, row @ cov)


class GyroUkf(DenseUkf):
    """The bias is the first of a pair between pose and landmarks, whose second one nothing depends on."""

    def __init__(self, log: Log, options: Options) -> None:
        super().__init__(log.prior, options)
        assert log.prior.gyro is not None
        self.mean = np.concatenate((self.mean, [log.prior.gyro.mean, 0.0]))
        cov = np.zeros((5, 5))
        cov[:3, :3], cov[3, 3], cov[4, 4] = self.cov, log.prior.gyro.sd**2, 1.0
        self.cov, self.ids, self.turn = cov, [NOBODY], None

    def step(self, step: Step) -> Array:
        self.turn = step.gyro
        return super().step(step)

    def move(self, odometry: Odometry) -> None:
        if self.turn is None:
            super().move(odometry)
            return
        n = len(self.mean)
        self.cov[3, 3] += self.turn.walk
        mean, cov = np.concatenate((self.mean, odometry.delta)), self.widened(odometry.cov)
        move, cov = conditioned(mean, cov, self.turn, 3, n + 2)

        def model(x: Array) -> Array:
            return np.hstack((compose(x[:, :3], x[:, n:]), x[:, 3:n]))

        self.mean, self.cov, _ = self.transform(model, 2, mean + move, cov, [0, 1, 2, n, n + 1, n + 2])


class GyroInvariant(DelayedInvariantEkf):
    """The bias is beside the group."""

    def __init__(self, log: Log) -> None:
        super().__init__(log.prior)
        assert log.prior.gyro is not None
        self.bias, self.turn = log.prior.gyro.mean, None
        self.poses_cov = np.array([[log.prior.gyro.sd**2]])
        self.cross = np.zeros((1, len(self.cov)))

    def step(self, step: Step) -> Array:
        self.turn = step.gyro
        return DenseInvariantEkf.step(self, step)

    def joint_update(self, H: Array, Hk: Array, nu: Array, R: Array) -> float:
        both, P = np.concatenate((H, Hk), axis=1), self.joint()
        S = both @ P @ both.T + R
        K = P @ both.T @ np.linalg.inv(S)
        self.moved(K @ nu, P - K @ both @ P)
        return float(nu @ np.linalg.inv(S) @ nu)

    def joint(self) -> Array:
        return np.block([[self.cov, self.cross.T], [self.cross, self.poses_cov]])

    def moved(self, xi: Array, P: Array) -> None:
        n = len(self.cov)
        self.state = expm(hat(xi[:n])) @ self.state
        self.bias += xi[n]
        self.cov, self.cross, self.poses_cov = P[:n, :n], P[n:, :n], P[n:, n:]

    def move(self, odometry: Odometry) -> None:
        if self.turn is None:
            super().move(odometry)
            return
        n = len(self.cov)
        self.poses_cov[0, 0] += self.turn.walk
        joint = np.zeros((n + 4, n + 4))
        joint[: n + 1, : n + 1], joint[n + 1 :, n + 1 :] = self.joint(), odometry.cov
        mean = np.concatenate((np.zeros(n), [self.bias], odometry.delta))
        move, joint = conditioned(mean, joint, self.turn, n, n + 3)
        self.moved(move[: n + 1], joint[: n + 1, : n + 1])
        delta = odometry.delta + move[n + 1 :]

        def after(noise: Any) -> Any:
            X = self.state.astype(complex)
            X[:2, 2] += self.state[:2, :2] @ (delta[:2] + noise[:2])
            X[:2, :2] = self.state[:2, :2] @ turning(delta[2] + noise[2])
            return X

        X = np.real(after(np.zeros(3)))
        inverse = np.linalg.inv(X)

        def xi(noise: Any) -> Any:
            error = after(noise) @ inverse
            return np.concatenate(([error[1, 0]], error[:2, 2:].T.ravel()))

        T = np.zeros((n + 1, n + 4))
        T[:, : n + 1], T[:n, n + 1 :] = np.eye(n + 1), derivative(xi, 3)
        self.state = X
        self.moved(np.zeros(n + 1), T @ joint @ T.T)
