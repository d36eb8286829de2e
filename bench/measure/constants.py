"""The constant errors of sensors that a backend has estimated, as columns of its cell and, each by itself, as an array.

The true value is the one that a simulated world has drawn and noted. Elsewhere, where the path is known at every step
and the landmarks' places are true, it is the one that fits the measurements best along these: it then has the error of
that fit. A gyro's bias is known in simulated worlds alone.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...backends.api import Constant
from ...backends.constant_errors import fitted
from ...core.factors import CONSTANTS_NOTE, Log, Map, Truth
from ...core.se2 import Array
from ...core.truth.doubts import judges
from ...core.truth.errors import rows_of
from .drive import Outcome

KINDS = ("range_scale", "range_offset", "heading_offset", "wheel_scale", "gyro_bias")
"""The constant errors; the array `constants` has their numbers in this order."""

UNITS = ("", "m", "rad", "", "rad/s")
NUMBER = {name: k for k, name in enumerate(KINDS)}
EACH = ("range_scale", "range_offset")  # that each landmark may have

OF_ALL = -1
"""Stands for the landmark of an error that all ranges, or none, have."""


class Estimate(NamedTuple):
    """One constant error; NaN where not known."""

    kind: int  # in KINDS
    landmark: int
    value: float
    sd: float
    true: float


def constants(log: Log, outcome: Outcome, truth: Truth | None) -> tuple[dict[str, Any], dict[str, Array]]:
    """The columns of a row, medians over landmarks where each has its own error, and the array (k, 5) of all."""
    found = _estimates(log, outcome, truth)
    if not found:
        return {}, {}
    table, row = np.array(found, np.float64), dict[str, Any]()
    for k in range(len(KINDS)):
        mine = table[table[:, 0] == k, 2:]
        for suffix, values in zip(("", "_sd", "_true"), mine.T, strict=True):
            if len(values) and np.isfinite(values).all():
                row[column(k, suffix)] = float(np.median(values))
    return row, {"constants": table}


def column(kind: int, suffix: str = "") -> str:
    """The name of the column of a constant, of its `_sd` or of its `_true` value: it ends in the unit."""
    unit = UNITS[kind].replace("/", "_")
    return KINDS[kind] + suffix + f"_{unit}" * bool(unit)


def _estimates(log: Log, outcome: Outcome, truth: Truth | None) -> list[Estimate]:
    solution, online, believed = outcome.solution, outcome.calibration, log.prior.systematic
    final = solution is not None and solution.constant is not None
    constant = solution.constant if solution is not None and final else online.constant
    landmarks = solution.map if solution is not None and final else outcome.map
    bias = online.gyro_bias if solution is None or solution.gyro_bias is None else solution.gyro_bias
    found = list[Estimate]()
    for name, k in NUMBER.items():
        if constant is None or not getattr(believed, name, 0.0) > 0:
            continue
        values = _of(constant, name)
        sds = np.full(len(values), np.nan) if constant.sd is None else _of(constant.sd, name)
        if name == "wheel_scale" and not sds[0] > 0:
            continue  # one that does not estimate it has none
        ids = landmarks.ids.tolist() if believed.each and name in EACH else [OF_ALL]
        true = _true(log, truth, landmarks, name)
        found += [Estimate(k, *one) for one in zip(ids, values.tolist(), sds.tolist(), true.tolist(), strict=True)]
    if bias is not None and log.gyro is not None:
        true = float(log.notes.get(CONSTANTS_NOTE, {}).get("gyro_bias", np.nan))
        found.append(Estimate(NUMBER["gyro_bias"], OF_ALL, bias.mean, bias.sd if bias.sd > 0 else np.nan, true))
    return found


def _true(log: Log, truth: Truth | None, landmarks: Map, name: str) -> Array:
    """The true values, as many as are estimated; NaN where they are not known."""
    each = log.prior.systematic.each and name in EACH
    size, noted = len(landmarks.ids) if each else 1, log.notes.get(CONSTANTS_NOTE, {})
    if name in noted:
        return np.full(size, float(noted[name]))
    known = None if truth is None or truth.places != "truth" else truth.map
    if truth is None or known is None or name == "wheel_scale" or not judges(log, truth) or len(truth.t) < len(log):
        return np.full(size, np.nan)
    if truth.assigned_partial is not None and log.partial is not None:
        log = replace(log, partial=replace(log.partial, ids=truth.assigned_partial))
    best = _of(fitted(log, truth.poses, known), name)
    if not each:
        return best
    row = rows_of(known.ids, landmarks.ids)
    return np.where(row >= 0, best[row], np.nan)


def _of(constant: Constant, name: str) -> Array:
    """The values of that name, one or one of each landmark."""
    return np.atleast_1d(np.asarray(getattr(constant, name), np.float64))
