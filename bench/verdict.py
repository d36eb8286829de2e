"""What was measured, in plain sentences: medians and ranges over seeds, nothing about what other seeds would show."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .looks import BASELINE
from .numerals import counted, listed, number
from .statistics import Comparison
from .summary import Line, Spread, logs, short

_REFERENCE = (
    "Nobody knows where the robot was; errors here are distances from a reference, {} of the same factors, which "
    "smoothers come close to by construction."
)
_SURVEYED = " The landmarks' places are known: the map's error is one, all landmarks aligned by themselves."

LOST = 10.0
"""Mean NEES over its degrees of freedom from which on a belief has nothing to do with its error."""

_NOBODY = (
    " None of them has a belief that fits this log: noise stated too small, wrong ids, landmarks that move, or clocks "
    "that differ would do that to all alike; bench show tells more of the log."
)


ACCURACY = ("ate_m", "final_ate_m")
"""What backends are compared by where the path is known: the online path, and the one smoothed at the end."""


class Use(NamedTuple):
    """Which backend to use for something."""

    purpose: str  # "online", "final" or "map"
    backend: str  # its label; "" where the evidence names none
    why: str  # a sentence


class Verdict(NamedTuple):
    """What can be said of the backends on a dataset."""

    basis: str  # what it rests on: how many logs, and what is known of them
    uses: Sequence[Use]
    sentences: Sequence[str]  # the most important first
    comparisons: Mapping[str, Sequence[Comparison]]  # by column, every pair that was compared


def verdict(lines: Sequence[Line]) -> Verdict:
    """The verdict on one dataset."""
    return Verdict(counted(logs(lines), "log"), (), headline(lines), {})


def headline(lines: Sequence[Line]) -> list[str]:
    """The sentences on a dataset, the most important first."""
    name = f"{short(lines[0].dataset)}, {counted(logs(lines), 'log')}"
    if not any(line.done for line in lines):
        return [f"{name}: no cell is done.", *_not_done(lines)]
    if lines[0].truth_kind == "truth":
        said = [f"{name}: {sentence}" for sentence in _ranking(lines, "ate_m", "online path")[:1]]
        said += [f"Smoothed at the end of the log: {s}" for s in _ranking(lines, "final_ate_m", "final path")]
        said = (said or [f"{name}: no backend gave a path."]) + _beliefs(lines)
    elif lines[0].truth_kind == "reference":
        reference = _REFERENCE.format(lines[0].reference) + _SURVEYED * lines[0].surveyed
        said = [f"{name}: no verdict on accuracy of paths. {reference}"]
        if lines[0].surveyed:
            said += _ranking(lines, "map_rmse_m", "online map", "RMSE")
            said += [f"At the end of the log: {s}" for s in _ranking(lines, "final_map_rmse_m", "final map", "RMSE")]
    else:
        said = [f"{name}: no verdict on accuracy. There is no known path to hold the estimates against."]
    return said + _cost(lines) + _not_done(lines)


def belief_word(line: Line) -> str:
    """consistent, overconfident or cautious where that is clear from NEES in every seed, else ""."""
    nees, inside = line.values.get("nees"), line.values.get("nees_inside")
    if nees is None or inside is None:
        return ""
    if nees.low > 2 and inside.high < 0.9:
        return "overconfident"
    if nees.high < 0.5:
        return "cautious"
    return "consistent" if nees.low >= 0.5 and nees.high <= 2 and inside.low >= 0.85 else ""


def ranked(lines: Sequence[Line], column: str) -> list[Line]:
    """The lines that have the column, the lowest median first.

    Without those that have cells missing, as long as there are others: what is left of them is their luckier seeds.
    One that was told the truth does not compete.
    """
    having = [line for line in lines if column in line.values and not line.told]
    whole = [line for line in having if line.done == len(line.rows)]
    return sorted(whole or having, key=lambda line: line.values[column].median)


def _ranking(lines: Sequence[Line], column: str, what: str, measure: str = "ATE") -> list[str]:
    """Whose error is the lowest, and how many times that the others' are; [] where nobody has the column.

    Those whose ranges over the seeds overlap with the lowest one's are named together, with the cheapest of them.
    """
    found = ranked(lines, column)
    if not found:
        return []
    best = found[0].values[column]
    level = [line for line in found if line is found[0] or _overlap(line.values[column], best)]
    if len(level) > 1:
        medians = listed([number(line.values[column].median) for line in level])
        cheapest = min(level, key=lambda line: line.values["cpu_s"].median if "cpu_s" in line.values else float("inf"))
        said = f"{listed([line.backend for line in level])} have the lowest errors of the {what}, and their ranges "
        said += f"overlap (median {measure} {medians} m, {best.n} seeds); the cheapest of them is {cheapest.backend}"
    elif len(found) > 1:
        said = f"{found[0].backend}'s {what} has the lowest error ({_error(best, measure)})"
    else:
        said = f"{found[0].backend}'s {what} has {_error(best, measure)}"
    for line in found:
        if line not in level:
            said += f"; {line.backend} {_times(line.values[column], best)}"
    left = [
        f"{line.backend} ({line.done} of {len(line.rows)} done)"
        for line in lines
        if column in line.values and all(line is not other for other in found) and not line.told
    ]
    left += [f"{line.backend} (was told the truth)" for line in lines if column in line.values and line.told]
    return [f"{said}{f'; not ranked: {listed(left)}' if left else ''}."]


def _overlap(value: Spread, best: Spread) -> bool:
    return best.n > 1 and value.n > 1 and value.low <= best.high


def _error(value: Spread, measure: str) -> str:
    if value.n == 1:
        return f"{measure} {number(value.median)} m in one seed"
    return (
        f"median {measure} {number(value.median)} m, {number(value.low)} to {number(value.high)} over {value.n} seeds"
    )


def _times(value: Spread, best: Spread) -> str:
    return f"{number(value.median)} m" if best.median == 0 else f"{number(value.median / best.median)} times that"


def _beliefs(lines: Sequence[Line]) -> list[str]:
    """How sure of themselves they are, clear or not."""
    words = {line.backend: belief_word(line) or "not clearly either" for line in lines if "nees" in line.values}
    said = [
        f"{listed(names)} {'is' if len(names) == 1 else 'are'} {word}"
        for word in ("consistent", "overconfident", "cautious", "not clearly either")
        if (names := [backend for backend, found in words.items() if found == word])
    ]
    if set(words.values()) <= {"not clearly either"}:
        return []
    using = [line for line in lines if "nees" in line.values and line.backend != BASELINE]
    lost = len(using) > 1 and all(line.values["nees"].median > LOST for line in using)
    return [f"By NEES, {'; '.join(said)}.{_NOBODY * lost}"]


def _cost(lines: Sequence[Line]) -> list[str]:
    """CPU time for the whole log: the one figure that filters, smoothers and batch methods have in common."""
    found = sorted(
        (line.values["cpu_s"].median, line.backend + "*" * (not line.alone))
        for line in lines
        if "cpu_s" in line.values and line.backend != BASELINE
    )
    times = listed([f"{label} {number(seconds)} s" for seconds, label in found]) if found else ""
    marked = " (*: while other cells ran beside it)" if "*" in times else ""
    return [f"Median CPU time for the whole log: {times}{marked}."] if times else []


def _not_done(lines: Sequence[Line]) -> list[str]:
    cells = [row.columns["status"] for line in lines for row in line.rows]
    others = {status: cells.count(status) for status in cells if status != "done"}
    if not others:
        return []
    counts = ", ".join(f"{n} {status}" for status, n in others.items())
    return [f"Not every cell is done: {counts} of {len(cells)} (what failed, below)."]
