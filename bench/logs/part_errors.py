"""Errors of ranges and bearings alone against ground truth: of their stated noise, and on average.

A scale and an offset of ranges that the log states as unknown are no errors of its noise: they are fitted along the
true path, and taken off.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Truth
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.doubts import judges
from ...core.truth.errors import Errors, named, partial_errors, standing
from ..measure.stated_noise import NoiseCheck, noise_check, typical
from ..systematic.ranges import NAMES, along_line
from .fitted_places import fitted_places

KINDS = (RANGE, BEARING)


class Constant(NamedTuple):
    """A scale and an offset of ranges alone that the log states as unknown, and that are taken off."""

    range_scale: float | None  # None: not stated
    range_offset: float | None  # m
    landmarks: int  # 0: one of each for all; else that many landmarks have their own, and these are medians


class PartErrors(NamedTuple):
    """The errors of partial sightings."""

    row: Ints  # (m,) in the table
    values: Array  # (m,) m or rad
    fitted: bool  # against the places that fit the ranges and bearings best along the true path, as none is known
    constant: Constant | None = None


class PartCheck(NamedTuple):
    """The agreement of ranges or bearings alone with the ground truth, m or rad."""

    stated: NoiseCheck
    middle: float  # the median error
    spread: float  # typical standard deviation about that
    sd: float  # typical standard deviation of the errors, the median included
    fitted: bool
    constant: Constant | None = None


def part_errors(log: Log, truth: Truth | None) -> PartErrors | None:
    """Computes them; None without any, and without a true path that judges the log."""
    if log.partial is None or truth is None or not len(truth.t) or not judges(log, truth):
        return None
    log, known = named(log, truth), standing(truth)
    table, fitted = log.partial, known is None or not len(known.ids)
    if table is None:
        return None
    constant = log.prior.systematic
    free = {name: sd for name in NAMES if (sd := getattr(constant, name))}
    if fitted:
        together = {} if constant.each else free
        truth = truth._replace(map=fitted_places(table, log.t[table.step], truth, together), places="truth")
    row, values = partial_errors(log, truth)
    if not len(row):
        return None
    found = PartErrors(row, values, fitted)
    return _without_constant(table, found, list(free), each=constant.each) if free else found


def _without_constant(table: PartialTable, found: PartErrors, free: Sequence[str], *, each: bool) -> PartErrors:
    """Takes off the scale and the offset of ranges that are `free`, of all landmarks or of `each`."""
    row, values = found.row, found.values.copy()
    mine = np.flatnonzero(table.kind[row] == RANGE)
    ids, lines = table.ids[row[mine]], list[Array]()
    groups = [mine[ids == one] for one in np.unique(ids)] if each else [mine]
    for group in groups:
        if len(group) > len(free):
            away = table.z[row[group]] - values[group]
            scale, offset = line = along_line(away, values[group], free)
            lines.append(line)
            values[group] -= scale * away + offset
    if not lines:
        return found
    middle = np.median(lines, axis=0)
    scale, offset = (float(middle[k]) if name in free else None for k, name in enumerate(NAMES))
    return found._replace(values=values, constant=Constant(scale, offset, len(lines) if each else 0))


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
    constant = found.constant if kind == RANGE else None
    return PartCheck(stated, middle, typical(values - middle), typical(values), found.fitted, constant)
