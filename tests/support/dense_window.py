"""A textbook fixed-lag smoother: dense normal equations and Schur complements, relinearised once per step."""

from typing import NamedTuple

import numpy as np

from dense_fit import Normal, sighted
from motions import between_jacobians
from slamduel.core.factors import Prior, Step
from slamduel.core.se2 import Array, between, compose, wrap

Key = tuple[str, int, int]
"""A pose ("x", step, 0), or a landmark ("l", id, number of times it has left)."""


class Factor(NamedTuple):
    first: Key  # a pose
    second: Key  # the next one, or a landmark
    z: Array
    cov: Array


class DenseWindow:
    """Landmarks start at their first sighting, and a given map has its covariance.

    A variable that shares a factor with one that has left is not relinearised. Nothing is shared with the backend.
    """

    def __init__(self, prior: Prior, lag: float) -> None:
        self.lag, self.here = lag, dict[Key, Array]()  # linearisation points
        self.left: list[tuple[Array, Array]] = []  # poses that have left, with their covariances
        self.gone: dict[int, Array] = {}  # landmarks, at their position when they last left
        self._off, self._cov = dict[Key, Array](), np.zeros((0, 0))
        self._prior, self._start = prior, [("x", 0, 0)]
        self._factors: list[Factor] = []
        self._times: dict[Key, float] = {}  # of poses, and of the landmarks' last sightings
        self._returns: dict[int, int] = {}
        self._stay: set[Key] = set()
        self._known: tuple[list[Key], Array, Array, Array] = ([], np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        blocks, mean = [prior.cov], [prior.pose]
        if prior.map is not None and prior.map.cov is not None:
            blocks.append(prior.map.cov)
            mean.append(prior.map.xy.ravel())
            self._start += [("l", i, 0) for i in prior.map.ids.tolist()]
            self.here |= {("l", i, 0): xy.copy() for i, xy in zip(prior.map.ids.tolist(), prior.map.xy, strict=True)}
        information = np.zeros((sum(map(len, blocks)),) * 2)
        at = 0
        for block in blocks:
            information[at : at + len(block), at : at + len(block)] = np.linalg.inv(block)
            at += len(block)
        self._known = self._start, information, np.zeros(at), np.concatenate(mean)
        self._pose, self._count = prior.pose, 0

    def step(self, step: Step) -> tuple[Array, Array]:
        """Processes a step; returns the latest pose and its covariance."""
        k = self._count
        self._count += 1
        names = [self._name(i) for i in step.sightings.ids.tolist()]
        for name in names:
            if name not in self._start:
                self._times[name] = step.t
        self._let_go(step.t - self.lag)
        if step.odometry is not None:
            self._pose = compose(self._pose, step.odometry.delta)
            self._factors.append(Factor(("x", k - 1, 0), ("x", k, 0), *step.odometry))
        self.here["x", k, 0], self._times["x", k, 0] = self._pose, step.t
        for name, z, cov in zip(names, step.sightings.z, step.sightings.cov, strict=True):
            if name not in self.here:
                angle = self._pose[2] + z[1]
                self.here[name] = self._pose[:2] + z[0] * np.array([np.cos(angle), np.sin(angle)])
            self._factors.append(Factor(("x", k, 0), name, z, cov))
        self._solve()
        for key, off in self._off.items():
            if key not in self._stay:
                self.here[key] = _moved(self.here[key], off)
        self._solve()
        self._pose, cov = self.estimate(("x", k, 0))
        return self._pose, cov

    def estimate(self, key: Key) -> tuple[Array, Array]:
        """A variable's estimate and covariance."""
        at, n = self._columns()[key], len(self.here[key])
        return _moved(self.here[key], self._off[key]), self._cov[at : at + n, at : at + n]

    def inside(self) -> dict[int, Array]:
        """Positions of the landmarks in the window."""
        return {key[1]: self.estimate(key)[0] for key in self.here if key[0] == "l"}

    def _name(self, landmark: int) -> Key:
        return ("l", landmark, self._returns.get(landmark, 0))

    def _columns(self) -> dict[Key, int]:
        ends = np.cumsum([0, *(len(x) for x in self.here.values())])
        return dict(zip(self.here, ends.tolist(), strict=False))

    def _sum(self, factors: list[Factor]) -> Normal:
        """The normal equations of some factors and of the prior."""
        column = self._columns()
        normal = Normal(sum(len(x) for x in self.here.values()))
        keys, information, right, there = self._known
        rows = np.concatenate([column[key] + np.arange(len(self.here[key])) for key in keys])
        off = np.concatenate([self.here[key] for key in keys]) - there
        if keys[0][0] == "x":
            off[2] = wrap(off[2])  # of the prior at step 0 alone: later ones keep their linearisation point
        normal.matrix[np.ix_(rows, rows)] += information
        normal.right[rows] += right - information @ off
        for first, second, z, cov in factors:
            a, b = self.here[first], self.here[second]
            if second[0] == "x":
                e, (by_a, by_b) = between(a, b) - z, between_jacobians(a, b)
                e[2] = wrap(e[2])
            else:
                e, by_a, by_b = sighted(a, b, z)
            normal.add([(column[first], by_a), (column[second], by_b)], e, cov)
        return normal

    def _solve(self) -> None:
        normal, column = self._sum(self._factors), self._columns()
        self._cov = np.asarray(np.linalg.inv(normal.matrix), np.float64)
        change = self._cov @ normal.right
        self._off = {key: change[at : at + len(self.here[key])] for key, at in column.items()}

    def _let_go(self, before: float) -> None:
        leaving = [key for key, t in self._times.items() if t < before]
        if not leaving:
            return
        for key in sorted(leaving):
            if key[0] == "x":
                self.left.append(self.estimate(key))
            else:
                self.gone[key[1]] = self.estimate(key)[0]
                self._returns[key[1]] = self._returns.get(key[1], 0) + 1
        used = [factor for factor in self._factors if factor.first in leaving]
        normal, column = self._sum(used), self._columns()
        touched = {*self._known[0], *(key for factor in used for key in factor[:2])} - set(leaving)
        self._stay |= {key for factor in used for key in factor[:2]}
        keys = [key for key in self.here if key in touched]
        keep, drop = (
            np.concatenate([column[key] + np.arange(len(self.here[key])) for key in some]) for some in (keys, leaving)
        )
        gain = np.linalg.solve(normal.matrix[np.ix_(drop, drop)], normal.matrix[np.ix_(drop, keep)]).T
        information = normal.matrix[np.ix_(keep, keep)] - gain @ normal.matrix[np.ix_(drop, keep)]
        right = normal.right[keep] - gain @ normal.right[drop]
        self._known = keys, information, right, np.concatenate([self.here[key] for key in keys])
        self._factors = [factor for factor in self._factors if factor.first not in leaving]
        for key in leaving:
            del self.here[key], self._times[key]


def _moved(at: Array, off: Array) -> Array:
    """A pose or a landmark, moved by an offset."""
    out = at + off
    if len(out) == 3:
        out[2] = wrap(out[2])
    return out
