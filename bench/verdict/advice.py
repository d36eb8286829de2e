"""Recommends a backend per purpose: the cheapest that is hardly worse than the best, and consistent."""

from collections.abc import Mapping, Sequence
from math import inf, isinf
from typing import NamedTuple

from ...datasets.registry import drawable, seeded
from ..words.numerals import counted, larger, listed, number, times
from ..words.styles import BASELINE
from .accuracy import between, unborne
from .consistency import NO_COVARIANCE, belief_word
from .cost_words import compared
from .costs import compare_costs, is_dearer, rounds
from .margin import FAR, NEAR, Limit, limit, undecided, widest, would_tell
from .ranking import ESTIMATES, PATHS, Ranking, standing
from .statistics import FEWEST
from .summary import Line

COST = {"online": "step_us_p50", "final": "cpu_s", "map": "cpu_s"}
"""The cost that counts: a step while the robot drives, else the CPU time of the whole log, as a method with a final
path alone does nothing in its steps."""

EVEN = 1.0005  # times, which are written as no difference
LISTED = 4  # backends whose cost is stated where none is recommended

BELIEF = {"online": "nees", "final": "final_nees"}
"""The NEES that counts: an online belief says nothing of a final path, and nothing of a map as a whole."""


class Use(NamedTuple):
    """The backend recommended for a purpose."""

    purpose: str  # "online", "final" or "map"
    backend: str  # its label; "" where none can be recommended
    why: str  # a sentence


def advice(purpose: str, found: Ranking) -> Use:
    """Recommends by these steps, each left out where it would leave none:

    those not significantly different from the best, and significantly better than dead reckoning, else that itself, but
    none where only too few logs stand in the way; those that fail on less than half of the logs, without which none is
    recommended; those without a failure; those that are not overconfident, and have a covariance at every step; the
    first of these and those whose errors are surely at most NEAR times its; those that none of these is cheaper than;
    the one with the lowest median error. Costs that are not told apart never decide. None is recommended where the data
    leave it open that another one is closer by more than FAR.
    """
    of = found.units
    if of.n < FEWEST:
        return Use(purpose, "", _too_few(found))
    if len({of.unit(log) for log in found.errors[found.lines[0].backend]}) < FEWEST:
        return Use(purpose, "", f"No backend ran on enough logs: a test needs {of.at_least(FEWEST)}.")
    tested = [c for c in found.baseline if standing(c) != "few"]
    ahead = {c.first for c in tested if standing(c) == "better"}
    if found.circular:
        return Use(purpose, "", "None is best: each backend is significantly worse than another one.")
    hidden = [c for c in tested if standing(c) == "unproven" and c.low > 1]
    if hidden and not ahead:
        measured = f"{hidden[0].first} was measured {between(hidden[0])} than dead reckoning"
        return Use(purpose, "", f"Not significant: {measured}, but {unborne(hidden, len(tested))}.")
    if tested and not ahead:
        return Use(purpose, BASELINE, "No backend is significantly closer to the truth.")
    level = [line for line in found.level if not tested or line.backend in ahead]
    if not level:
        return Use(
            purpose, "", f"{found.lines[0].backend} is not significantly closer to the truth than dead reckoning."
        )
    able = [line for line in level if 2 * line.done > len(line.rows)]
    if not able:
        return Use(purpose, "", f"None can be named: {_unable(level)}.")
    whole = [line for line in able if line.done == len(line.rows)] or able
    word = {line.backend: belief_word(line, BELIEF.get(purpose, "")) for line in whole}
    sure = [line for line in whole if word[line.backend] not in ("overconfident", NO_COVARIANCE)] or whole
    near = [sure[0], *(line for line in sure[1:] if limit(found, line, sure[0]).most <= NEAR)]
    dear = [line for line in near if any(is_dearer(line, other, COST[purpose]) for other in near if other is not line)]
    cheapest = [line for line in near if line not in dear] or near
    chosen = cheapest[0]
    worst = widest(found, chosen, found.lines)
    if worst is not None and worst.most > FAR:
        return Use(purpose, "", undecided(found, chosen, worst))
    rival = next((line for line in found.lines if line is not chosen), None)
    parts = [
        _accuracy(found, chosen, rival),
        _belief(word[chosen.backend], {line.backend: word[line.backend] for line in whole if line not in sure}),
        _failures(chosen, [line for line in level if line not in whole]),
        _cost(COST[purpose], chosen, [_next_cheapest(COST[purpose], chosen, level), rival]),
        _tied(cheapest),
        _ruled_out(worst, rival),
        _left_open(found, chosen, COST[purpose], [line for line in sure if line not in near]),
    ]
    why = "; ".join(part for part in parts if part)
    return Use(purpose, chosen.backend, f"{why[0].upper()}{why[1:]}.")


