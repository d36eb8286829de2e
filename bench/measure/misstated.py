"""Explains a belief that is far off: which of the log's own measurements, or its prior, are not as accurate as stated.

Noise that is stated by far too large or too small is remarked on whatever the belief: it costs accuracy in any case.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...core.factors import UNKNOWN, Log, Truth
from ...core.se2 import Array
from ...core.truth_errors import Errors, difference, named, odometry_errors, rows_of, sighting_errors
from .landmark_places import judge, placed
from .stated_noise import normalised, typical_scale

OVERCONFIDENT, CAUTIOUS = 1.5, 0.3  # mean NEES over its dimension beyond which the log is looked into
TYPICAL = 2.0  # times the stated standard deviation, or its inverse, from which a typical error is remarked on
TENFOLD = 10.0  # likewise, where the belief holds: no sensor is calibrated as badly, a wrong unit or a square is worse
GROSS = 7.0  # standard deviations: a normal error is beyond once in 4e10 sightings


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
