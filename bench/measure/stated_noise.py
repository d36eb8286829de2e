"""Compares a log's stated noise with its errors, where the truth is known."""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ...core.truth_errors import Errors

FAR = {2: 13.816, 3: 16.266}  # dimension -> chi-square's 99.9 % point
MEDIAN = {2: 1.3863, 3: 2.3660}  # dimension -> the median of chi-square


ROBUST = 1.4826  # a normal standard deviation over the median of absolute values


class NoiseCheck(NamedTuple):
    """Normalised squared errors e' C^-1 e of one kind of measurement."""

    checked: int
    nees: float  # their mean over the dimension k: 1 where the noise is as stated
    median: float
    far: float  # share beyond FAR
    scale: float  # by how much the typical error is larger than stated: sqrt(median / chi-square's median)


def noise_check(errors: Errors, cov: Array) -> NoiseCheck | None:
    """Compares `errors` with their stated covariances `cov` (m, k, k); None without any."""
    if not len(errors.row):
        return None
    k, squares = errors.values.shape[1], normalised(errors, cov)
    far = float((squares > FAR[k]).mean())
    median = float(np.median(squares))
    return NoiseCheck(len(squares), float(squares.mean()) / k, median, far, typical_scale(squares, k))


def normalised(errors: Errors, cov: Array) -> Array:
    """Returns the squares (m,) e' C^-1 e of `errors` with covariances `cov` (m, k, k)."""
    return np.einsum("mi,mi->m", errors.values, np.linalg.solve(cov, errors.values[..., None])[..., 0])


def typical_scale(squares: Array, k: int) -> float:
    """Returns by how much the typical error is larger than stated, from normalised squares of dimension k."""
    return float(np.sqrt(np.median(squares) / MEDIAN[k]))


class Measured(NamedTuple):
    """The noise that sightings have, robust to outliers."""

    range_sd: float  # m
    bearing_sd: float  # rad


def measured(errors: Errors) -> Measured | None:
    """Returns the standard deviations of the errors (m, 2) of sightings; None without any."""
    return Measured(*map(typical, errors.values.T)) if len(errors.row) else None


def typical(errors: Array) -> float:
    """Returns a robust standard deviation: 1.4826 times the median absolute error, not centred: a bias enlarges it."""
    return float(ROBUST * np.median(np.abs(errors)))
