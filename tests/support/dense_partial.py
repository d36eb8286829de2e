"""Filters with partial sightings, fixes and late starts, dense and written out, to compare the compiled ones with."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slamduel.backends.gaussian.late_starts import FURTHER, MOST
from slamduel.backends.starting.placing import Place, placed
from slamduel.core.factors import Log
from slamduel.core.partial import RANGE
from slamduel.core.se2 import Array, wrap


def _wrapped(angle: float) -> float:
    return float(wrap(np.array(angle)))


class Wait(NamedTuple):
    """A sighting that waits."""

    pose: int  # the filter's number of its kept pose
    kind: int
    z: float
    var: float
    way: float


class Waiting:
    """What waits of each landmark, and when it is placed."""

    def __init__(self) -> None:
        self.of: dict[int, list[Wait]] = {}
        self.tried: dict[int, float] = {}
        self.way = 0.0

    def add(self, landmark: int, pose: int, kind: int, z: float, var: float) -> None:
        self.of.setdefault(landmark, []).append(Wait(pose, kind, z, var, self.way))

    def placed(
        self, landmark: int, scale: float, poses_of: Callable[[list[int]], tuple[Array, Array]]
    ) -> tuple[list[Wait], Place] | None:
        """Its sightings and its place, if that is sure by poses (k, 3) with covariance (3k, 3k) in the world."""
        held = self.of[landmark]
        if len(held) > MOST:
            ways = np.array([one.way for one in held])
            held.pop(1 + int(np.argmin(ways[2:] - ways[:-2])))
        way = self.way - held[0].way
        if len(held) < 2 or way < (1 + FURTHER) * self.tried.get(landmark, 0.0):
            return None
        self.tried[landmark] = way
        poses, cov = poses_of([one.pose for one in held])
        last, D = poses[-1], np.zeros_like(cov)
        for i, pose in enumerate(poses):
            across, along = last[1] - pose[1], pose[0] - last[0]
            D[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += np.eye(3)
            D[3 * i : 3 * i + 3, -3:] -= [[1, 0, across], [0, 1, along], [0, 0, 1]]
        z = np.array([one.z / (1 + scale) if one.kind == RANGE else one.z for one in held])
        kind, var = np.array([one.kind for one in held]), np.array([one.var for one in held])
        place = placed(poses, kind, z, var, D @ cov @ D.T)
        if place is None or not place.sure:
            return None
        del self.of[landmark]
        return held, place


class DensePartial:
    """The state is (x, y, heading, scale, then kept poses and landmarks as they come)."""

    def __init__(self, log: Log) -> None:
        self.x = np.concatenate((log.prior.pose, [0.0]))
        self.cov = np.zeros((4, 4))
        self.cov[:3, :3] = log.prior.cov
        self.cov[3, 3] = log.prior.systematic.range_scale**2
        self.at: dict[int, int] = {}
        self.wait = Waiting()

    def run(self, log: Log) -> tuple[Array, Array]:
        """The path (n, 3), and the covariances (n, 3, 3)."""
        path, covs = [], []
        for step in log:
            if step.odometry is not None:
                self.wait.way += float(np.hypot(*step.odometry.delta[:2]))
                self._move(step.odometry.delta, step.odometry.cov)
            for z, cov, arm in zip(*step.fixes, strict=True):
                self._fix(z, cov, arm)
            held = []
            for landmark, kind, z, var in zip(*step.partial, strict=True):
                if landmark in self.at:
                    self._see(self.at[landmark], kind, z, var)
                else:
                    held.append((landmark, kind, z, var))
            if held:
                first = self._clone()
                for landmark, kind, z, var in held:
                    self.wait.add(landmark, first, kind, z, var)
                    self._try(landmark)
            path.append(self.x[:3].copy())
            covs.append(self.cov[:3, :3].copy())
        return np.array(path), np.array(covs)

    def _move(self, delta: Array, cov: Array) -> None:
        c, s = np.cos(self.x[2]), np.sin(self.x[2])
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        d = R @ delta
        F = np.eye(len(self.x))
        F[0, 2], F[1, 2] = -d[1], d[0]
        self.x[:3] += d
        self.x[2] = _wrapped(self.x[2])
        self.cov = F @ self.cov @ F.T
        self.cov[:3, :3] += R @ cov @ R.T

    def _see(self, at: int, kind: int, z: float, var: float) -> None:
        h, expected = self._row(0, at, kind, self.x)
        off = z - expected if kind == RANGE else _wrapped(z - expected)
        self._correct(h[None], np.array([off]), np.array([[var]]))

    def _correct(self, H: Array, off: Array, R: Array) -> None:
        S = H @ self.cov @ H.T + R
        K = np.linalg.solve(S, H @ self.cov).T
        self.x = self.x + K @ off
        self.x[2] = _wrapped(self.x[2])
        self.cov = self.cov - K @ S @ K.T
        self.cov = (self.cov + self.cov.T) / 2

    def _row(self, pose: int, at: int, kind: int, x: Array) -> tuple[Array, float]:
        d = x[at : at + 2] - x[pose : pose + 2]
        r = np.hypot(*d)
        h = np.zeros(len(x))
        if kind == RANGE:
            h[at : at + 2], h[3] = (1 + x[3]) * d / r, r
            h[pose : pose + 2] = -h[at : at + 2]
            return h, float((1 + x[3]) * r)
        h[at : at + 2] = [-d[1] / r**2, d[0] / r**2]
        h[pose : pose + 2], h[pose + 2] = -h[at : at + 2], -1
        return h, _wrapped(np.arctan2(d[1], d[0]) - x[pose + 2])

    def _fix(self, z: Array, cov: Array, arm: Array) -> None:
        c, s = np.cos(self.x[2]), np.sin(self.x[2])
        a = np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
        H = np.zeros((3, len(self.x)))
        H[:, :3] = [[1, 0, -a[1]], [0, 1, a[0]], [0, 0, 1]]
        off = z - np.concatenate((self.x[:2] + a, self.x[2:3]))
        off[2] = _wrapped(off[2])
        has = ~np.isnan(z)
        self._correct(H[has], off[has], cov[np.ix_(has, has)])

    def _grow(self, values: Array, rows: Array, own: Array) -> int:
        n = len(self.x)
        self.x = np.concatenate((self.x, values))
        self.cov = np.block([[self.cov, rows.T], [rows, own]])
        return n

    def _clone(self) -> int:
        return self._grow(self.x[:3], self.cov[:3], self.cov[:3, :3])

    def _try(self, landmark: int) -> None:
        def poses(kept: list[int]) -> tuple[Array, Array]:
            entries = np.add.outer(np.array(kept, np.int64), np.arange(3)).ravel()
            return self.x[entries].reshape(-1, 3), self.cov[np.ix_(entries, entries)]

        found = self.wait.placed(landmark, self.x[3], poses)
        if found is None:
            return
        held, place = found
        loose = 1e8 * np.trace(place.cov) * np.eye(2)
        at = self.at[landmark] = self._grow(place.xy, np.zeros((2, len(self.x))), loose)
        rows = [self._row(one.pose, at, one.kind, self.x) for one in held]
        off = [one.z - e if one.kind == RANGE else _wrapped(one.z - e) for one, (_, e) in zip(held, rows, strict=True)]
        self._correct(np.array([h for h, _ in rows]), np.array(off), np.diag([one.var for one in held]))


class DenseUnscentedPartial(DensePartial):
    """The same with the unscented transform as Wan and van der Merwe print it, alpha 1, kappa 0, beta 2.

    Its points are over the entries that a model touches; the rest follows by its covariance with these.
    """

    def _transform(
        self, model: Callable[[Array], Array], mean: Array, cov: Array, angles: list[bool]
    ) -> tuple[Array, Array, Array]:
        """Mean, covariance, and cross-covariance with x, of model(x)."""
        n = len(mean)
        root = np.sqrt(n) * np.linalg.cholesky(cov)
        points = np.concatenate((mean[None], mean + root.T, mean - root.T))
        weight = np.full(2 * n + 1, 1 / (2 * n))
        weight[0] = 0.0
        y = np.array([model(x) for x in points])
        away = y - y[0]
        away[:, angles] = wrap(away[:, angles])
        shift = weight @ away
        weight[0] = 2.0
        return y[0] + shift, (away - shift).T * weight @ (away - shift), (points - mean).T * weight @ (away - shift)

    def _move(self, delta: Array, cov: Array) -> None:
        def model(x: Array) -> Array:
            c, s = np.cos(x[2]), np.sin(x[2])
            return x[:3] + np.array([c * x[3] - s * x[4], s * x[3] + c * x[4], x[5]])

        both = np.zeros((6, 6))
        both[:3, :3], both[3:, 3:] = self.cov[:3, :3], cov
        after, own, across = self._transform(model, np.concatenate((self.x[:3], delta)), both, [False, False, True])
        A = np.linalg.solve(self.cov[:3, :3], across[:3]).T
        self.x[:3] = after
        self.x[2] = _wrapped(after[2])
        self.cov[:3, 3:] = A @ self.cov[:3, 3:]
        self.cov[3:, :3] = self.cov[:3, 3:].T
        self.cov[:3, :3] = own

    def _measure(
        self, model: Callable[[Array], Array], touched: list[int], z: Array, R: Array, angles: list[bool]
    ) -> None:
        P = self.cov[np.ix_(touched, touched)]
        expected, spread, across = self._transform(model, self.x[touched], P, angles)
        S = spread + R
        K = self.cov[:, touched] @ np.linalg.solve(P, across) @ np.linalg.inv(S)
        off = z - expected
        off[angles] = wrap(off[angles])
        self.x = self.x + K @ off
        self.x[2] = _wrapped(self.x[2])
        self.cov = self.cov - K @ S @ K.T

    def _see(self, at: int, kind: int, z: float, var: float) -> None:
        def model(x: Array) -> Array:
            dx, dy = x[3:5] - x[:2]
            scale = 1 + x[5] if len(x) > 5 else 1.0
            return np.array([scale * np.hypot(dx, dy) if kind == RANGE else np.arctan2(dy, dx) - x[2]])

        touched = [0, 1, 2, at, at + 1, *([3] if kind == RANGE and self.cov[3, 3] > 0 else [])]
        self._measure(model, touched, np.array([z]), np.array([[var]]), [kind != RANGE])

    def _fix(self, z: Array, cov: Array, arm: Array) -> None:
        has = ~np.isnan(z)

        def model(x: Array) -> Array:
            c, s = np.cos(x[2]), np.sin(x[2])
            return (x + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], 0]))[has]

        self._measure(model, [0, 1, 2], z[has], cov[np.ix_(has, has)], np.array([False, False, True])[has].tolist())
