"""Ranks accuracy in sentences: a difference is claimed only where its interval and the test both support it."""

from collections.abc import Sequence
from math import inf, isinf

from ..words.numerals import chance, counted, factor, larger, listed, number, times
from .ranking import Ranking, needed, standing
from .statistics import FEWEST, Comparison, median, median_over

LEAST = 1.0005  # ratio from which on a percentage of it is not written as 0 %
SHOWN = 3  # comparisons that a sentence spells out; of more only the extremes, and the table of pairs has all


def claims(found: Ranking, what: str, where: str, *, again: bool = False) -> list[str]:
    """Writes the sentences on one measure, the most important first.

    `what` is "online path", `where` the dataset's name. Too few logs for a test give measurements only, `again` without
    the reason.
    """
    if not found.compared:
        return [_measured(found, what, where, again=again), *_runs(found)]
    best, on = found.lines[0].backend, f"on {where}, {found.units}"
    if len(found.lines) == 1:
        error = _errors(found)[best]
        return [f"{best} alone has an estimate of the {what} {on}: median error {error}.", *_baseline(found, what)]
    pairs: dict[str, list[Comparison]] = {}
    for line in found.lines[1:]:
        c = found.between(found.lines[0], line)
        pairs.setdefault(standing(c), []).append(c)
    said = _better(pairs.get("better", []), what, on)
    on = "" if said else f" {on}"
    said += _alike(best, pairs.get("alike", []), what, on)
    if "worse" in pairs:
        names = few([c.second for c in pairs["worse"]])
        said.append(f"No {what} is the best{on}: each is significantly worse than another, {best}'s than {names}'s.")
    said += _open(best, pairs.get("open", []), what, on)
    said += _unproven(best, pairs.get("unproven", []), what, on, len(found.comparisons))
    if "few" in pairs:
        names = listed([f"{c.second} ({c.units})" for c in pairs["few"]])
        said.append(f"Too few {found.units.noun}s in common with {best} to test, {FEWEST} at least: {names}.")
    return [*said, *_baseline(found, what)]


def _better(pairs: Sequence[Comparison], what: str, on: str) -> list[str]:
    """States by how much the best one is significantly better than others."""
    if not pairs:
        return []
    head = f"{pairs[0].first}'s {what} is"
    if len(pairs) == 1:
        (c,) = pairs
        test = f"Wilcoxon, Holm: {chance(c.adjusted)}; closer on {c.closer} of {c.n}"
        if isinf(c.low):
            return [f"{head} closer to the truth than {c.second}'s, which mostly failed, {on} ({test})."]
        return [f"{head} {times(c.low, c.high)} closer to the truth than {c.second}'s {on} ({test})."]
    if len(pairs) <= SHOWN:
        each = [
            f"{by(c)} than {c.second}'s ({_failing(c)}{chance(c.adjusted)}, {c.closer} of {c.n} logs)" for c in pairs
        ]
        return [f"{head} closer to the truth {on}: {listed(each)} (Wilcoxon, Holm)."]
    near, far = min(pairs, key=lambda c: c.low), max(pairs, key=lambda c: c.low)
    ends = f"by {by(near)} ({_failing(near)}{near.second}) up to {by(far)} ({_failing(far)}{far.second})"
    test = f"Wilcoxon, Holm: the largest {chance(max(c.adjusted for c in pairs))}"
    return [f"{head} closer to the truth than those of {len(pairs)} others {on}: {ends} ({test})."]


def by(c: Comparison) -> str:
    """Writes "1.8 to 2.3 times", by which the first is closer; no number where the second mostly failed."""
    return "beyond measure" if isinf(c.low) else times(c.low, c.high)


def _failing(c: Comparison) -> str:
    return "mostly failed, " if isinf(c.low) else ""


def _alike(best: str, pairs: Sequence[Comparison], what: str, on: str) -> list[str]:
    if not pairs:
        return []
    return [f"The {what}s of {few([best, *(c.second for c in pairs)])} are alike{on}: less than 1 % apart."]


def _open(best: str, pairs: Sequence[Comparison], what: str, on: str) -> list[str]:
    """Names those that do not differ significantly from the best, and the difference that is ruled out."""
    if not pairs:
        return []
    widest = max(max(1 / c.low if c.low else inf, c.high) for c in pairs)
    ruled = f"more than {larger(widest)} apart is ruled out" if widest < inf else "failures leave no limit"
    if len(pairs) == 1:
        (c,) = pairs
        head = f"The {what}s of {best} and {c.second} do not differ significantly{on}"
        return [f"{head}: {best} is {between(c)} ({ruled})."]
    names = few([c.second for c in pairs])
    each = "; ".join(f"{between(c)} than {c.second}" for c in pairs) if len(pairs) <= SHOWN else ruled
    return [f"{best}'s {what} does not differ significantly from those of {names}{on}: {each}."]


