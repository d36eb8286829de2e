"""Finds regressions and gains between two runs, with their significance.

Values are paired by log. Accuracy and consistency count a failure as infinitely bad; costs are of the cells that are
done in both runs. A test is corrected by Holm's method over all of its kind: accuracy, consistency, a cost. A cost that
both runs measured in enough rounds needs no test: all of the interval of its ratio over the rounds has to be beyond the
least that counts.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..record.schema import FAILED, Row
from ..words.numerals import chance, counted, listed, number
from .costs import BetweenRuns, between_runs
from .pairing import Pair, PairedRuns
from .ranking import ROUNDING
from .statistics import FEWEST, LEVEL, Comparison, compare, holm, median_over
from .units import logs_in, units

REGRESSION, GAIN = "regression", "gain"
NOTHING, FEW = "no difference shown", "too few logs to test"
SAME, ROUNDED = "the same to the last bit", "the same to rounding"
NEW, GONE = "new", "gone"
VERDICTS = (REGRESSION, GAIN, FEW, NOTHING, ROUNDED, SAME, NEW, GONE)  # in order of importance


class Quantity(NamedTuple):
    """A compared column; lower is better, of NEES the factor by which it is off 1."""

    column: str
    words: str
    kind: str
    least: float  # change, as a share, that counts

    @property
    def costs(self) -> bool:
        """True where it depends on the machine."""
        return self.kind not in ("accuracy", "consistency")


QUANTITIES = (
    Quantity("ate_m", "ATE online, m", "accuracy", 0.05),
    Quantity("final_ate_m", "ATE final, m", "accuracy", 0.05),
    Quantity("relation_m", "relations online, m", "accuracy", 0.05),
    Quantity("final_relation_m", "relations final, m", "accuracy", 0.05),
    Quantity("map_rmse_m", "map, m", "accuracy", 0.05),
    Quantity("nees", "NEES / 3", "consistency", 0.05),
    Quantity("cpu_s", "CPU time, s", "CPU time", 0.5),
    Quantity("step_us_p50", "step p50, µs", "p50", 0.5),
    Quantity("step_us_p99", "step p99, µs", "p99", 1.0),
    Quantity("peak_mb", "memory, MB", "memory", 0.1),
)
"""Costs count from what two runs of the same thing stay below. On a machine with two cores and others at work on it,
CPU time of 69 backends on datasets that were run twice differed by 7 % in the median, up to 21 % for three in four
and 55 % for nine in ten, though the logs of each agreed with one another; memory by 3 % at most."""


class Change(NamedTuple):
    """The change of one quantity of a backend on a dataset."""

    dataset: str
    backend: str
    quantity: str
    kind: str
    verdict: str
    words: str  # the evidence
    n: int = 0  # logs
    old: float = math.nan  # medians over these
    new: float = math.nan
    ratio: float = math.nan  # new over old, typically; of NEES, of its factor from 1
    low: float = math.nan
    high: float = math.nan
    adjusted: float = math.nan
    effect: float = math.nan  # 1 where the new one is the worse on every log, -1 where it is the better
    beyond: bool = False  # it has changed by `least` or more
    units: int = 0  # independent ones that the logs are of: as many as logs unless these are in clusters


class _Found(NamedTuple):
    pair: Pair
    quantity: Quantity
    old: Mapping[str, float]  # by log
    new: Mapping[str, float]
    comparison: Comparison
    shown: tuple[float, float]
    same: str  # SAME or ROUNDED where it is on every log, else ""
    rounds: BetweenRuns | None  # where both runs have enough of them


def changes(found: PairedRuns, least: float | None = None) -> list[Change]:
    """Compares everything, the worst first; `least` is the share that counts, else each quantity's own."""
    measured = [
        one for pair in found.pairs for quantity in QUANTITIES if (one := _found(pair, quantity, least, found.rounding))
    ]
    told = [change for pair in found.pairs for change in (*_endings(pair), *_lost(pair))]
    for kind in dict.fromkeys(one.quantity.kind for one in measured):
        of_kind = [one for one in measured if one.quantity.kind == kind]
        tested = [one for one in of_kind if not one.same and one.comparison.units >= FEWEST and one.rounds is None]
        adjusted = dict(zip(map(id, tested), holm([one.comparison.p for one in tested]).tolist(), strict=True))
        for one in of_kind:
            corrected = one.comparison._replace(adjusted=adjusted.get(id(one), math.nan))
            told.append(_change(one._replace(comparison=corrected), len(tested)))
    told += [Change(*key, "", "", NEW, "only in the new run") for key in found.added]
    told += [Change(*key, "", "", GONE, "only in the old run") for key in found.gone]
    return sorted(told, key=lambda change: VERDICTS.index(change.verdict))


