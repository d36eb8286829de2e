"""Compares a log's stated noise with its errors where the truth is known, and remarks on a log that misstates it."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Log, Truth
from ...core.se2 import Array
from ...core.truth_errors import Errors, difference, named, odometry_errors, rows_of, sighting_errors
from .landmark_places import judge, placed

FAR = {2: 13.816, 3: 16.266}  # dimension -> chi-square's 99.9 % point
MEDIAN = {2: 1.3863, 3: 2.3660}  # dimension -> the median of chi-square
ROBUST = 1.4826  # a normal standard deviation over the median of absolute values
OVERCONFIDENT, CAUTIOUS = 1.5, 0.3  # mean NEES over its dimension beyond which the log is looked into
TYPICAL = 2.0  # times the stated standard deviation, or its inverse, from which a typical error is remarked on
TENFOLD = 10.0  # likewise, where the belief holds: no sensor is calibrated as badly, a wrong unit or a square is worse
GROSS = 7.0  # standard deviations: a normal error is beyond once in 4e10 sightings


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
    """The squares (m,) e' C^-1 e of `errors` with covariances `cov` (m, k, k)."""
    return np.einsum("mi,mi->m", errors.values, np.linalg.solve(cov, errors.values[..., None])[..., 0])


def typical_scale(squares: Array, k: int) -> float:
    """Returns by how much the typical error is larger than stated, from normalised squares of dimension k."""
    return float(np.sqrt(np.median(squares) / MEDIAN[k]))


class Measured(NamedTuple):
    """The noise that sightings have, robust to outliers."""

    range_sd: float  # m
    bearing_sd: float  # rad


def measured(errors: Errors) -> Measured | None:
    """The standard deviations of the errors (m, 2) of sightings; None without any."""
    return Measured(*map(typical, errors.values.T)) if len(errors.row) else None


def typical(errors: Array) -> float:
    """A robust standard deviation: 1.4826 times the median absolute error, not centred: a bias enlarges it."""
    return float(ROBUST * np.median(np.abs(errors)))


def misstated(log: Log, truth: Truth, row: dict[str, Any]) -> Iterator[str]:
    """Yields remarks on a log that a backend's NEES in `row` contradicts, as far as the true path can tell."""
    beliefs = [row[name] for name in ("nees", "final_nees") if row.get(name) is not None]
    off = any(nees > OVERCONFIDENT or nees < CAUTIOUS for nees in beliefs)
    log = named(log, truth)
    right = truth._replace(assigned=None)  # an error of the given id is an error of the sighting
    if truth.map is None:
        right = judge(truth, placed(log, truth.poses, rows_of(truth.t, log.t), known=True)) or truth
    typical = TYPICAL if off else TENFOLD
    yield from _far("sighting", sighting_errors(log, right), log.z_cov, int((log.ids != UNKNOWN).sum()), typical, off)
    yield from _far("motion", odometry_errors(log, truth), log.delta_cov, len(log) - 1, typical, off)
    if off and truth.t[0] == log.t[0]:
        yield from _start(log, truth)


def _start(log: Log, truth: Truth) -> Iterator[str]:
    """Compares the prior's pose with the true one."""
    error = difference(log.prior.pose[None], truth.poses[:1])
    distance = float(np.sqrt(normalised(Errors(np.zeros(1, np.int64), error), log.prior.cov[None])[0]))
    if distance > GROSS:
        yield (
            f"the log's prior is {np.hypot(*error[0, :2]):.2g} m and {abs(error[0, 2]):.2g} rad off the true pose, "
            f"{distance:.2g} of its standard deviations"
        )


def _far(noun: str, errors: Errors, cov: Array, number: int, typical: float, off: bool) -> Iterator[str]:
    """Remarks on errors beyond `typical` times what is stated; where the belief is `off`, on single ones as well."""
    squares = normalised(errors, cov[errors.row])
    if not len(squares):
        return
    scale = typical_scale(squares, errors.values.shape[1])
    if not 1 / typical < scale < typical:
        yield f"the errors of the {noun}s are typically {scale:.2g} times what is stated"
        return
    gross = int((squares > GROSS**2).sum())
    if gross and off:
        largest = float(np.sqrt(squares.max()))
        yield (
            f"{gross} of {number} {noun}s {'are' if gross > 1 else 'is'} off by more than {GROSS:g} stated standard "
            f"deviations, by {largest:.2g} at most"
        )
