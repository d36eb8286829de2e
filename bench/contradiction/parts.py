"""Ranges alone of other landmarks, and bearings alone that count otherwise, by the true path and known places."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ...core.factors import UNKNOWN, Dataset, Map
from ...core.partial import BEARING, RANGE
from ...core.se2 import Array, Ints, wrap
from ...core.truth.doubts import possible
from ...core.truth.errors import named, rows_of, sighted_from, standing
from ..measure.stated_noise import NAMED, TENFOLD, typical
from ..words.numerals import listed, number

OFF, LEFT = 3.0, 0.2
"""Typical error over the stated noise from which on a cause is looked for, and the share of it that may be left."""

FEWEST = 8
"""Ranges of a landmark, and bearings, that are compared."""

STEADY = 0.9
"""Mean resultant length of errors of bearings that are one but for 0.46 rad."""

MOST = 300
"""Landmarks up to which each is compared with the place of each."""


class _Parts(NamedTuple):
    """Ranges or bearings alone from a true pose."""

    ids: Ints  # (m,)
    z: Array  # (m,) m or rad
    sd: Array  # (m,) as stated
    poses: Array  # (m, 3) true
    xy: Array  # (m, 2) known places

    def errors(self, kind: int) -> Array:
        """(m,) m or rad."""
        right = sighted_from(self.poses, self.xy)
        return self.z - right[:, 0] if kind == RANGE else wrap(self.z - right[:, 1])

    def some(self, mine: NDArray[np.bool_]) -> "_Parts":
        """Those of `mine` (m,)."""
        return _Parts(self.ids[mine], self.z[mine], self.sd[mine], self.poses[mine], self.xy[mine])


def _parts(dataset: Dataset, kind: int) -> tuple[_Parts, Map] | None:
    """Those of a kind with a true pose and a known place, and the known places; None of fewer than FEWEST."""
    log, truth = dataset
    if log.partial is None or truth is None or not len(truth.t) or not possible(log, truth):
        return None
    log, known = named(log, truth), standing(truth)
    table = log.partial
    if table is None or known is None or not len(known.ids):
        return None
    pose, place = rows_of(truth.t, log.t[table.step]), rows_of(known.ids, table.ids)
    row = np.flatnonzero((pose >= 0) & (place >= 0) & (table.ids != UNKNOWN) & (table.kind == kind))
    if len(row) < FEWEST:
        return None
    var = table.var[row]
    if kind == RANGE:
        stated = log.prior.systematic
        var = var + (stated.range_scale * table.z[row]) ** 2 + stated.range_offset**2
    xy = known.xy[place[row]]
    return _Parts(table.ids[row], table.z[row], np.sqrt(var), truth.poses[pose[row]], xy), known


def other_ids(dataset: Dataset) -> Iterator[str]:
    """Says which ranges alone fit the known place of another landmark, not their own."""
    found = _parts(dataset, RANGE)
    if found is None:
        return
    mine, known = found
    names, times = np.unique(mine.ids, return_counts=True)
    names = names[times >= FEWEST]
    swaps = _exchanged(mine, names, known) if 1 < len(known.ids) <= MOST and len(names) else {}
    if swaps:
        words = listed([f"{one} that of {other}" for one, other in swaps.items()], NAMED)
        yield (
            f"by the true path, ranges alone of {len(swaps)} of {len(names)} landmarks do not fit their own known "
            f"place but another's, of id {words}: the ranges, or the known places, have other ids"
        )


def far_ranges(dataset: Dataset) -> Iterator[str]:
    """Says that ranges alone are far from the truth, whatever the reason."""
    found = _parts(dataset, RANGE)
    if found is not None and _exact(dataset):
        yield from _far("ranges", found[0].errors(RANGE) / found[0].sd)


def _exchanged(mine: _Parts, names: Ints, known: Map) -> dict[int, int]:
    """The landmarks, of `names` (k,), whose ranges fit the known place of another, and which it is."""
    cost, own = np.empty((len(names), len(known.ids))), np.empty(len(names))
    for k, name in enumerate(names):
        its = mine.some(mine.ids == name)
        own[k] = typical(its.errors(RANGE) / its.sd)
        for j, place in enumerate(known.xy):
            cost[k, j] = typical(its._replace(xy=np.broadcast_to(place, its.xy.shape)).errors(RANGE))
    if not np.isfinite(cost).all():
        return {}
    best, one = np.asarray(linear_sum_assignment(cost)[1]), np.arange(len(names))
    at = rows_of(known.ids, names)
    moved = (best != at) & (own > OFF) & (cost[one, best] < LEFT * cost[one, at])
    return {int(names[k]): int(known.ids[best[k]]) for k in np.flatnonzero(moved)}


def other_bearings(dataset: Dataset) -> Iterator[str]:
    """Says why bearings alone are far from the truth: a sign, a unit, a constant turn or none of these."""
    found = _parts(dataset, BEARING)
    if found is None:
        return
    mine, _ = found
    errors = mine.errors(BEARING)
    off = typical(errors / mine.sd)
    if off <= OFF:
        return
    told = typical(errors)
    for words, changed in (
        ("are positive to the other side", -mine.z),
        ("in radians were converted from degrees", np.rad2deg(mine.z)),
        ("are in degrees, and were read as radians", np.deg2rad(mine.z)),
    ):
        if typical(mine._replace(z=changed).errors(BEARING)) < LEFT * told:
            yield f"{_begun('bearings', off)}: they fit if bearings {words}"
            return
    mean = np.exp(1j * errors).mean()
    turn = float(np.angle(mean))
    if abs(mean) > STEADY and typical(wrap(errors - turn)) < LEFT * told:
        size, side = number(abs(float(np.rad2deg(turn)))), "left" if turn > 0 else "right"
        yield (
            f"{_begun('bearings', off)}: they are {size} degrees too far {side}, as where the sensor, or the headings "
            "of the truth, are turned"
        )
        return
    if _exact(dataset):
        yield from _far("bearings", errors / mine.sd)


def _exact(dataset: Dataset) -> bool:
    """True where the true path's own errors, as of GPS, cannot be what measurements are off by."""
    return dataset.truth is not None and dataset.truth.exact


def _far(noun: str, over: Array) -> Iterator[str]:
    """Says that errors, `over` their stated noise, are typically far larger, and that nothing usual explains it."""
    off = typical(over)
    if off > TENFOLD:
        yield (
            f"{_begun(noun, off)}: no noise, but ids, a clock, the true path or the known places that are wrong; what "
            "is usual does not explain it"
        )


def _begun(noun: str, off: float) -> str:
    return f"{noun} alone are typically {number(off)} times their stated noise from the true path and known places"
