"""Explains a belief that is far off: which of the log's own measurements are not as accurate as stated."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...frontend.factors import UNKNOWN, Log, Truth
from ...frontend.truth_errors import Errors, named, odometry_errors, rows_of, sighting_errors
from .landmark_places import judge, placed
from .stated_noise import normalised, typical_scale

OVERCONFIDENT, CAUTIOUS = 1.5, 0.3  # mean NEES over its dimension beyond which the log is looked into
TYPICAL = 2.0  # times the stated standard deviation, or its inverse, from which a typical error is remarked on
GROSS = 7.0  # standard deviations: a normal error is beyond once in 4e10 sightings


def misstated(log: Log, truth: Truth, row: dict[str, Any]) -> Iterator[str]:
    """Yields remarks on a log that a backend's NEES in `row` contradicts, as far as the true path can tell."""
    beliefs = [row[name] for name in ("nees", "final_nees") if row.get(name) is not None]
    if not any(nees > OVERCONFIDENT or nees < CAUTIOUS for nees in beliefs):
        return
    log = named(log, truth)
    right = truth._replace(assigned=None)  # an error of the given id is an error of the sighting
    if truth.map is None:
        right = judge(truth, placed(log, truth.poses, rows_of(truth.t, log.t), known=True)) or truth
    yield from _far("sighting", sighting_errors(log, right), log.z_cov, int((log.ids != UNKNOWN).sum()))
    yield from _far("motion", odometry_errors(log, truth), log.delta_cov, len(log) - 1)


def _far(noun: str, errors: Errors, cov: Any, number: int) -> Iterator[str]:
    squares = normalised(errors, cov[errors.row])
    if not len(squares):
        return
    scale = typical_scale(squares, errors.values.shape[1])
    if not 1 / TYPICAL < scale < TYPICAL:
        yield f"the errors of the {noun}s are typically {scale:.2g} times what is stated"
        return
    gross = int((squares > GROSS**2).sum())
    if gross:
        largest = float(np.sqrt(squares.max()))
        yield (
            f"{gross} of {number} {noun}s {'are' if gross > 1 else 'is'} off by more than {GROSS:g} stated standard "
            f"deviations, by {largest:.2g} at most"
        )
