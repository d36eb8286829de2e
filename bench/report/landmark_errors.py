"""Errors of single landmarks on the log that is drawn: by backend, the worst first."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints, act
from ...core.truth.errors import rows_of
from ..drawing.table import Entry, Table, TableRow
from ..measure.accuracy import align
from ..verdict.summary import representative
from ..words import column as kind
from ..words.column import Column
from ..words.names import tags
from ..words.numerals import number
from .drawn_log import DrawnLog, Trace

SHOWN = 10  # landmarks of the table
ALL = "all"  # the row of the map's error


class BackendMap(NamedTuple):
    """A backend's map beside the known one, as its error is measured."""

    trace: Trace
    which: str  # final or online
    xy: Array  # (n, 2) aligned; NaN where it lacks the landmark

    def off(self, known: Array) -> Array:
        """The errors (n, 2), m, from the places `known`."""
        return self.xy - known


class LandmarkErrors(NamedTuple):
    """The known landmarks that do not move, and every backend's map, in the order of their errors."""

    ids: Ints  # (n,)
    xy: Array  # (n, 2)
    times: Ints | None  # (n,) sighted; None in records of earlier versions
    maps: Sequence[BackendMap]
    reference: bool  # the known places are the batch optimum's

    @property
    def sizes(self) -> Array:
        """The errors (m, n), m, by backend; NaN where it lacks the landmark."""
        return np.array([np.hypot(*one.off(self.xy).T) for one in self.maps])

    @property
    def worst(self) -> Ints:
        """The rows of landmarks on any map, by the median error over backends, the largest first."""
        sizes = self.sizes
        mapped = np.flatnonzero(np.isfinite(sizes).any(axis=0))
        typical = np.nanmedian(sizes[:, mapped], axis=0)
        return mapped[np.argsort(-typical, kind="stable")]


def landmark_errors(log: DrawnLog) -> LandmarkErrors | None:
    """Compares every backend's map, the final one where it has one, with the known one; None without any."""
    known = log.known
    if "ids" not in known or not len(known["ids"]):
        return None
    line = representative(log.lines)
    stays = ~np.isin(known["ids"], known.get("moving", np.zeros(0, np.int64)))
    ids, xy = known["ids"][stays], known["xy"][stays]
    order = {backend: k for k, backend in enumerate(log.order)}
    own = line.surveyed or not {"ate_m", "final_ate_m"} & line.values.keys()
    traces = sorted(log.traces, key=lambda trace: order.get(trace.label, len(order)))
    maps = [found for trace in traces if (found := _map(trace, ids, xy, own=own)) is not None]
    if not maps:
        return None
    times = known["times"][stays] if "times" in known else None
    return LandmarkErrors(ids, xy, times, maps, log.kind == "reference" and not line.surveyed)


def _map(trace: Trace, ids: Ints, xy: Array, *, own: bool) -> BackendMap | None:
    """Lays a backend's map on the known one, by its path's alignment, or by the landmarks' `own`."""
    a = trace.arrays
    which = "final" if "final_map_ids" in a else "online"
    prefix = "final_" if which == "final" else ""
    row = rows_of(a.get(f"{prefix}map_ids", np.zeros(0, np.int64)), ids)
    there: NDArray[np.bool_] = row >= 0
    if not there.any():
        return None
    places = np.full((len(ids), 2), np.nan)
    places[there] = a[f"{prefix}map_xy"][row[there]]
    with np.errstate(over="ignore"):
        there &= np.isfinite(places**2).all(axis=1)  # beyond 1e154 there is no distance
    if not there.any():
        return None
    places[~there] = np.nan
    motion = None if own else a.get(f"{prefix}alignment")
    if motion is None:
        if there.sum() < 3:  # fewer fit any map
            return None
        motion = align(places[there], xy[there]).motion
    return BackendMap(trace, which, act(np.broadcast_to(motion, (len(ids), 3)), places))


def landmark_table(found: LandmarkErrors | None) -> Table:
    """Makes the table of the worst landmarks, with the error of the whole map above them; empty without any."""
    if found is None:
        return Table([], [])
    called, sizes, worst = tags(one.trace.label for one in found.maps), found.sizes, found.worst
    shown = worst[: SHOWN if len(worst) > SHOWN + 1 else SHOWN + 1]
    first = found.maps[0]
    off = first.off(found.xy)
    nearest = _nearest(found, first)
    headings = [Column("times", "sighted", kind.COUNT, "How often it was sighted.")] * (found.times is not None)
    headings += [
        Column(one.trace.label, called[one.trace.label], kind.ERROR_M, f"Error in the {one.which} map.")
        for one in found.maps
    ]
    by = called[first.trace.label]
    headings += [
        Column(name, f"{name} by {by}", kind.METRES, f"{name} of the estimate less that of the place.") for name in "xy"
    ]
    whose = any(nearest[k] != found.ids[k] for k in shown)
    headings += [Column("nearest", "nearest place", kind.NUMBER, f"Whose place is nearest to {by}'s.")] * whose
    rows = [TableRow(ALL, _whole(found, sizes, len(headings)))]
    for k in shown.tolist():
        entries = [_entry(int(found.times[k]), f"{found.times[k]:,}")] if found.times is not None else []
        entries += [_entry(size, number(size)) for size in sizes[:, k].tolist()]
        entries += [_entry(one, number(one)) for one in off[k].tolist()]
        entries += [Entry("its own" if nearest[k] == found.ids[k] else f"that of {nearest[k]}")] * whose
        rows.append(TableRow(str(found.ids[k]), entries))
    return Table(headings, rows, _caption(found, worst, len(shown)), "landmark")


def _caption(found: LandmarkErrors, worst: Ints, shown: int) -> str:
    what = "distance from the reference's landmark" if found.reference else "error of each landmark's place"
    said = f"{what[:1].upper()}{what[1:]}"
    which = {one.which for one in found.maps}
    said += f", {which.pop()} map" if len(which) == 1 else ", final map, of backends without one the online map"
    rest, lacking = worst[shown:], len(found.ids) - len(worst)
    over = " by the median over backends" * (len(found.maps) > 1)
    if len(rest):
        most = float(np.nanmedian(found.sizes[:, rest], axis=0).max())
        said += f": the worst {shown} of {len(worst):,}{over}; of the others it is {number(most)} m at most"
    else:
        said += f", the worst first{over}"
    return said + f"; {lacking:,} known landmark{'s are' if lacking > 1 else ' is'} on no map" * bool(lacking)


def _whole(found: LandmarkErrors, sizes: Array, columns: int) -> list[Entry]:
    """The root mean square errors, which other tables have as the map's."""
    rmse = [float(np.sqrt(np.nanmean(one**2))) for one in sizes]
    entries = [_entry(int(found.times.sum()), f"{found.times.sum():,}")] if found.times is not None else []
    entries += [_entry(value, number(value))._replace(note="RMS") for value in rmse]
    return entries + [Entry("")] * (columns - len(entries))


def _entry(value: float, text: str) -> Entry:
    return Entry(text if np.isfinite(value) else "", value=float(value) if np.isfinite(value) else None)


def _nearest(found: LandmarkErrors, one: BackendMap) -> Ints:
    """The id (n,) of the known landmark that is nearest to each estimate, its own where there is none."""
    there = np.isfinite(one.xy).all(axis=1)
    ids = found.ids.copy()
    apart = np.hypot(*(one.xy[there][:, None] - found.xy[None]).transpose(2, 0, 1))
    ids[there] = found.ids[np.argmin(apart, axis=1)]
    return ids
