"""The invariant EKF of the paper with whole matrices of the group."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

from slamduel.core.factors import Odometry, Prior, Step
from slamduel.core.se2 import Array, wrap


def turning(angle: Any) -> Any:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def hat(xi: Any) -> Any:
    """xi (3 + 2N,) = (heading, position, landmarks) in the Lie algebra of SE_{N+1}(2)."""
    m = (len(xi) - 1) // 2
    out = np.zeros((2 + m, 2 + m), np.result_type(xi))
    out[0, 1], out[1, 0] = -xi[0], xi[0]
    out[:2, 2:] = xi[1:].reshape(m, 2).T
    return out


def derivative(function: Callable[[Any], Any], n: int) -> Array:
    """d function / d x (., n) at zero, by complex steps: exact to rounding."""
    return np.stack([np.imag(function(1e-30j * e)) / 1e-30 for e in np.eye(n)], axis=-1)


class DenseInvariantEkf:
    """RI-EKF SLAM of Zhang et al. (2017) in the plane: the state is a matrix X of the group, the truth exp(xi) X.

    Every Jacobian is the derivative of what the paper differentiates; nothing is simplified.
    """

    def __init__(self, prior: Prior) -> None:
        xy, self.ids = np.zeros((0, 2)), list[int]()
        given = np.zeros((0, 0))
        if prior.map is not None:
            xy, self.ids = prior.map.xy, prior.map.ids.tolist()
            given = np.zeros((xy.size, xy.size)) if prior.map.cov is None else prior.map.cov
        self.state = np.eye(3 + len(xy))
        self.state[:2, :2] = turning(prior.pose[2])
        self.state[:2, 2], self.state[:2, 3:] = prior.pose[:2], xy.T
        plain = np.zeros((3 + xy.size, 3 + xy.size))
        plain[np.ix_([1, 2, 0], [1, 2, 0])] = prior.cov
        plain[3:, 3:] = given
        back = np.linalg.inv(self.plain())
        self.cov = back @ plain @ back.T
        self.nis = 0.0

    def plain(self) -> Array:
        """The plain error of heading, position and landmarks by xi."""
        n = 1 + 2 * (self.state.shape[0] - 2)

        def moved(xi: Any) -> Any:
            X = self.state + hat(xi) @ self.state
            return np.concatenate(([xi[0]], X[:2, 2:].T.ravel()))

        return derivative(moved, n)

    def step(self, step: Step) -> Array:
        if step.odometry is not None:
            self.move(step.odometry)
        self.nis = 0.0
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark in self.ids:
                self.correct(3 + self.ids.index(landmark), z, R)
            else:
                self.add(landmark, z, R)
        return np.array([*self.state[:2, 2], np.arctan2(self.state[1, 0], self.state[0, 0])])

    def move(self, odometry: Odometry) -> None:
        def after(noise: Any) -> Any:
            X = self.state.astype(complex)
            X[:2, 2] += self.state[:2, :2] @ (odometry.delta[:2] + noise[:2])
            X[:2, :2] = self.state[:2, :2] @ turning(odometry.delta[2] + noise[2])
            return X

        X = np.real(after(np.zeros(3)))
        inverse = np.linalg.inv(X)

        def xi(noise: Any) -> Any:  # of what is true in terms of what is predicted
            error = after(noise) @ inverse
            return np.concatenate(([error[1, 0]], error[:2, 2:].T.ravel()))

        G = derivative(xi, 3)
        self.state, self.cov = X, self.cov + G @ odometry.cov @ G.T

    def correct(self, column: int, z: Array, R: Array) -> None:
        def seen(X: Any) -> Any:
            x, y = X[:2, :2].T @ (X[:2, column] - X[:2, 2])
            return np.array([np.sqrt(x * x + y * y), np.arctan(y / x) if abs(x) > abs(y) else -np.arctan(x / y)])

        H = derivative(lambda xi: seen(self.state + hat(xi) @ self.state), len(self.cov))
        x, y = self.state[:2, :2].T @ (self.state[:2, column] - self.state[:2, 2])
        nu = np.array([z[0] - np.hypot(x, y), wrap(z[1] - np.arctan2(y, x))])
        self.nis += self.update(H, nu, R)

    def update(self, H: Array, nu: Array, R: Array) -> float:
        """Corrects by an innovation; returns it squared and normalised."""
        S = H @ self.cov @ H.T + R
        K = self.cov @ H.T @ np.linalg.inv(S)
        self.state = expm(hat(K @ nu)) @ self.state
        self.cov = (np.eye(len(self.cov)) - K @ H) @ self.cov
        return float(nu @ np.linalg.inv(S) @ nu)

    def add(self, landmark: int, z: Array, R: Array) -> None:
        m, n = len(self.state), len(self.cov)

        def grown(error: Any) -> Any:  # xi of what is there, then the sighting's noise
            X = np.eye(m + 1, dtype=complex)
            X[:m, :m] = self.state + hat(error[:n]) @ self.state
            r, bearing = z[0] + error[n], z[1] + error[n + 1]
            X[:2, m] = X[:2, 2] + X[:2, :2] @ np.array([r * np.cos(bearing), r * np.sin(bearing)])
            return X

        X = np.real(grown(np.zeros(n + 2)))
        inverse = np.linalg.inv(X)

        def xi(error: Any) -> Any:
            off = grown(error) @ inverse
            return np.concatenate(([off[1, 0]], off[:2, 2:].T.ravel()))

        J = derivative(xi, n + 2)
        both = np.zeros((n + 2, n + 2))
        both[:n, :n], both[n:, n:] = self.cov, R
        self.state, self.cov = X, J @ both @ J.T
        self.ids.append(landmark)
        self.grown(J)

    def grown(self, J: Array) -> None:
        """For what is correlated with the state, which has become J times itself and noise."""
