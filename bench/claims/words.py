"""Writes the words of an answer: values with units, intervals, bounds, and remarks on cells."""

from collections.abc import Callable, Sequence
from math import inf, isinf, isnan

from ..verdict.units import logs_in
from ..words.columns import about
from ..words.numerals import chance, counted, larger, listed, number, plain, times
from .side import Side


def sized(value: float, measure: str) -> str:
    """Writes 0.0213 m; infinite because cells failed: failed."""
    if isinf(value) and about(measure).kind.is_error:
        return "failed"
    return number(value) + _unit(measure)


def _unit(measure: str) -> str:
    unit = about(measure).kind.unit
    return f" {unit}" if unit else ""


def bounds(low: float, high: float, measure: str = "") -> str:
    """Writes above 2; below 0.1 m; within 1 to 2."""
    unit = _unit(measure)
    if isinf(low):
        return f"below {plain(high)}{unit}"
    return f"above {plain(low)}{unit}" if isinf(high) else f"within {plain(low)} to {plain(high)}{unit}"


def interval(low: float, high: float, n: int, units: int, written: Callable[[float], str] = number) -> str:
    """Writes 95 % interval 1.2 to 2.3; 50 logs. The logs alone where there are too few for one."""
    logs = logs_in(n, units)
    if isnan(low):
        return logs
    if (low, high) == (-inf, inf):
        return f"95 % interval: anything; {logs}"
    return f"95 % interval {written(low)} to {written(high)}; {logs}"


def tested(n: int, units: int, low: float, p: float | None) -> str:
    """Writes 95 % interval; 50 logs, p < 0.0001. The logs alone where there are too few for either."""
    logs = logs_in(n, units)
    if isnan(low):
        return logs
    return f"95 % interval; {logs}" if p is None or isnan(p) else f"95 % interval; {logs}, {chance(p)}"


def ratio(low: float, high: float, *, fine: bool) -> str:
    """Writes how much less or more the first is if the second is `low` to `high` times it; `fine`: three digits."""
    if low == high == 1:
        return "the same on every log"
    if low >= 1:
        return f"{_times(low, high, fine=fine)} less"
    more, most = (1 / end if end else inf for end in (high, low))
    if high <= 1:
        return f"{_times(more, most, fine=fine)} more"
    if fine:
        return f"{number(low)} to {number(high)} times"
    return f"between {larger(most)} more and {larger(high)} less"


def _times(low: float, high: float, *, fine: bool) -> str:
    if isinf(low):
        return "infinitely many times"
    if not fine:
        return times(low, high)
    if isinf(high):
        return f"at least {number(low)} times"
    one, other = number(low), number(high)
    return f"{one} times" if one == other else f"{one} to {other} times"


def exponent(value: float) -> str:
    """Writes 2.01: of exponents the difference counts, not the ratio."""
    return number(value) if isinf(value) else f"{value:.2f}"


def remarks(sides: Sequence[Side]) -> list[str]:
    """Remarks on the cells: failures and their effect, missing values, and timing."""
    cells = sum(side.cells for side in sides)
    said: list[str] = []
    failed, unknown = sum(side.failed for side in sides), sum(side.unknown for side in sides)
    if failed:
        worst = "count as the worst" if failed > 1 else "counts as the worst"
        said.append(f"{_of(failed, cells)} failed and {'might have had any value' if unknown == failed else worst}")
    skipped, undefined = sum(side.skipped for side in sides), sum(side.undefined for side in sides)
    if skipped:
        why = {side.why for side in sides if side.skipped}
        reason = f": {why.pop()}" if len(why) == 1 else ""
        said.append(f"{_of(skipped, cells)} {'was' if skipped == 1 else 'were'} skipped{reason.rstrip('.: ')}")
    if undefined:
        said.append(f"{_of(undefined, cells)} had no {listed(list(dict.fromkeys(side.measure for side in sides)))}")
    beside = sum(side.beside for side in sides if about(side.measure).kind.is_time)
    if beside:
        said.append(f"{_of(beside, cells)} {'was' if beside == 1 else 'were'} timed beside others on the same machine")
    return said


def _of(count: int, cells: int) -> str:
    return f"{count:,} of {counted(cells, 'cell')}"
