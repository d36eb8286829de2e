"""The UKF over the whole state and the noise."""

from collections.abc import Callable

import numpy as np

from slamduel.backends.unscented.ukf import Options
from slamduel.core.factors import Odometry, Prior, Step
from slamduel.core.se2 import Array, compose, wrap


class DenseUkf:
    """The scaled UKF as Wan and van der Merwe print it, over the whole state (x, y, heading, landmarks) and the noise.

    The whole has more dimensions than a model touches, so kappa is made smaller by as many: then alpha^2 (dims +
    kappa), and with it how far out the points lie, is that of a filter which samples the touched dimensions alone. With
    the touched dimensions first in the Cholesky factor the other points see nothing of the model's curvature.
    """

    def __init__(self, prior: Prior, options: Options) -> None:
        self.options = options
        self.mean, self.cov, self.ids = np.array(prior.pose), np.array(prior.cov), list[int]()
        if prior.map is not None:
            n = 3 + 2 * len(prior.map.ids)
            cov = np.zeros((n, n))
            cov[:3, :3], cov[3:, 3:] = prior.cov, prior.map.cov
            self.mean, self.cov, self.ids = (
                np.concatenate((prior.pose, prior.map.xy.ravel())),
                cov,
                prior.map.ids.tolist(),
            )
        self.nis = 0.0

    def transform(
        self, model: Callable[[Array], Array], angle: int, mean: Array, cov: Array, touched: list[int]
    ) -> tuple[Array, Array, Array]:
        """Mean, covariance and cross-covariance with x of model(x) (points, .), whose column `angle` is one."""
        alpha, beta, kappa = self.options.alpha, self.options.beta, self.options.kappa
        n = len(mean)
        lam = alpha**2 * (n + (len(touched) + kappa - n)) - n
        order = touched + [i for i in range(n) if i not in touched]
        root = np.empty((n, n))
        root[order] = np.linalg.cholesky(cov[np.ix_(order, order)])
        off = np.sqrt(n + lam) * np.concatenate((np.zeros((1, n)), root.T, -root.T))
        first = np.full(2 * n + 1, 1 / (2 * (n + lam)))
        first[0] = lam / (n + lam)
        second = first.copy()
        second[0] += 1 - alpha**2 + beta
        y = model(mean + off)
        away = y - y[0]
        away[:, angle] = wrap(away[:, angle])
        shift = first @ away
        away -= shift
        out = y[0] + shift
        out[angle] = wrap(out[angle])
        return out, (away.T * second) @ away, (off.T * second) @ away

    def step(self, step: Step) -> Array:
        if step.odometry is not None:
            self.move(step.odometry)
        self.nis = 0.0
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark in self.ids:
                self.correct(landmark, z, R)
            else:
                self.add(landmark, z, R)
        return self.mean[:3].copy()

    def widened(self, cov: Array) -> Array:
        n, m = len(self.mean), len(cov)
        both = np.zeros((n + m, n + m))
        both[:n, :n], both[n:, n:] = self.cov, cov
        return both

    def move(self, odometry: Odometry) -> None:
        n = len(self.mean)
        mean = np.concatenate((self.mean, odometry.delta))

        def model(x: Array) -> Array:
            return np.hstack((compose(x[:, :3], x[:, n:]), x[:, 3:n]))

        touched = [0, 1, 2, n, n + 1, n + 2]
        self.mean, self.cov, _ = self.transform(model, 2, mean, self.widened(odometry.cov), touched)

    def correct(self, landmark: int, z: Array, R: Array) -> None:
        j = 3 + 2 * self.ids.index(landmark)

        def model(x: Array) -> Array:
            dx, dy = x[:, j] - x[:, 0], x[:, j + 1] - x[:, 1]
            return np.stack((np.hypot(dx, dy), np.arctan2(dy, dx) - x[:, 2]), axis=1)

        expected, spread, cross = self.transform(model, 1, self.mean, self.cov, [0, 1, 2, j, j + 1])
        S = spread + R
        nu = z - expected
        nu[1] = wrap(nu[1])
        K = cross @ np.linalg.inv(S)
        self.mean = self.mean + K @ nu
        self.mean[2] = wrap(self.mean[2])
        self.cov = self.cov - K @ S @ K.T
        self.nis += nu @ np.linalg.inv(S) @ nu

    def add(self, landmark: int, z: Array, R: Array) -> None:
        n = len(self.mean)

        def model(x: Array) -> Array:
            r, angle = x[:, n], x[:, 2] + x[:, n + 1]
            xy = np.stack((x[:, 0] + r * np.cos(angle), x[:, 1] + r * np.sin(angle)), axis=1)
            return np.hstack((x[:, :n], xy))

        mean = np.concatenate((self.mean, z))
        self.mean, self.cov, _ = self.transform(model, 2, mean, self.widened(R), [0, 1, 2, n, n + 1])
        self.ids.append(landmark)
