"""An EKF with partial sightings, fixes and late starts, dense and written out, to compare the compiled one with."""

from typing import NamedTuple

import numpy as np

from slamduel.backends.gaussian.late_starts import FURTHER, MOST
from slamduel.backends.placing import placed
from slamduel.core.factors import Log
from slamduel.core.partial import RANGE
from slamduel.core.se2 import Array, wrap


def _wrapped(angle: float) -> float:
    return float(wrap(np.array(angle)))


class _Wait(NamedTuple):
    pose: int  # first of its three entries
    kind: int
    z: float
    var: float
    way: float


class DensePartial:
    """The state is (x, y, heading, scale, then kept poses and landmarks as they come)."""

    def __init__(self, log: Log) -> None:
        self.x = np.concatenate((log.prior.pose, [0.0]))
        self.cov = np.zeros((4, 4))
        self.cov[:3, :3] = log.prior.cov
        self.cov[3, 3] = log.prior.systematic.range_scale**2
        self.at: dict[int, int] = {}
        self.wait: dict[int, list[_Wait]] = {}
        self.tried: dict[int, float] = {}
        self.way = 0.0

    def run(self, log: Log) -> tuple[Array, Array]:
        """The path (n, 3), and the covariances (n, 3, 3)."""
        path, covs = [], []
        for step in log:
            if step.odometry is not None:
                self._move(step.odometry.delta, step.odometry.cov)
            for z, cov, arm in zip(*step.fixes, strict=True):
                self._fix(z, cov, arm)
            held = []
            for landmark, kind, z, var in zip(*step.partial, strict=True):
                if landmark in self.at:
                    h, expected = self._row(0, self.at[landmark], kind, self.x)
                    off = z - expected if kind == RANGE else _wrapped(z - expected)
                    self._correct(h[None], np.array([off]), np.array([[var]]))
                else:
                    held.append((landmark, kind, z, var))
            if held:
                first = self._clone()
                for landmark, kind, z, var in held:
                    self.wait.setdefault(landmark, []).append(_Wait(first, kind, z, var, self.way))
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
        self.way += float(np.hypot(delta[0], delta[1]))

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
        held = self.wait[landmark]
        if len(held) > MOST:
            ways = np.array([one.way for one in held])
            held.pop(1 + int(np.argmin(ways[2:] - ways[:-2])))
        way = self.way - held[0].way
        if len(held) < 2 or way < (1 + FURTHER) * self.tried.get(landmark, 0.0):
            return
        self.tried[landmark] = way
        var, z, last = [], [], held[-1].pose
        for one in held:
            D = np.zeros((3, len(self.x)))
            D[:, one.pose : one.pose + 3] += np.eye(3)
            D[:, last : last + 3] -= np.eye(3)
            between = D @ self.cov @ D.T
            ranges = one.kind == RANGE
            var.append(one.var + ((between[0, 0] + between[1, 1]) / 2 if ranges else between[2, 2]))
            z.append(one.z / (1 + self.x[3]) if ranges else one.z)
        poses = np.array([self.x[one.pose : one.pose + 3] for one in held])
        place = placed(poses, np.array([one.kind for one in held]), np.array(z), np.array(var))
        if place is None or not place.sure:
            return
        loose = 1e8 * np.trace(place.cov) * np.eye(2)
        at = self.at[landmark] = self._grow(place.xy, np.zeros((2, len(self.x))), loose)
        rows = [self._row(one.pose, at, one.kind, self.x) for one in held]
        off = [one.z - e if one.kind == RANGE else _wrapped(one.z - e) for one, (_, e) in zip(held, rows, strict=True)]
        self._correct(np.array([h for h, _ in rows]), np.array(off), np.diag([one.var for one in held]))
        del self.wait[landmark]
