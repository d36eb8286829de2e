"""What is expected to be seen, worked out from a joint covariance with difference Jacobians."""

from collections.abc import Callable

import numpy as np

from dense_fit import dense_fit
from slamduel.backends.api import Expected
from slamduel.core.factors import Log, Odometry, RangeBearing
from slamduel.core.se2 import Array, compose, wrap


def differences(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences, (m, n)."""
    columns = [(function(at + e) - function(at - e)) / (2 * step) for e in step * np.eye(len(at))]
    return np.array(columns).T


def expected_of(mean: Array, cov: Array, odometry: Odometry | None) -> tuple[Array, Array]:
    """Expected sightings (n, 2) and their joint covariance, for a state of a pose and n landmarks, after a motion."""
    n = (len(mean) - 3) // 2
    delta, noise = (np.zeros(3), np.zeros((3, 3))) if odometry is None else (odometry.delta, odometry.cov)
    whole = np.concatenate((mean, delta))
    joint = np.zeros((len(whole), len(whole)))
    joint[: len(mean), : len(mean)], joint[len(mean) :, len(mean) :] = cov, noise

    def seen(state: Array) -> Array:
        pose = compose(state[:3], state[-3:])
        away = state[3:-3].reshape(n, 2) - pose[:2]
        return np.column_stack((np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0]) - pose[2]))

    z = seen(whole)

    def offsets(state: Array) -> Array:
        off = seen(state) - z
        off[:, 1] = wrap(off[:, 1])
        return off.ravel()

    H = differences(offsets, whole)
    z[:, 1] = wrap(z[:, 1])
    return z, H @ joint @ H.T


def batch_state(log: Log, path: Array, places: dict[int, Array], steps: int) -> tuple[list[int], Array, Array]:
    """Ids, mean and covariance of the last pose and all landmarks, by inverting the information of the first steps."""
    head = log.head(steps)
    sighted = dict.fromkeys(head.ids.tolist())
    found = dense_fit(head, path[:steps], {i: places[i] for i in sighted}, iterations=0)
    rows = np.r_[3 * steps - 3 : 3 * steps, 3 * steps : len(found.cov)]
    mean = np.concatenate((path[steps - 1], *found.xy.values()))
    return list(found.xy), mean, found.cov[np.ix_(rows, rows)]


def ordered(found: Expected, ids: list[int]) -> tuple[Array, Array]:
    """The expected sightings and their covariance in the order of `ids`, which are all there."""
    assert sorted(found.ids.tolist()) == sorted(ids)
    row = [found.ids.tolist().index(i) for i in ids]
    entries = np.array([2 * r + a for r in row for a in (0, 1)], int)
    return found.z[row], found.cov[np.ix_(entries, entries)]


ANYWHERE = RangeBearing(np.array([-1]), np.array([[5.0, 0.0]]), np.array([[[1.0, 0.0], [0.0, 1.0]]]))
"""A sighting that, with a wide gate, may be of any landmark."""

for _column in ANYWHERE:
    _column.flags.writeable = False  # as a log's: kernels are compiled for one kind
