"""The overview of a site: every backend on every dataset, what was run where, what is missing, and what has changed.

Each of its tables is a CSV file, and pages and pictures are made from these alone: whoever has the tables has the page.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

from ..record.schema import FAILED
from ..verdict.advice import BELIEF, COST
from ..verdict.consistency import belief_word
from ..verdict.ranking import MAPS, PATHS, RELATIONS, Ranking, by_purpose, standing
from ..verdict.statistics import Comparison
from ..verdict.summary import Line, typical, units_of
from ..words.styles import BASELINE
from .best import bests
from .file import packaged, read
from .history import Summary
from .results import SuiteResults, command
from .standing import Standing

PURPOSES = ("online", "final", "map")
DIGITS = 6  # significant ones of a number in the tables
MADE, SKIPPED, NOT_RUN = "made", "skipped", "not run"  # states of a run
FROM_THE_BEST = {"better": "worse", "worse": "better"}  # the standing of the second one, by that of the first

NAN = math.nan


class Named(NamedTuple):
    """The backend to use on a dataset for a purpose."""

    suite: str
    run: str
    dataset: str  # label
    basis: str  # how many logs, and what is known of them
    purpose: str  # online, final or map
    backend: str  # label; "" where none can be recommended
    error: str  # with its unit
    ends: str  # of its interval
    consistency: str
    cost: str
    why: str  # a sentence


class Score(NamedTuple):
    """A backend on a dataset for a purpose, beside the best one there."""

    suite: str
    run: str
    dataset: str  # label
    name: str  # the dataset's display name
    purpose: str  # one of PURPOSES
    backend: str  # label
    named: int  # 1 for the one to use
    standing: str  # best; worse, where significant; open, unproven, alike, better; few: no test; failed: on every log
    times: float  # error over the best's, paired by log: 1 for the best; infinite where it mostly failed
    times_low: float  # its 95 % interval; NaN with fewer than six logs
    times_high: float
    adjusted: float  # p after Holm's correction; dead reckoning is of a family of its own
    error_m: float  # median over logs
    error_low: float  # its 95 % interval, or the range of fewer than six logs
    error_high: float
    consistency: str  # consistent, overconfident, cautious, or not a covariance; "" where none is clear
    cost_us: float  # CPU time of a step; of a final path that of the whole log over its steps
    alone: int  # 1 where no cell was timed beside others
    done: int  # cells
    cells: int


class Made(NamedTuple):
    """A run of a suite, or a suite of which there is none."""

    suite: str
    title: str
    question: str
    suite_command: str
    run: str  # its name; "" for a suite that was not run
    state: str  # MADE, SKIPPED or NOT_RUN
    why: str  # it was skipped
    command: str
    version: str = ""
    revision: str = ""
    date: str = ""  # YYYY-MM-DD
    processor: str = ""
    cores: int = 0
    memory_gb: float = NAN
    datasets: int = 0
    logs: int = 0
    clusters: int = 0  # independent units that the logs are of: as many as logs where none is stated
    cells: int = 0  # the suite's own
    failed: int = 0  # of these
    planned: int = 0
    workers: int = 0  # cells at once
    load_low: float = NAN  # the system's load average while cells were timed; NaN where it is not known
    load_high: float = NAN


class Past(NamedTuple):
    """A kept version of a suite, or what it has of a value that has changed since."""

    suite: str
    version: str
    revision: str
    date: str  # YYYY-MM-DD
    processor: str
    dataset: str  # label; "" for the version itself
    backend: str
    column: str
    value: float  # median over logs
    verdict: str  # of the newest version: worse or better than the one before; "" of others
    change: str  # since the version before, in words; of a version itself regressions and gains


class Overview(NamedTuple):
    """The tables."""

    named: Sequence[Named]
    backends: Sequence[Score]
    runs: Sequence[Made]
    changes: Sequence[Past]


def overview(found: Sequence[SuiteResults]) -> Overview:
    """Collects the overview of a site. Its commands are those of the usual place: others read it in one of theirs."""
    named = [
        Named(one.name, on.run, on.dataset, on.verdict.basis, b.purpose, b.backend, b.error, b.ends, b.consistency,
              b.cost, b.why)
        for one in found
        for on in one.found
        for b in bests(on)
    ]  # fmt: skip
    gives = _gives(line for one in found for on in one.found for line in on.lines)
    scores = [score for one in found for on in one.found for score in _scores(one.name, on, gives)]
    there = {one.name for one in found}
    runs = [*(made for one in found for made in _runs(one)), *_not_run(there)]
    return Overview(named, scores, runs, [past for one in found for past in _history(one)])


def _gives(lines: Iterable[Line]) -> set[tuple[str, str]]:
    """The backends that have an online or a final path or map anywhere, with the column of its error."""
    columns = (*PATHS.values(), *RELATIONS.values(), *MAPS.values())
    return {(line.backend, column) for line in lines for column in columns if column in line.values}


def _scores(suite: str, on: Standing, gives: set[tuple[str, str]]) -> Iterator[Score]:
    """Compares a dataset's backends with the best, by purpose; nothing where no path or map is known."""
    for purpose, (column, ranked) in by_purpose(on.lines).items():
        use = next((use.backend for use in on.verdict.uses if use.purpose == purpose), "")
        against = {} if ranked is None else _against_the_best(ranked)
        for line in on.lines:
            if line.backend in against:
                kind, c = against[line.backend]
            elif not line.done and line.failed and (line.backend, column) in gives:
                kind, c = "failed", None
            else:
                continue
            yield _score((suite, on.run, on.dataset, on.name, purpose), line, column, kind, c, use)