def _found(pair: Pair, quantity: Quantity, least: float | None, rounding: float) -> _Found | None:
    """Collects the quantity's values of both runs; None where they have none in common."""
    if quantity.costs and not pair.timed:
        return None
    if least is not None:
        quantity = quantity._replace(least=least)
    cells = pair.cells if quantity.costs else pair.measured
    column = quantity.column
    if column == "map_rmse_m" and any(row.columns["final_map_rmse_m"] is not None for both in cells for row in both):
        column = "final_map_rmse_m"
    values = [(str(a.columns["seed"]), _value(a, column), _value(b, column)) for a, b in cells]
    known = [(log, a, b) for log, a, b in values if a is not None and b is not None]
    if quantity.costs:
        known = [(log, a, b) for log, a, b in known if math.isfinite(a) and math.isfinite(b) and min(a, b) > 0]
    if not any(math.isfinite(value) for _, a, b in known for value in (a, b)):
        return None
    of = units({str(b.columns["seed"]): b.columns["cluster"] for _, b in cells})
    shown = median_over({log: a for log, a, _ in known}, of), median_over({log: b for log, _, b in known}, of)
    if column == "nees":
        known = [(log, _off(a), _off(b)) for log, a, b in known]
    old, new = {log: a for log, a, _ in known}, {log: b for log, _, b in known}
    least_error = ROUNDING if quantity.kind == "accuracy" else 0.0
    apart = {
        name: {log: max(value, least_error) for log, value in of.items()} for name, of in (("old", old), ("new", new))
    }
    comparison, repeated = compare(apart, of)[0], between_runs(_done(cells), column) if quantity.costs else None
    if repeated is not None:
        comparison = comparison._replace(ratio=repeated.ratio, low=repeated.low, high=repeated.high, p=math.nan)
    return _Found(pair, quantity, old, new, comparison, shown, _same(old, new, rounding), repeated)


def _done(cells: Sequence[tuple[Row, Row]]) -> list[tuple[Row, Row]]:
    return [both for both in cells if all(row.columns["status"] == "done" for row in both)]


def _same(old: Mapping[str, float], new: Mapping[str, float], rounding: float) -> str:
    """Returns SAME or ROUNDED where the values by log are, to a relative `rounding`; else ""."""
    if old == new:
        return SAME
    return ROUNDED if all(math.isclose(old[log], new[log], rel_tol=rounding) for log in old) else ""


def _value(row: Row, column: str) -> float | None:
    return math.inf if row.columns["status"] in FAILED else row.columns[column]


def _off(nees: float) -> float:
    """The factor by which it is off 1."""
    return max(nees, 1 / nees) if nees else math.inf


def _change(one: _Found, tested: int) -> Change:
    """Describes the change; `tested` is how many tests its own is corrected for."""
    verdict, words = _judged(one, tested)
    c = one.comparison
    return Change(
        one.pair.dataset, one.pair.backend, one.quantity.words, one.quantity.kind, verdict, words,
        c.n, *one.shown, c.ratio, c.low, c.high, c.adjusted, c.effect, _beyond(one), c.units,
    )  # fmt: skip


def _beyond(one: _Found) -> bool:
    return not 1 / (1 + one.quantity.least) <= one.comparison.ratio <= 1 + one.quantity.least


def _judged(one: _Found, tested: int) -> tuple[str, str]:
    c, count = one.comparison, f"less than the {100 * one.quantity.least:g} % that count"
    if one.same:
        return one.same, _logs(one)
    if one.rounds is not None:
        said = f"{_logs(one)}, {one.rounds.rounds[0]} and {one.rounds.rounds[1]} rounds"
        least = 1 + one.quantity.least
        if c.low > least or c.high < 1 / least:
            return (REGRESSION if c.ratio > 1 else GAIN), said
        return NOTHING, f"{said}: not wholly beyond the {100 * one.quantity.least:g} % that count"
    towards = (REGRESSION if c.ratio > 1 else GAIN) if _beyond(one) else NOTHING
    if c.units >= FEWEST and _least_p(c.units, tested) < LEVEL:
        if not c.holds:
            return NOTHING, f"{_logs(one)}, {chance(c.adjusted)}"
        return towards, f"{_logs(one)}, {chance(c.adjusted)}" + f": real, but {count}" * (towards == NOTHING)
    if not one.quantity.costs and not one.pair.random and one.pair.by_log:
        on = "on this log" if c.n == 1 else f"on these {c.n} logs"
        return towards, f"{on}: {count if towards == NOTHING else 'the same factors, and nothing random'}"
    enough = next(n for n in range(FEWEST, 99) if _least_p(n, max(tested, 1)) < LEVEL)
    return FEW, f"{_logs(one)}, a test of so many comparisons needs {enough}" + " clusters" * (c.units < c.n)


def _least_p(n: int, tested: int) -> float:
    """The least p of a signed-rank test on n units, corrected for so many tests."""
    return 2.0 ** (1 - n) * tested


