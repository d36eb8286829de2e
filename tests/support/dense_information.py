"""The information of a log's factors at the truth, dense, by numerical derivatives: what a bound is to be."""

from collections.abc import Callable, Iterator

import numpy as np

from slamduel.backends.constant_errors import fitted
from slamduel.core.factors import Log, Map
from slamduel.core.partial import RANGE
from slamduel.core.se2 import Array, between, wrap

STEP, VAGUE = 1e-6, 1e-9


def _inverse(cov: Array) -> Array:
    return np.asarray(np.linalg.inv(cov), np.float64)


class DenseInformation:
    """Variables are the poses, the landmarks, a gyro's biases, one for each stretch between two moves, and the constant
    errors: scale, offset (of all ranges), heading."""

    def __init__(self, log: Log, path: Array, landmarks: Map) -> None:
        self.log, self._n = log, len(log)
        self._row = {landmark: k for k, landmark in enumerate(landmarks.ids.tolist())}
        constant = fitted(log, path, landmarks)
        errors = [constant.range_scale[0], constant.range_offset[0], constant.heading_offset]
        moves = 0 if log.gyro is None else 1 + int((log.gyro.walk[1:] > 0).sum())
        self._bias = path.size + landmarks.xy.size
        self._x = np.concatenate((path.ravel(), landmarks.xy.ravel(), np.linspace(0.1, 0.2, moves), errors))

    def covariances(self) -> tuple[Array, Array]:
        """(n, 3, 3) of each pose by the factors up to it, and the joint one by all, poses first."""
        size, online = len(self._x), np.empty((self._n, 3, 3))
        total = VAGUE * np.eye(size)
        for k in range(self._n):
            for factor, weight in self._factors(k):
                J = self._jacobian(factor)
                total += J.T @ weight @ J
            there = np.r_[: 3 * k + 3, 3 * self._n : size]
            online[k] = _inverse(total[np.ix_(there, there)])[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        return online, _inverse(total)

    def _jacobian(self, factor: Callable[[Array], Array]) -> Array:
        columns = []
        for j in range(len(self._x)):
            shift = np.zeros(len(self._x))
            shift[j] = STEP
            change = factor(self._x + shift) - factor(self._x - shift)
            columns.append(np.where(np.abs(change) > 1, wrap(change), change) / (2 * STEP))
        return np.array(columns).T

    def _pose(self, x: Array, k: int) -> Array:
        return x[3 * k : 3 * k + 3]

    def _seen(self, x: Array, k: int, landmark: int) -> Array:
        at = 3 * self._n + 2 * self._row[landmark]
        dx, dy = x[at : at + 2] - x[3 * k : 3 * k + 2]
        return np.array((np.hypot(dx, dy), np.arctan2(dy, dx) - x[3 * k + 2]))

    def _factors(self, k: int) -> Iterator[tuple[Callable[[Array], Array], Array]]:
        """Yields each factor of step k as a function of all variables, and its weight."""
        log, step = self.log, self.log[k]
        if k == 0:
            yield lambda x: self._pose(x, 0), _inverse(log.prior.cov)
            sds = np.maximum(log.prior.systematic[:3], STEP)
            yield lambda x: x[-3:], np.diag(1 / sds**2)
            if log.prior.map is not None and log.prior.map.cov is not None:
                first = 3 * self._n + 2 * np.array([self._row[i] for i in log.prior.map.ids.tolist()])
                there = (first[:, None] + np.arange(2)).ravel()
                yield lambda x: x[there], _inverse(log.prior.map.cov)
        else:
            yield lambda x: between(self._pose(x, k - 1), self._pose(x, k)), _inverse(log.delta_cov[k])
            yield from self._turned(k)
        for landmark, cov in zip(step.sightings.ids.tolist(), step.sightings.cov, strict=True):
            yield lambda x, i=landmark: self._seen(x, k, i), _inverse(cov)
        for to, cov in zip(step.loops.to.tolist(), step.loops.cov, strict=True):
            yield lambda x, i=to: between(self._pose(x, i), self._pose(x, k)), _inverse(cov)
        for landmark, kind, var in zip(step.partial.ids.tolist(), step.partial.kind, step.partial.var, strict=True):
            if kind == RANGE:
                yield lambda x, i=landmark: (1 + x[-3]) * self._seen(x, k, i)[:1] + x[-2], np.eye(1) / float(var)
            else:
                yield lambda x, i=landmark: self._seen(x, k, i)[1:], np.eye(1) / float(var)
        for z, cov, arm in zip(*step.fixes, strict=True):
            measured = ~np.isnan(z)
            weight = _inverse(cov[np.ix_(measured, measured)])
            yield lambda x, a=arm, on=measured: self._fix(x, k, a)[on], weight

    def _turned(self, k: int) -> Iterator[tuple[Callable[[Array], Array], Array]]:
        """Yields those of step k's turn by the gyro: of the bias, which begins or has moved, and of the turn itself."""
        gyro, step = self.log.gyro, self.log[k]
        if gyro is None or step.gyro is None:
            return
        _, var, dt, walk = step.gyro
        at = self._bias + int((gyro.walk[1:][gyro.step[1:] <= k] > 0).sum())
        if k == gyro.step[0]:
            yield lambda x: x[at : at + 1], np.eye(1) / (gyro.prior.sd**2 + walk)
        elif walk > 0:
            yield lambda x: x[at : at + 1] - x[at - 1 : at], np.eye(1) / walk
        yield lambda x: x[3 * k + 2, None] - x[3 * k - 1, None] + dt * x[at, None], np.eye(1) / var

    def _fix(self, x: Array, k: int, arm: Array) -> Array:
        px, py, heading = self._pose(x, k)
        c, s = np.cos(heading), np.sin(heading)
        return np.array((px + c * arm[0] - s * arm[1], py + s * arm[0] + c * arm[1], heading + x[-1]))