def _against_the_best(ranked: Ranking) -> dict[str, tuple[str, Comparison | None]]:
    """Each ranked backend's standing, and dead reckoning's, with the comparison of the best with it."""
    best, *others = ranked.lines
    pairs = [ranked.between(best, line) for line in others]
    pairs += [c for c in ranked.baseline if c.first == best.backend]
    against: dict[str, tuple[str, Comparison | None]] = {c.second: (_from_the_best(c), c) for c in pairs}
    return {best.backend: ("best", None), **against}


def _from_the_best(c: Comparison) -> str:
    """The standing of the second one beside the first, the best."""
    kind = standing(c)
    return FROM_THE_BEST.get(kind, kind)


def _score(
    place: tuple[str, str, str, str, str], line: Line, column: str, kind: str, c: Comparison | None, use: str
) -> Score:
    purpose, values = place[-1], line.values
    error = typical(line, column) if column in values else None
    times, low, high, adjusted = 1.0 if kind == "best" else math.inf, NAN, NAN, NAN
    if c is not None:
        times, low, high, adjusted = c.ratio, c.low, c.high, c.adjusted
    cost = COST[purpose]
    us = values[cost].median if cost in values else NAN
    if cost != "step_us_p50":
        us = 1e6 * us / values["steps"].median if "steps" in values else NAN
    return Score(
        *place,
        backend=line.backend,
        named=int(line.backend == use != BASELINE),
        standing=kind,
        times=_short(times),
        times_low=_short(low),
        times_high=_short(high),
        adjusted=_short(adjusted),
        error_m=NAN if error is None else _short(error.value),
        error_low=NAN if error is None else _short(error.low),
        error_high=NAN if error is None else _short(error.high),
        consistency=belief_word(line, nees) if (nees := BELIEF.get(purpose, "")) in values else "",
        cost_us=_short(us),
        alone=int(line.alone),
        done=line.done,
        cells=len(line.rows),
    )


def _runs(one: SuiteResults) -> Iterator[Made]:
    """The runs of a suite: those that were made, were skipped, or are to be made yet."""
    suite, places = one.folder.suite, one.folder.runs
    about = (suite.name, suite.title, suite.question, command(suite.name))
    for run in suite.runs:
        of = [on for on in one.found if on.run == run.name]
        if run.name not in places or not of:
            why = one.folder.skipped.get(run.name, "")
            yield _unmade(about, run.name, SKIPPED if why else NOT_RUN, why, run.command)
            continue
        facts = of[0].facts
        lines = [line for on in of for line in on.lines if line.backend not in on.submitted]
        known = facts["environment"]
        units = [units_of(on.lines) for on in of]
        load = [
            found["load"] for line in lines for row in line.rows for found in row.rounds if found["load"] is not None
        ]
        yield Made(
            *about, run.name, MADE, "", run.command, str(known["packages"].get("slamduel") or "unknown"),
            str(known.get("revision") or ""), f"{datetime.fromtimestamp(facts['started'], UTC):%Y-%m-%d}",
            str(known.get("processor")), int(known.get("cores") or 0), _short(float(known.get("memory_gb") or NAN)),
            len(of), sum(found.logs for found in units), sum(found.n for found in units),
            sum(len(line.rows) for line in lines),
            sum(row.columns["status"] in FAILED for line in lines for row in line.rows), int(facts["cells"]),
            int(facts.get("workers") or 1),
            _short(min(load, default=NAN)), _short(max(load, default=NAN)),
        )  # fmt: skip


def _not_run(there: set[str]) -> Iterator[Made]:
    """The packaged suites that were not run."""
    for name in packaged():
        if name not in there:
            suite = read(name)
            yield _unmade((name, suite.title, suite.question, command(name)), "", NOT_RUN, "", "")


def _unmade(about: tuple[str, str, str, str], run: str, state: str, why: str, command: str) -> Made:
    return Made(*about, run, state, why, command)


def _history(one: SuiteResults) -> Iterator[Past]:
    """The versions of a suite, newest last, and the values of each that have changed since the last but one."""
    if one.history is None:
        yield from (_past(summary) for summary in one.kept)
        return
    *before, newest = one.history.versions
    yield from (_past(summary) for summary in before)
    yield _past(newest)._replace(change=one.history.summary)
    for row in one.history.rows:
        for trend in (trend for trend in row.trends if trend.verdict):
            for summary, value in zip(one.history.versions, trend.values, strict=True):
                now = summary is newest
                yield _past(summary)._replace(
                    dataset=row.dataset, backend=row.backend, column=trend.column, value=_short(value),
                    verdict=trend.verdict * now, change=trend.words * now,
                )  # fmt: skip


def _past(summary: Summary) -> Past:
    of = (summary.suite, summary.version, summary.revision, summary.date, summary.processor)
    return Past(*of, "", "", "", NAN, "", "")


def _short(value: Any) -> float:
    """The value as it is in the tables."""
    return float(f"{value:.{DIGITS}g}")