def unnamed(purpose: str, lines: Sequence[Line]) -> Use:
    """Recommends none where no path is known, but lists costs and distances from the reference."""
    having = [
        line
        for line in lines
        if line.backend != BASELINE and not line.told and line.done == len(line.rows)
        and PATHS[purpose] in line.values and COST[purpose] in line.values
    ]  # fmt: skip
    having.sort(key=lambda line: line.values[COST[purpose]].median)
    why = "Without ground truth for the path, accuracy cannot be compared."
    told = [
        f"{line.backend} {_amount(COST[purpose], line)}, {number(line.values[PATHS[purpose]].median)} m"
        for line in having[:LISTED]
    ]
    if told:
        more = f", and {len(having) - LISTED} more" if len(having) > LISTED else ""
        why += f" Cost, and distance from the reference: {'; '.join(told)}{more}."
    return Use(purpose, "", why)


def _amount(column: str, line: Line) -> str:
    """Writes the cost; of steps, the median and the 99th percentile."""
    mine = line.values[column].median
    if column != "step_us_p50":
        return f"{number(mine)} s of CPU for the whole log"
    slow = line.values.get("step_us_p99")
    return f"{number(mine)} µs a step" + (f" (p99 {number(slow.median)})" if slow else "")


def _too_few(found: Ranking) -> str:
    of, first = found.units, found.lines[0].rows[0].columns
    if of.logs > 1:
        more = " (--seeds)" if first["log_name"] is None else ""
        return f"{of} are too few, {of.at_least(FEWEST)}{more}."
    if any(len(line.rows) > 1 for line in found.lines):
        return "There is one log, nothing to test."
    few, name = f"One log is too few, {FEWEST} at least", first["dataset"]
    if seeded(name, first["dataset_options"]):
        return f"{few} (--seeds)."
    if drawable(name):
        return f"{few}: {name}[draw=true] draws its noise anew for each seed."
    return f"{few} of a dataset; --seeds draws no others of a recording."


def _accuracy(found: Ranking, chosen: Line, rival: Line | None) -> str:
    """Compares the chosen one with the best, or where it is the best with the next."""
    if rival is None:
        return f"the only one that gives the {ESTIMATES[found.column]}"
    best = chosen is found.lines[0]
    c = found.between(chosen, rival) if best else found.between(rival, chosen)
    kind = standing(c)
    if kind == "alike":
        return f"as accurate as {rival.backend}"
    if kind == "open" or not best:
        if max(1 / c.low if c.low else inf, c.high) <= NEAR:
            return f"as accurate as {rival.backend} (within {larger(max(1 / c.low, c.high))})"
        most = limit(found, chosen, rival).most
        worse = f" (at most {larger(most)} worse)" if EVEN < most < inf else ""
        return f"not significantly different from {rival.backend}{worse}"
    if kind == "better" and isinf(c.low):
        return f"the most accurate, as {rival.backend} mostly failed"
    if kind == "better":
        return f"the most accurate, {times(c.low, c.high)} closer than {rival.backend}"
    if kind == "unproven":
        return f"the most accurate measured ({between(c)} than {rival.backend}), though no test supports it"
    return "the most accurate measured"


def _ruled_out(worst: Limit | None, rival: Line | None) -> str:
    """States what is ruled out of the one that the chosen one may be the most worse than, where it is not the rival."""
    if worst is None or worst.most <= NEAR or (rival is not None and worst.rival == rival.backend):
        return ""
    return worst.is_ruled_out


