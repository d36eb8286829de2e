"""Errors of ranges and bearings alone against ground truth: of their stated noise, and on average."""

from typing import NamedTuple

import numpy as np

from ...backends.starting.late_places import thinned
from ...backends.starting.placing import placed
from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.doubts import judges
from ...core.truth.errors import Errors, named, partial_errors, rows_of, standing
from ..measure.landmark_places import LEAST
from ..measure.stated_noise import NoiseCheck, noise_check, typical

KINDS = (RANGE, BEARING)


class PartErrors(NamedTuple):
    """The errors of partial sightings."""

    row: Ints  # (m,) in the table
    values: Array  # (m,) m or rad
    fitted: bool  # against the places that fit the ranges and bearings best along the true path, as none is known


class PartCheck(NamedTuple):
    """The agreement of ranges or bearings alone with the ground truth, m or rad."""

    stated: NoiseCheck
    middle: float  # the median error
    spread: float  # typical standard deviation about that
    sd: float  # typical standard deviation of the errors, the median included
    fitted: bool


def part_errors(log: Log, truth: Truth | None) -> PartErrors | None:
    """Computes them; None without any, and without a true path that judges the log."""
    if log.partial is None or truth is None or not len(truth.t) or not judges(log, truth):
        return None
    log, known = named(log, truth), standing(truth)
    fitted = known is None or not len(known.ids)
    if fitted and log.partial is not None:
        truth = truth._replace(map=_placed(log, log.partial, truth), places="truth")
    found = partial_errors(log, truth)
    return PartErrors(found.row, found.values, fitted) if len(found.row) else None


def part_checks(log: Log, truth: Truth | None) -> tuple[PartCheck | None, PartCheck | None]:
    """Those of the ranges, and of the bearings."""
    found = part_errors(log, truth)
    if found is None or log.partial is None:
        return None, None
    first, second = (_check(log.partial, found, kind) for kind in KINDS)
    return first, second


def _check(table: PartialTable, found: PartErrors, kind: int) -> PartCheck | None:
    mine = table.kind[found.row] == kind
    row, values = found.row[mine], found.values[mine]
    stated = noise_check(Errors(row, values[:, None]), table.var[:, None, None])
    if stated is None:
        return None
    middle = float(np.median(values))
    return PartCheck(stated, middle, typical(values - middle), typical(values), found.fitted)


def _placed(log: Log, table: PartialTable, truth: Truth) -> Map:
    """The landmarks' likeliest places by what is measured of them from the true path."""
    pose = rows_of(truth.t, log.t[table.step])
    moving = np.zeros(0, np.int64) if truth.moving is None else truth.moving
    ids, xy = list[int](), list[Array]()
    for landmark in np.unique(table.ids[(table.ids != UNKNOWN) & (pose >= 0)]).tolist():
        rows = np.flatnonzero((table.ids == landmark) & (pose >= 0))
        if len(rows) < LEAST or landmark in moving:
            continue
        some = rows[thinned(len(rows))]
        place = placed(truth.poses[pose[some]], table.kind[some], table.z[some], table.var[some])
        if place is not None:
            ids.append(landmark)
            xy.append(place.xy)
    return Map(np.array(ids, np.int64), np.array(xy, np.float64).reshape(-1, 2), None)