def between(c: Comparison) -> str:
    """Writes "between 4 % worse and 3 % better", of the first one against the second."""
    worse, better = (1 / c.low if c.low else inf), c.high
    if worse < 1 and isinf(better):
        return "beyond measure better" if not worse else f"at least {factor(c.low)} times better"
    if better < 1 and isinf(worse):
        return "beyond measure worse" if not better else f"at least {factor(1 / better)} times worse"
    if isinf(worse) or isinf(better):
        ends = [(x, way) for x, way in ((worse, "worse"), (better, "better")) if x < inf]
        limits = [f"at most {larger(x)} {way}" if x >= LEAST else f"no {way}" for x, way in ends]
        return limits[0] if limits else "anything from worse to better"
    if worse < 1 or better < 1:
        low, high, way = (1 / worse, better, "better") if worse < 1 else (1 / better, worse, "worse")
        return f"{times(low, high)} {way}" if low >= 1.5 else f"between {larger(low)} and {larger(high)} {way}"
    return f"between {larger(worse)} worse and {larger(better)} better"


def _unproven(best: str, pairs: Sequence[Comparison], what: str, on: str, family: int) -> list[str]:
    """States differences that the interval supports and the test does not."""
    if not pairs:
        return []
    each = [f"{between(c)} than {c.second}'s" for c in pairs[:SHOWN]]
    each += [f"so for {len(pairs) - SHOWN} more"] if len(pairs) > SHOWN else []
    return [f"No claim can be made{on} of {best}'s {what}, measured {listed(each)}: {unborne(pairs, family)}."]


def unborne(pairs: Sequence[Comparison], family: int) -> str:
    """Says why the test does not support a difference that the interval does; `family`: pairs tested."""
    if pairs[0].units < needed(family):
        noun = "clusters" if pairs[0].units < pairs[0].n else "logs"
        tested = counted(family, "pair")
        return f"{pairs[0].units} {noun} are too few to test {tested}, {max(FEWEST, needed(family))} would do"
    return f"the test does not support it (Wilcoxon, Holm: {chance(min(c.adjusted for c in pairs))})"


def _baseline(found: Ranking, what: str) -> list[str]:
    """Names who does not beat dead reckoning; where all do, by how much the best does."""
    tested = [c for c in found.baseline if standing(c) != "few"]
    beaten = [c for c in tested if standing(c) == "better"]
    if not tested:
        return []
    if len(beaten) < len(tested):
        names = [c.first for c in tested if c not in beaten]
        hidden = [c for c in tested if standing(c) == "unproven" and c.low > 1]
        why = f" ({unborne(hidden, len(tested))})" if hidden and len(hidden) == len(names) else ""
        return [
            f"Not significantly closer than dead reckoning's: the {what}{'s' * (len(names) > 1)} of {few(names)}{why}."
        ]
    best, all_of_them = beaten[0], len(beaten) == len(found.lines)
    who = "All beat" if all_of_them else f"{few([c.first for c in beaten])} beat{'s' * (len(beaten) == 1)}"
    who = "It beats" if len(found.lines) == 1 else who
    return [f"{who} dead reckoning, {best.first} {by(best)} closer."]


def _measured(found: Ranking, what: str, where: str, *, again: bool) -> str:
    """States medians alone: there are too few logs to test anything."""
    each = ", ".join(f"{name} {error}" for name, error in _errors(found).items())
    if again:
        return f"Measured{', median' * (found.units.logs > 1)} error of the {what}: {each}."
    if found.units.logs == 1:
        return f"{where} is one log, nothing to test; measured error of the {what}: {each}."
    little = f"{where}: {found.units} are too few to test, {found.units.at_least(FEWEST)}"
    return f"{little}; measured, median error of the {what}: {each}."


def _errors(found: Ranking) -> dict[str, str]:
    medians = {
        line.backend: median([value for _, value in line.runs(found.column)])
        if found.units.logs == 1
        else median_over(found.errors[line.backend], found.units)
        for line in found.lines
    }
    return {name: f"{number(value)} m" if value < inf else "failed" for name, value in medians.items()}


def _runs(found: Ranking) -> list[str]:
    """States the spread of a random backend's runs on a single log, and which backends lie outside of it."""
    if found.units.logs != 1:
        return []
    said: list[str] = []
    for line in found.lines:
        mine = line.values[found.column]
        if mine.n < 2 or mine.low == mine.high:
            continue
        theirs = {o.backend: o.values[found.column] for o in found.lines if o is not line}
        ahead = few([name for name, error in theirs.items() if error.high < mine.low])
        behind = few([name for name, error in theirs.items() if error.low > mine.high])
        outside = [f"all further off than {ahead}"] * bool(ahead) + [f"all closer than {behind}"] * bool(behind)
        said.append(
            f"{line.backend} draws at random: its {mine.n} runs on this log lie between {number(mine.low)} and "
            f"{number(mine.high)} m{', ' * bool(outside)}{listed(outside)}; that does not carry over to "
            "other logs."
        )
    return said


def few(names: Sequence[str]) -> str:
    """Joins names as `listed`, of many the first SHOWN."""
    return listed(names, SHOWN)