def _left_open(found: Ranking, chosen: Line, column: str, others: Sequence[Line]) -> str:
    """Names the cheapest of the others that cost less, but may be much worse."""
    open_ = [line for line in others if limit(found, chosen, line).most >= 1]
    cheaper = [line for line in open_ if is_dearer(chosen, line, column)]
    if not cheaper:
        return ""
    one = min(cheaper, key=lambda line: line.values[column].median)
    of = limit(found, one, chosen)
    return (
        f"{one.backend} costs less, but may be more than {larger(NEAR)} worse (up to {larger(of.most)} is not ruled "
        f"out){would_tell(found, one.backend, chosen.backend, NEAR)}"
    )


def _belief(word: str, passed: Mapping[str, str]) -> str:
    """Says how the chosen one's covariances are, and those of the backends that are `passed` over for theirs."""
    if word == NO_COVARIANCE:
        return "its covariances are none at some steps"
    said = word
    if over := [name for name, of in passed.items() if of != NO_COVARIANCE]:
        said = (
            f"{word}, as {listed(over)} {_is(over)} not"
            if word
            else f"not clearly overconfident, as {listed(over)} {_is(over)}"
        )
    if void := [name for name, of in passed.items() if of == NO_COVARIANCE]:
        said += f"{', and ' * bool(said)}with covariances, as {listed(void)} {_is(void)} not at every step"
    return said


def _failures(chosen: Line, passed: Sequence[Line]) -> str:
    if chosen.done < len(chosen.rows):
        return f"done in {chosen.done} of {counted(len(chosen.rows), 'cell')}"
    return f"done on every log, as {listed([line.backend for line in passed])} {_is(passed)} not" if passed else ""


def _unable(level: Sequence[Line]) -> str:
    """Names those that fail on half of the logs or more."""
    done = [f"{line.backend} is done on {line.done} of {counted(len(line.rows), 'log')}" for line in level]
    return f"{listed(done)}, and no other one is as close to the truth"


def _is(them: Sequence[object]) -> str:
    return "is" if len(them) == 1 else "are"


def _tied(alike: Sequence[Line]) -> str:
    """Names those that costs do not tell apart, and the reason for the first of them."""
    if len(alike) < 2:
        return ""
    return f"costs do not decide between {listed([line.backend for line in alike])}, its median error is the lowest"


def _next_cheapest(column: str, chosen: Line, level: Sequence[Line]) -> Line | None:
    """The cheapest of the others that are not significantly less accurate."""
    others = [line for line in level if line is not chosen and column in line.values]
    return min(others, key=lambda line: line.values[column].median, default=None)


def _cost(column: str, chosen: Line, rivals: Sequence[Line | None]) -> str:
    """Compares the chosen one's cost with each rival's, or states it and the first one's."""
    if column not in chosen.values:
        return ""
    said, alone = _amount(column, chosen), chosen.alone
    others = list({line.backend: line for line in rivals if line is not None and column in line.values}.values())
    borne = {line.backend: compared(compare_costs(chosen, line, column), line.backend) for line in others}
    if not any(borne.values()):
        others = others[:1]
    for line in others:
        if borne[line.backend]:
            said += f", {borne[line.backend]}"
        elif not any(borne.values()):
            said += f" against {_short(column, line)} of {line.backend} ({_seldom(chosen, line)})"
        alone = alone and line.alone
    return said + ", timed while others ran beside" * (not alone)


def _seldom(chosen: Line, rival: Line) -> str:
    """Says why two costs are not compared: how often they were timed."""
    n, m = rounds(chosen), rounds(rival)
    if n == m == 1:
        return "each timed once"
    return (
        f"{chosen.backend if n < m else rival.backend} timed once"
        if min(n, m) == 1
        else f"{min(n, m)} rounds are too few to compare"
    )


def _short(column: str, line: Line) -> str:
    value = number(line.values[column].median)
    return value if column == "step_us_p50" else f"{value} s"
