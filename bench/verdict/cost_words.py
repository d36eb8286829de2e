"""Says in words what costs bear: how two compare, how they grow along a log, and how they were measured."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..measure.growth import NO_GROWTH, Slope
from ..measure.repeats import FEWEST_ROUNDS
from ..words.columns import about
from ..words.numerals import counted, factor, listed, number, raised, times
from ..words.styles import BASELINE
from .costs import MARGIN, CostRatio, rounds
from .statistics import FEWEST, median
from .summary import Line

MANY = 1e6  # a ratio that is written in full below it


def compared(c: CostRatio | None, rival: str) -> str:
    """Writes "18 to 24 times cheaper than isam2", "as costly", or what is left open; "" where nothing is borne."""
    if c is None or c.standing == "few":
        return ""
    than = f" than {rival}" * bool(rival)
    if c.standing == "cheaper":
        return f"{times(c.low, c.high)} cheaper{than}"
    if c.standing == "dearer":
        return f"{times(1 / c.high, 1 / c.low)} as costly{f' as {rival}' * bool(rival)}"
    if c.standing == "alike":
        return "about as costly" + f" as {rival}" * bool(rival)
    near = f"too near to the {MARGIN:g} times that load alone may do"
    if c.low > 1:
        return f"measured {times(c.low, c.high)} cheaper{than}, {near}"
    if c.high < 1:
        return f"measured {times(1 / c.high, 1 / c.low)} as costly{f' as {rival}' * bool(rival)}, {near}"
    return f"not told apart in cost{f' from {rival}' * bool(rival)} ({ends(c)})"


def ends(c: CostRatio) -> str:
    """Writes "between 1.2 times as costly and 1.8 times cheaper"."""
    low = f"{factor(1 / c.low)} times as costly" if c.low < 1 else f"{factor(c.low)} times cheaper"
    high = f"{factor(1 / c.high)} times as costly" if c.high < 1 else f"{factor(c.high)} times cheaper"
    return f"between {low} and {high}"


def slope(line: Line, column: str = "slope_steps") -> Slope | None:
    """A slope of a step's cost along a long log: the median over logs with its interval, or of few, that of one."""
    low, high = (line.values.get(f"{column}_{end}") for end in ("low", "high"))
    if column not in line.values or low is None or high is None:
        return None
    found = line.estimate(column)
    if found.units >= FEWEST:
        return Slope(found.value, found.low, found.high)
    return Slope(found.value, low.median, high.median)


def ends_of(found: Slope) -> str:
    """Writes the interval of a slope, 0.60 to 0.80."""
    shown = about("slope_steps").kind.shown
    return f"{shown(found.low)} to {shown(found.high)}"


def whole_map(lines: Sequence[Line]) -> int:
    """The first step of those that the slopes are fitted to, if the map is whole there; else 0."""
    first: list[int] = []
    for line in lines:
        start, whole = _step(line, "slope_from"), _step(line, "whole_from")
        if start is not None and whole is not None:
            first.append(start if whole <= start else 0)
    return min(first, default=0)


def _step(line: Line, column: str) -> int | None:
    """A step of a log, the median over logs; None where it is not known."""
    found = line.values[column].median if column in line.values else math.nan
    return int(found) if math.isfinite(found) else None


def grown(lines: Sequence[Line]) -> str:
    """Says with which backends the cost of a step grows along the log, and how much; "" of short logs."""
    found = [(line, s) for line in lines if line.backend != BASELINE and (s := slope(line)) is not None]
    whole = whole_map(lines)
    ratio, first = ("last_over_whole", " with the whole map") if whole else ("last_over_first", "")
    grows, flat, left = list[str](), list[str](), list[str]()
    for line, s in found:
        interval = f"({ends_of(s)})"
        if s.low > 0 and s.exponent >= NO_GROWTH:
            said = f"with {line.backend} as steps{raised(f'{s.exponent:.2f}')} {interval}"
            if ratio in line.values:
                more = line.values[ratio].median
                fifths = "" if grows else f" from the first fifth of the log{first} to the last"
                said += f", {factor(more) if 1 <= more < MANY else number(more)} times{fifths}"
            grows.append(said)
        elif s.high < NO_GROWTH:
            flat.append(line.backend)
        else:
            left.append(f"{line.backend} {interval}")
    said = [f"grows {'; '.join(grows)}"] * bool(grows)
    said += [f"does not grow with {listed(flat)}"] * bool(flat)
    said += [f"may or may not grow with {listed(left)}"] * bool(left)
    if not said:
        return ""
    more = _map_growth([line for line, _ in found], whole) if whole or grows or left else ""
    return f"The cost of a step {'; it '.join(said)}.{more}"


