"""The weight of errors that stay the same, against the noise that a log states."""

from typing import NamedTuple

import numpy as np

from ...core.factors import Log
from ...core.se2 import Array
from ...core.truth.errors import difference
from ...datasets.noise.systematic import NAMES, SENSOR, Systematic, corrected
from .windows import windows


class Weight(NamedTuple):
    """The size of errors over the stated standard deviations: medians of root mean squares over the components.

    At 1 the squares are twice those that noise as stated has, and J per degree of freedom is 2.
    """

    sightings: float  # by the sensor's errors
    motions: float  # by those of the wheels, over windows of time


def weight(log: Log, errors: Systematic) -> Weight:
    """Compares the changes that `errors` make in the log's sightings and motions with its stated noise."""
    right = corrected(log, _of(errors, SENSOR))
    seen = _typical(difference(log.z, right.z), log.z_cov)
    right, driven = corrected(log, _of(errors, NAMES[len(SENSOR) :])), np.arange(1, len(log))
    first = windows(log.t, driven)
    if not len(first):
        return Weight(seen, 0.0)
    moved, cov = (np.add.reduceat(one, first) for one in (log.delta[1:] - right.delta[1:], log.delta_cov[1:]))
    return Weight(seen, _typical(moved, cov))


def _of(errors: Systematic, names: tuple[str, ...]) -> Systematic:
    return Systematic(**{name: getattr(errors, name) for name in names})


def _typical(changes: Array, cov: Array) -> float:
    """The median size of changes (m, k), over their covariances (m, k, k), a component."""
    if not len(changes):
        return 0.0
    squares = np.einsum("mi,mi->m", changes, np.linalg.solve(cov, changes[..., None])[..., 0])
    return float(np.sqrt(np.median(squares) / changes.shape[1]))
