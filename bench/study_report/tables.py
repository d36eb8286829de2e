"""Makes the tables of a study's report: claims with intervals, and the medians of its figures."""

from collections.abc import Mapping, Sequence
from math import isfinite, isnan, nan
from typing import Any, NamedTuple

from ..claims.answer import Answer
from ..claims.curves import Medians, Place, worded
from ..drawing.table import Entry
from ..study.study import Claim
from ..verdict.statistics import FEWEST
from ..words.columns import about
from ..words.numerals import number

MOST_COLUMNS = 7  # values of `by` that stand side by side; more of them stand below each other


ENDS = f"their 95 % intervals (below {FEWEST} runs: ranges)"


class Grid(NamedTuple):
    """A table whose rows are named by their first column."""

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[Entry]]


def claim_grid(answers: Sequence[Answer]) -> list[tuple[Answer, Sequence[Entry]]]:
    """Makes a row per claim: the measure, its value and interval, and the bound."""
    return [(found, _claim(found)) for found in answers]


def _claim(found: Answer) -> list[Entry]:
    claim, figures = found.claim, found.figures
    value, low, high = (float(figures.get(name, nan)) for name in ("estimate", "low", "high"))
    known = isfinite(low) or isfinite(high)
    ends = Entry(interval(low, high) if known else "")
    what, of = _measured(claim)
    return [Entry(what, note=of), Entry(_said(value)), ends, Entry(_bound(claim)), Entry(_said(figures.get("n")))]


def _measured(claim: Claim) -> tuple[str, str]:
    one, other, where = (selection(side) for side in (claim.first, claim.second, claim.where))
    measure = about(claim.measure).called
    what = {
        "value": f"median of {measure}",
        "less": f"ratio of {measure}",
        "alike": f"ratio of {measure}",
        "grows": f"exponent of {measure} in {claim.along}",
        "crosses": f"{claim.along} where {measure} crosses",
    }[claim.kind]
    of = f"{other} over {one}" if claim.kind in ("less", "alike") else " and ".join(filter(None, (one, other)))
    parts = [of, where, f"for each {claim.each}" if claim.each else ""]
    return what, "; ".join(part for part in parts if part)


def selection(chosen: Mapping[str, Any]) -> str:
    """Writes a selection of cells for readers."""
    return ", ".join(
        worded(value) if name in ("backend", "dataset", "measure") else f"{name} {worded(value)}"
        for name, value in chosen.items()
    )


def _bound(claim: Claim) -> str:
    if isfinite(claim.low) and isfinite(claim.high):
        return f"{number(claim.low)} to {number(claim.high)}"
    if isfinite(claim.low):
        return f"above {number(claim.low)}"
    return f"below {number(claim.high)}" if isfinite(claim.high) else ""


def interval(low: float, high: float) -> str:
    """Writes an interval."""
    if low == high:
        return number(low)
    return f"{number(low)} to {number(high)}" if low < 0 else f"{number(low)}\N{EN DASH}{number(high)}"


def _said(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, int):
        return f"{value:,}"
    return "" if isnan(value) else number(value)


def median_grid(found: Medians) -> Grid:
    """Makes a figure's table: one row per x and column per `by`; one row each where one is the other, or many."""
    x, by = found.figure.x, found.figure.by
    measure = about(found.figure.y).with_unit
    caption = f"{measure[:1].upper()}{measure[1:]}: medians, {ENDS}, number of runs"
    if x == by or len(found.bys) == 1:
        places = [found.places[one, by_] for one in found.xs for by_ in found.bys if (one, by_) in found.places]
        rows = [[Entry(worded(p.x)), _entry(p, found), *_printed(p.x, found)] for p in places]
        return Grid(caption, [x, "median", *found.figure.printed], rows)
    if len(found.bys) <= MOST_COLUMNS:
        rows = [
            [
                Entry(worded(one)),
                *(_entry(found.places.get((one, other)), found) for other in found.bys),
                *_printed(one, found),
            ]
            for one in found.xs
        ]
        return Grid(caption, [x, *(found.called[other] for other in found.bys), *found.figure.printed], rows)
    places = [found.places[one, other] for other in found.bys for one in found.xs if (one, other) in found.places]
    rows = [[Entry(found.called[p.by]), Entry(worded(p.x)), _entry(p, found), *_printed(p.x, found)] for p in places]
    return Grid(caption, [by, x, "median", *found.figure.printed], rows)


def _printed(x: Any, found: Medians) -> list[Entry]:
    """Makes the entries of published values at x."""
    shown = about(found.figure.y).kind.shown
    return [Entry(shown(values[x]) if x in values else "") for values in found.figure.printed.values()]


def _entry(place: Place | None, found: Medians) -> Entry:
    if place is None:
        return Entry("")
    failed = f"{place.failed} failed" if place.failed else ""
    waiting = f"{place.waiting} waiting" if place.waiting else ""
    if not place.n:
        return Entry("", note=", ".join(filter(None, (failed, waiting))))
    text = about(found.figure.y).kind.shown(place.value)
    ends = "" if place.low == place.high else interval(place.low, place.high)
    return Entry(text, note=", ".join(filter(None, (ends, f"n {place.n:,}", failed, waiting))))
