"""Ranges alone that are all too long or short, or late, by the true path and places, and single ones beyond reach."""

from collections.abc import Iterator, Sequence

import numpy as np

from ...core.factors import UNKNOWN, Dataset, Log, Truth
from ...core.partial import RANGE
from ...core.se2 import Array
from ...core.truth.errors import named, partial_errors, rows_of, standing
from ..systematic.fit import SystematicFit
from ..systematic.late_parts import late
from ..systematic.ranges import of_ranges
from ..systematic.words import clause, of_late
from ..words.numerals import listed, number

AS_LARGE, LEFT = 1.0, 0.5
"""Scale and offset matter if they are typically as large as the noise that is stated (J is then 2), and without them at
most this share of the typical squares is left: as of whole sightings, see `constant`."""

AT_MOST = 3.0
"""Typical error over the stated noise that may be left without a delay: it explains what is off then."""

TYPICAL = 0.67449
"""Median absolute value of normal noise, in standard deviations."""

STATED = 3.0
"""Standard deviations of a scale or an offset that the prior states, up to which the log knows of it."""

REACH, SPREAD = 5.0, 10.0
"""Times the longest direct way, and standard deviations: a way with reflections is seldom more than twice as long, and
one of many late ranges 2.5 times. What is beyond is no noise: a lost digit, another unit, an error's code."""

LONE = 0.05
"""Share of the ranges to a landmark up to which they are single ones, where no true path and place tell; more are its
noise, or a unit's."""


def ratios(log: Log, truth: Truth | None) -> Array:
    """(k,) ranges alone over the true distances, where these are known."""
    if truth is None or log.partial is None or truth.kind != "truth":
        return np.zeros(0)
    log = named(log, truth)
    row, error = partial_errors(log, truth)
    if log.partial is None or not len(row):
        return np.zeros(0)
    mine = log.partial.kind[row] == RANGE
    z = log.partial.z[row[mine]]
    away = z - error[mine]
    return z[away > 0] / away[away > 0]


def too_long(dataset: Dataset) -> Iterator[str]:
    """Says what ranges alone are too long by, if it is as large as their stated noise and the log does not state it."""
    log, truth = dataset
    if log.partial is None or truth is None or truth.kind != "truth" or not len(truth.t) or truth.map is None:
        return
    if not _off(log, truth):
        return
    found = of_ranges([dataset])
    if found is None or not found.certain:
        return
    names = [name for name in found.certain if not _stated(log, name, getattr(found.errors, name))]
    size, left = _weight(log, truth, found, names)
    if size < AS_LARGE or left > LEFT:
        return
    said = listed([clause(found, name) for name in names])
    yield (
        f"by the true path and the known places {said}: this is {number(size)} times the stated noise of ranges, and "
        "no noise; `bench noise LOG --apply FOLDER` corrects it, and an unknown one is stated by range_scale and "
        "range_offset of csv"
    )


def out_of_time(dataset: Dataset, kind: int) -> Iterator[str]:
    """Says how late ranges or bearings alone are, if that is as large as their stated noise and most of their error."""
    if dataset.log.partial is None or dataset.truth is None:
        return
    found = late([dataset], kind)
    if found is None or not found.certain or found.size < AS_LARGE or found.after > AT_MOST:
        return
    if found.after**2 <= LEFT * found.before**2:
        said = of_late(found, "ranges" if kind == RANGE else "bearings")
        yield (
            f"by the true path and the known places {said}: this is typically {number(found.size)} times their stated "
            "noise, and no noise"
        )


def _off(log: Log, truth: Truth) -> bool:
    """True where ranges are typically as far off as noise as stated, at least: else nothing in them matters."""
    log = named(log, truth)
    row, error = partial_errors(log, truth)
    table = log.partial
    if table is None:
        return False
    mine = table.kind[row] == RANGE
    return bool(mine.any()) and float(np.median(np.abs(error[mine]) / np.sqrt(table.var[row[mine]]))) > TYPICAL


def _weight(log: Log, truth: Truth, found: SystematicFit, names: Sequence[str]) -> tuple[float, float]:
    """Size of these errors of ranges over the stated noise; share of squared errors left without all; medians."""
    log = named(log, truth)
    row, error = partial_errors(log, truth)
    table = log.partial
    if table is None:
        return 0.0, 1.0
    mine = table.kind[row] == RANGE
    row, error = row[mine], error[mine]
    longer = {
        "range_scale": found.errors.range_scale * (table.z[row] - error),
        "range_offset": np.full(len(row), found.errors.range_offset),
    }
    before, after = np.median(error**2), np.median((error - longer["range_scale"] - longer["range_offset"]) ** 2)
    size = np.abs(np.sum([longer[name] for name in names], axis=0)) / np.sqrt(table.var[row])
    return float(np.median(size)), float(after / before) if before > 0 else 1.0


def _stated(log: Log, name: str, size: float) -> bool:
    """True where the prior states a scale or offset of about that size."""
    stated = log.prior.systematic
    return abs(size) <= STATED * getattr(stated, name)


def beyond_reach(log: Log, truth: Truth | None) -> Iterator[str]:
    """Says which ranges alone are longer than any way to their landmark; of all of them `units` does.

    None is longer than the farthest that the true path gets from a known place; without these, than the median of the
    others to it and the whole way that the robot drives.
    """
    log = named(log, truth)
    table = log.partial
    if table is None:
        return
    mine = np.flatnonzero((table.kind == RANGE) & (table.ids != UNKNOWN))
    way = float(np.hypot(*log.delta[1:, :2].T).sum())
    far, reach = list[int](), dict[int, float]()
    for landmark in np.unique(table.ids[mine]).tolist():
        rows = mine[table.ids[mine] == landmark]
        longest = _longest(truth, landmark)
        known = longest is not None
        longest = float(np.median(table.z[rows])) + way if longest is None else longest
        beyond = table.z[rows] > REACH * longest + SPREAD * np.sqrt(table.var[rows])
        if known or (beyond.sum() <= max(1, LONE * len(rows)) and not beyond.all()):
            far += rows[beyond].tolist()
            reach[landmark] = longest
    if not far or len(far) == len(mine):
        return
    first = min(far)
    landmark = int(table.ids[first])
    step = int(table.step[first])
    by = "the true path" if _longest(truth, landmark) is not None else "the others and the robot's way"
    yield (
        f"{len(far):,} of {len(mine):,} ranges alone {'is' if len(far) == 1 else 'are'} longer than there is a way: "
        f"the first is of {number(float(table.z[first]))} m to landmark {landmark} at {log.t[step]:.10g} s, where "
        f"by {by} {number(reach[landmark])} m are the most; even reflections are within {REACH:g} times as many"
    )


def _longest(truth: Truth | None, landmark: int) -> float | None:
    """The farthest, m, that the true path gets from a landmark; None where either is not known."""
    if truth is None or truth.kind != "truth" or not len(truth.t) or (known := standing(truth)) is None:
        return None
    row = rows_of(known.ids, np.array([landmark]))[0]
    return None if row < 0 else float(np.hypot(*(truth.poses[:, :2] - known.xy[row]).T).max())
