"""Tests claims on where two sides cross: the value of a parameter from which on the first is the smaller."""

from collections.abc import Hashable, Sequence
from math import inf, isinf, isnan, nan

import numpy as np

from ...core.se2 import Array, Ints
from ..study.study import Claim
from ..verdict.statistics import FEWEST, SAME, Estimate, estimate, log_ratios
from ..words.numerals import counted, number, plain
from .finding import Finding, Verdict, margin, nothing
from .side import Rows, Side, Untestable, pairs
from .words import bounds, interval


def crossing(claim: Claim, first: Side, second: Side) -> Finding:
    """Tests the median of the logs' crossings against the bounds, without any against the study's values.

    On each log the ratio is interpolated in log-log. What a log does not determine is left open: a crossing outside of
    the values is below or beyond them, beyond also where it is the other way round; that of a log that crosses more
    than once, or whose ratio is not finite, lies from the first of its places to the last. The interval is from the low
    end of the median of the first places to the high end of the median of the last ones, and so covers at least as
    often as either's. Untestable with one value.
    """
    both = pairs(first, second)
    if len(set(first.along) | set(second.along)) - (None in (*first.along, *second.along)) < 2:
        raise Untestable(f"{claim.along} has one value, expected two or more for a crossing")
    if len(both.along) < 2 or not both.first.size:
        return nothing("no log has both sides at two values or more")
    x, d = np.array(both.along, float), log_ratios(both.first, both.second)
    early, late = _first(x, np.where(np.isnan(d), np.inf, d)), _last(x, np.where(np.isnan(d), -np.inf, d))
    one, other = _estimate(early, x, both.units), _estimate(late, x, both.units)
    low, high, n, units = one.low, other.high, one.n, one.units
    least, most = (x[0] if isinf(claim.low) else claim.low), (x[-1] if isinf(claim.high) else claim.high)
    outside = low >= most or high <= least
    verdict: Verdict = "fails" if outside else "holds" if least <= low and high <= most else "open"
    at = (one.value * other.value) ** 0.5 if 0 < one.value <= other.value < inf else nan
    with np.errstate(divide="ignore"):
        room = margin(*(float(np.log(end)) for end in (low, high, max(least, 0), most)))
    said = _said(x, at, low, high, n, units)
    return Finding(
        verdict, at, low, high, n, room, said, _wanted(claim, verdict), lost=both.lost, remarks=_remarks(d), units=units
    )


def _wanted(claim: Claim, verdict: Verdict) -> str:
    if isinf(claim.low) and isinf(claim.high):
        return "" if verdict == "holds" else "a crossing"
    return f"{claim.along} {bounds(claim.low, claim.high)}"


def _said(x: Array, at: float, low: float, high: float, n: int, units: int) -> str:
    start, end = plain(float(x[0])), plain(float(x[-1]))
    if units >= FEWEST and high <= x[0]:
        return f"no crossing: less at every value, from {start} on ({interval(nan, nan, n, units)})"
    if units >= FEWEST and low >= x[-1]:
        return f"no crossing: not less at any value, up to {end} ({interval(nan, nan, n, units)})"

    def written(value: float) -> str:
        return f"below {start}" if value < x[0] else f"beyond {end}" if isinf(value) else number(value)

    return f"{'place unknown' if isnan(at) else f'at {number(at)}'} ({interval(low, high, n, units, written)})"


def _remarks(d: Array) -> tuple[str, ...]:
    """Remarks on the logs, rows of (n, m), in which they cross more than once or in the other direction."""
    n, changes = len(d), _changes(d)
    found = {"more than once": changes > 1, "the other way round": (changes == 1) & ~(d[:, -1] > 0)}
    return tuple(
        f"on {logs.sum():,} of {counted(n, 'log')} they cross {how}" for how, logs in found.items() if logs.any()
    )


def _changes(d: Array) -> Ints:
    return np.diff(d > 0, axis=1).sum(axis=1)


def _first(x: Array, d: Array) -> Array:
    """The least place (n,) at which d (n, m) may become positive to stay so; 0 for one below x (m,)."""
    above = d > 0
    above[(_changes(d) == 1) & ~above[:, -1]] = False  # it only ceases to be
    place = above.argmax(axis=1)
    found = _root(x, d, np.maximum(place, 1) - 1, early=True)
    return np.where(above.any(axis=1), np.where(place == 0, 0.0, found), x[-1])


def _last(x: Array, d: Array) -> Array:
    """The greatest place (n,) from which on d (n, m) may be positive; infinite for one beyond x (m,)."""
    m = len(x)
    place = m - 1 - (d <= 0)[:, ::-1].argmax(axis=1)
    found = _root(x, d, np.minimum(place, m - 2), early=False)
    return np.where((d <= 0).any(axis=1), np.where(place == m - 1, np.inf, found), x[0])


def _root(x: Array, d: Array, place: Rows, *, early: bool) -> Array:
    """Returns where d is 0 between this place and the next; either of them where d is not finite at one."""
    rows = np.arange(len(d))
    start, end = np.log(x[place]), np.log(x[place + 1])
    below, above = d[rows, place], d[rows, place + 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = below / (below - above)
    share[~(np.isfinite(below) & np.isfinite(above))] = 0.0 if early else 1.0
    return np.exp(start + share * (end - start))


def _estimate(places: Array, x: Array, units: Sequence[Hashable]) -> Estimate:
    """Estimates the median on a logarithmic scale; exactly at an end of x (m,) if it is there but for rounding."""
    with np.errstate(divide="ignore"):
        found = estimate(np.log(places).tolist(), units)
    ends = np.exp([found.value, found.low, found.high])
    for end in (x[0], x[-1]):
        ends[np.isclose(ends, end, rtol=SAME, atol=0)] = end
    value, low, high = ends.tolist()
    return Estimate(value, low, high, found.n, found.units)