def _map_growth(lines: Sequence[Line], whole: int) -> str:
    """Says which steps the slopes are of, and with which backends costs grew before; `whole` is `whole_map`."""
    if not whole:
        late = max((_step(line, "whole_from") or 0 for line in lines), default=0)
        if not late:
            return ""
        return (
            f" The map grows until step {late:,}: what costs more with a larger map is not told apart from what "
            "costs more with time."
        )
    before = [
        f"with {line.backend} as steps{raised(f'{s.exponent:.2f}')} ({ends_of(s)})"
        for line in lines
        if (s := slope(line, "slope_mapping")) is not None and s.low > 0 and s.exponent >= NO_GROWTH
    ]
    grew = f" While the map grew, so did the cost {listed(before)}." if before else ""
    return f" Counted from step {whole:,} on, once the map is whole.{grew}"


def basis(lines: Sequence[Line]) -> str:
    """Says how often costs were measured, and what therefore is not claimed of them."""
    timed = [line for line in lines if line.done and "cpu_s" in line.values]
    if len(timed) < 2:
        return ""
    number_of = {line.backend: rounds(line) for line in timed}
    n = max(number_of.values())
    if n == 1:
        return "Each cell was timed once, so none is called cheaper; --repeats 5 measures intervals."
    if n < FEWEST_ROUNDS:
        return f"Every time was measured in {n} rounds, too few for intervals, {FEWEST_ROUNDS} at least (--repeats)."
    said = f"Times are medians of {n} rounds"
    if few := {backend: count for backend, count in number_of.items() if count < FEWEST_ROUNDS}:
        seldom = "once" if max(few.values()) == 1 else "too seldom"
        said += f"; those of {listed([*few])} were measured {seldom}, and are not compared (--repeats {n} does)"
    if len(timed) - len(few) < 2:
        return f"{said}."
    return f"{said}. One is called cheaper only beyond {MARGIN:g} times: load shifts ratios, too."


def meanwhile(lines: Sequence[Line]) -> str:
    """Says what the machine did while the lines' cells were timed; "" without several rounds."""
    found = [one for line in lines for row in line.rows for one in row.rounds if one["status"] == "done"]
    if max(map(rounds, lines), default=1) < 2 or not found:
        return ""
    said: list[str] = []
    work = _range(found, "work_us")
    if work:
        said.append(f"a fixed piece of work took {number(work[1])} µs ({number(work[0])} to {number(work[2])})")
    shares = {"others_share": "others took {} of all cores", "waited_share": "a backend waited {} of the time"}
    for name, what in shares.items():
        share = _range(found, name)
        if share:
            said.append(f"{what.format(_percent(share[1]))} (up to {_percent(share[2])})")
    load = _range(found, "load")
    if load:
        said.append(f"the load was {' to '.join(dict.fromkeys((number(load[0]), number(load[2]))))}")
    return f"Meanwhile {listed(said)}; medians." if said else ""


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _range(found: Sequence[Mapping[str, Any]], column: str) -> tuple[float, float, float] | None:
    values = sorted(one[column] for one in found if one[column] is not None)
    return (values[0], median(values), values[-1]) if values else None


def repeat_troubles(lines: Sequence[Line]) -> list[str]:
    """Names backends that did something else in a repeat, and repeats that failed."""
    said: list[str] = []
    for line in lines:
        other = sum(any(_differs(row.rounds[0], one) for one in row.rounds[1:]) for row in line.rows)
        if other:
            said.append(
                f"{line.backend} is not deterministic: on {other} of {counted(len(line.rows), 'cell')} a repeat with "
                "the same seed found another path. Errors are those of the first round."
            )
        failed = [one for row in line.rows for one in row.rounds if one["status"] != "done"]
        if failed:
            of = sum(len(row.rounds) for row in line.rows)
            reason = f"{failed[0]['status']}: {failed[0]['reason'] or ''}"
            said.append(f"{line.backend} failed in {len(failed)} of {counted(of, 'timing')} ({reason.rstrip(': ')}).")
    return said


def _differs(first: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return other["status"] == "done" and other["path"] != first["path"]
