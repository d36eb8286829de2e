"""Squared Mahalanobis distances of sightings and loop closures from an estimate, and how uneven they are."""

import numpy as np

from ...core.factors import Log, Map
from ...core.se2 import Array, between
from ...core.small_matrices import inverse
from ...core.truth.errors import difference, rows_of
from ..api import Constant
from ..constant_errors import fitted, partial_residuals, squared_partial
from ..models import innovation, sight

MEDIANS = {1: 0.455, 2: 1.386, 3: 2.366}  # of chi-square, by its degrees of freedom

EVEN = {1: 2.5, 2: 2.0, 3: 1.5}
"""Most ratio of mean to median, in those of chi-square, of distances that are one distribution's.

Both grow with the noise that is not stated, so that their ratio does not depend on how well noise is stated. It is 1 of
Gaussian errors whatever their scale. Where a loop is closed the wrong way round, some factors bear what others do not.
"""

FAR = 9.0
"""Median, in that of chi-square, above which all are far: noise stated a third of what it is, or a wrong minimum."""

FEW = 10  # distances; of fewer, the ratio says nothing


def of_sightings(log: Log, path: Array, landmarks: Map) -> Array:
    """(s,) distances of the sightings from a path (n, 3) and all their landmarks."""
    e = innovation(log.z.copy(), sight(path[log.sighting_step], landmarks.xy[rows_of(landmarks.ids, log.ids)])[0])
    return _squared(e, log.z_cov)


def of_partial(log: Log, path: Array, landmarks: Map, constant: Constant | None) -> Array:
    """(p,) likewise of the partial sightings, with the constant errors that fit best if there are none."""
    constant = fitted(log, path, landmarks) if constant is None else constant
    off = partial_residuals(log, path, landmarks, constant)
    return np.zeros(0) if off is None or log.partial is None else squared_partial(log.partial, off)


def of_loops(log: Log, path: Array) -> Array:
    """(l,) likewise of the loop closures."""
    return _squared(difference(between(path[log.loop_to], path[log.loop_step]), log.loop_delta), log.loop_cov)


def unevenness(log: Log, path: Array, landmarks: Map) -> float:
    """The ratio of mean to median of distances, in EVEN, of sightings or loop closures; at most 1 if they are even.

    Infinite where too few of a kind tell, or where all are far.
    """
    kinds = (
        (of_partial(log, path, landmarks, None), 1),
        (of_sightings(log, path, landmarks), 2),
        (of_loops(log, path), 3),
    )
    return max((_ratio(x, dof) for x, dof in kinds if len(x)), default=0.0)


def _ratio(x: Array, dof: int) -> float:
    middle = float(np.median(x)) / MEDIANS[dof]
    return float(x.mean()) / dof / middle / EVEN[dof] if len(x) >= FEW and 0 < middle <= FAR else np.inf


def _squared(e: Array, cov: Array) -> Array:
    return np.einsum("ki,kij,kj->k", e, inverse(cov), e)