def _logs(one: _Found) -> str:
    n, digests = one.comparison.n, {b.columns["digest"] for _, b in one.pair.cells}
    return logs_in(n, one.comparison.units) if len(digests) > 1 or n == 1 else f"{n} runs on one log"


def _endings(pair: Pair) -> list[Change]:
    """Reports cells that were done and are not any more, whatever the statistics; and the other way round."""
    broken = [b for a, b in pair.cells if a.columns["status"] == "done" != b.columns["status"]]
    mended = [b for a, b in pair.cells if a.columns["status"] != "done" == b.columns["status"]]
    failures = [float(sum(both[k].columns["status"] != "done" for both in pair.cells)) for k in (0, 1)]
    n = len(pair.cells)
    told: list[Change] = []
    for rows, verdict, what in ((broken, REGRESSION, "done before, not now"), (mended, GAIN, "done now, not before")):
        if rows:
            seeds = listed([str(row.columns["seed"]) for row in rows])
            words = f"{what}: seed{'s' * (len(rows) > 1)} {seeds}" + (_reason(rows[0]) if rows is broken else "")
            ended = Change(pair.dataset, pair.backend, "failures", "failures", verdict, words, n)
            told.append(ended._replace(old=failures[0], new=failures[1]))
    return told


def _lost(pair: Pair) -> list[Change]:
    """Reports quantities that done cells had and have not any more, and those that are infinite only now."""
    told: list[Change] = []
    done = [both for both in pair.measured if both[0].columns["status"] == both[1].columns["status"] == "done"]
    for quantity in QUANTITIES:
        values = [(b, a.columns[quantity.column], b.columns[quantity.column]) for a, b in done]
        gone = [b for b, old, new in values if old is not None and new is None]
        failed = [b for b, old, new in values if old is None and new is not None and not math.isfinite(new)]
        for rows, how in ((gone, "had one before, has none now"), (failed, "had none before, has an infinite one now")):
            if rows and not quantity.costs:
                words = f"{how}: seed{'s' * (len(rows) > 1)} {listed([str(row.columns['seed']) for row in rows])}"
                told.append(
                    Change(pair.dataset, pair.backend, quantity.words, quantity.kind, REGRESSION, words, len(done))
                )
    return told


def _reason(row: Row) -> str:
    said = row.columns["reason"] or ""
    return f" ({row.columns['status']}{': ' * bool(said)}{said})"


def summary(told: Sequence[Change]) -> str:
    """Counts regressions and gains in a line."""
    counts = {verdict: sum(change.verdict == verdict for change in told) for verdict in VERDICTS}
    said = counted(counts[REGRESSION], "regression") if counts[REGRESSION] else "no regression"
    return f"{said}, {counted(counts[GAIN], 'gain') if counts[GAIN] else 'no gain'}"


def rest(told: Sequence[Change]) -> str:
    """Counts all other comparisons by their result, in a sentence."""
    counts = {verdict: sum(change.verdict == verdict for change in told) for verdict in VERDICTS}
    said = [f"{counts[verdict]} {verdict}" for verdict in (SAME, ROUNDED, NOTHING, FEW) if counts[verdict]]
    large = sum(change.verdict == FEW and change.beyond for change in told)
    if large:
        said[-1] += f", {large} of them changed by more than the least that counts"
    return f"{counted(len(told), 'comparison')}: {'; '.join(said)}." if said else f"{counted(len(told), 'comparison')}."


def by_how_much(change: Change) -> str:
    """Writes the typical change with its interval: +12 % (+8 % to +15 %), or 2.30 times (2.10 to 2.60)."""
    if change.verdict in (SAME, ROUNDED) or math.isnan(change.ratio):
        return ""
    said = _percent(change.ratio)
    if change.low > 0 and math.isfinite(change.high):
        low, high = _percent(change.low), _percent(change.high)
        if low.endswith(" times") and high.endswith(" times"):
            low, high = low.removesuffix(" times"), high.removesuffix(" times")
        said += f" ({low} to {high})"
    return said


def _percent(ratio: float) -> str:
    if ratio == 0 or math.isinf(ratio):
        return "from failing" if ratio == 0 else "to failing"
    if 0.5 <= ratio < 2:
        percent = 100 * (ratio - 1)
        return f"{percent:+.{0 if abs(percent) >= 0.95 else 1}f} %".replace("-", "\N{MINUS SIGN}")
    return f"{number(ratio)} times"


def regressed(told: Sequence[Change]) -> bool:
    """True if anything has become worse."""
    return any(change.verdict == REGRESSION for change in told)


def as_json(change: Change) -> dict[str, Any]:
    """The change by name, for JSON: NaN is None, infinity a text."""
    return {
        name: value
        if not isinstance(value, float) or math.isfinite(value)
        else None
        if math.isnan(value)
        else str(value)
        for name, value in change._asdict().items()
    }
