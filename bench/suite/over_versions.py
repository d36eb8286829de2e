"""The results of a suite over its versions: medians, a sparkline, and the change since the version before."""

from collections.abc import Mapping, Sequence
from math import isfinite, isnan, log
from typing import NamedTuple

from ..verdict.changes import GAIN, REGRESSION, Change, by_how_much, summary
from ..verdict.summary import Line, typical
from ..words.columns import about
from ..words.names import called
from ..words.numerals import number
from .history import Summary, since

SHOWN = 8  # versions of which medians are drawn
WIDE, HIGH = 72.0, 16.0  # of a sparkline
ERRORS = ("ate_m", "relation_m", "final_ate_m", "final_relation_m", "map_rmse_m")  # the first that a backend has
COST = {"ate_m": "step_us_p50", "relation_m": "step_us_p50"}  # of an online path; else the whole log's time


class Trend(NamedTuple):
    """One quantity of a backend over versions."""

    column: str
    heading: str
    now: str  # with its unit
    values: Sequence[float]  # one per version that is drawn; NaN where it has none
    points: str  # of a polyline; "" where fewer than two versions have it
    words: str  # by how much it changed since the version before
    verdict: str


class TrendRow(NamedTuple):
    """A backend on a dataset over versions."""

    dataset: str
    backend: str
    trends: Sequence[Trend]  # error, NEES and cost


class OverVersions(NamedTuple):
    """A suite over its versions."""

    versions: Sequence[Summary]  # those that are drawn, the oldest first
    rows: Sequence[TrendRow]
    notes: Sequence[str]
    summary: str  # regressions and gains since the version before
    worse: bool


def over_versions(kept: Sequence[Summary]) -> OverVersions:
    """Compares the newest of two summaries or more with the one before, and draws the newest SHOWN."""
    shown = kept[-SHOWN:]
    old, new = kept[-2:]
    changes, notes = since(old, new)
    rows = [
        TrendRow(dataset, backend, _trends(line, shown, run, changes))
        for run in new.runs
        for (dataset, backend), line in new.lines(run).items()
    ]
    names = called([row.dataset for row in rows])
    named = [row._replace(dataset=names[row.dataset]) for row in rows]
    worse = any(change.verdict == REGRESSION for change in changes.values())
    return OverVersions(shown, named, notes, summary(list(changes.values())), worse)


def _trends(
    line: Line, shown: Sequence[Summary], run: str, changes: Mapping[tuple[str, str, str], Change]
) -> list[Trend]:
    error = next((name for name in ERRORS if name in line.values), "")
    columns = [name for name in (error, "nees", COST.get(error, "cpu_s")) if name in line.values]
    return [_trend(line, name, shown, run, changes.get((line.dataset, line.backend, name))) for name in columns]


def _trend(line: Line, column: str, shown: Sequence[Summary], run: str, change: Change | None) -> Trend:
    values: list[float] = []
    for one in shown:
        before = one.lines(run).get((line.dataset, line.backend)) if run in one.runs else None
        known = before is not None and column in before.values
        values.append(typical(before, column).value if known and before is not None else float("nan"))
    kind = about(column).kind
    now = f"{number(values[-1])} {kind.unit}".strip()
    words, verdict = ("", "") if change is None else (by_how_much(change) or change.verdict, change.verdict)
    return Trend(column, about(column).heading, now, values, points(values), words, _mark(verdict))


def _mark(verdict: str) -> str:
    return {REGRESSION: "worse", GAIN: "better"}.get(verdict, "")


def points(values: Sequence[float]) -> str:
    """The points of a sparkline on a logarithmic scale of at least a factor of 1.2; "" for fewer than two."""
    known = [(k, log(value)) for k, value in enumerate(values) if not isnan(value) and isfinite(value) and value > 0]
    if len(known) < 2:
        return ""
    low, high = min(value for _, value in known), max(value for _, value in known)
    middle, half = (low + high) / 2, max((high - low) / 2, log(1.2) / 2)
    across = WIDE / max(1, len(values) - 1)
    return " ".join(f"{k * across:.1f},{HIGH / 2 - (value - middle) / half * (HIGH / 2 - 2):.1f}" for k, value in known)
