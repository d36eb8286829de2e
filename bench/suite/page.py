"""Writes an overview as a page of Markdown with pictures and tables; the page is made from the tables alone."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.files import write_whole
from ..drawing.figure import ReportFigure
from ..drawing.page import PURPOSES, rendered
from ..drawing.svg import alone
from ..words.columns import about
from ..words.numerals import counted, listed, number
from .overview import MADE, NOT_RUN, Made, Named, Overview, Past, overview
from .pictures import pictures
from .results import results
from .submission import submissions
from .tables import TABLES, overview_tables, read_overview

ENDING = ".md"
NONE_KEPT = "None is kept."
SHOWN_REVISION = 7  # letters
WIDTH = 130  # letters of a line


def write_page(site: Path, page: Path) -> None:
    """Writes a site's overview to `page`, FILE.md, with FILE.csv and the folder FILE beside it."""
    if page.suffix != ENDING:
        raise InputError(f"--standing {page}: found no {ENDING} at its end, expected the name of a page of Markdown.")
    tables = overview_tables(overview(results(site, submissions(site))))
    try:
        page.with_suffix("").mkdir(parents=True, exist_ok=True)
        for name, path in tables_of(page).items():
            write_whole(path, tables[name])
        for path, text in files(page).items():
            write_whole(path, text)
    except OSError as error:
        raise InputError(
            f"--standing {error.filename or page}: {error.strerror}; expected a place to write to."
        ) from None


def tables_of(page: Path) -> dict[str, Path]:
    """The places of the tables beside a page."""
    folder = page.with_suffix("")
    return {name: folder / f"{name}.csv" for name in TABLES} | {"named": page.with_suffix(".csv")}


def files(page: Path) -> dict[Path, str]:
    """The page and its pictures as they should be, from the tables beside it."""
    found = read_overview(tables_of(page))
    drawn = pictures(found)
    text = rendered("standing.md.jinja", _page(page, found, drawn))
    return {page: text} | {page.with_suffix("") / f"{figure.name}.svg": alone(figure.svg) for figure in drawn}


def _page(page: Path, found: Overview, drawn: Sequence[ReportFigure]) -> dict[str, Any]:
    made = [one for one in found.runs if one.state == MADE]
    suites = list(dict.fromkeys(one.suite for one in made))
    return {
        "pictures": list(zip(drawn, _captions(drawn), strict=True)),
        "folder": page.stem,
        "stem": page.stem,
        "counts": _counts(found, made),
        "made": [_made([one for one in made if one.suite == suite]) for suite in suites],
        "missing": list(_missing(found.runs)),
        "suites": [_suite([one for one in made if one.suite == suite], found.named) for suite in suites],
        "versions": list(_versions(found.changes)),
        "changes": list(_changes(found.changes)),
        "writes": f"bench suite --standing {page.name}",
    }


def _captions(drawn: Sequence[ReportFigure]) -> Iterator[list[str]]:
    """The lines of each picture's caption, none where another one has said it."""
    said: set[str] = set()
    for figure in drawn:
        yield [] if figure.caption in said else textwrap.wrap(figure.caption, WIDTH)
        said.add(figure.caption)


def _counts(found: Overview, made: Sequence[Made]) -> str:
    backends = len({score.backend for score in found.backends})
    datasets, cells, failed = (sum(getattr(one, name) for one in made) for name in ("datasets", "cells", "failed"))
    said = f"{backends} backends on {datasets} datasets of {_logs(made)}"
    return f"{said}: {cells:,} runs of a backend on a log, {failed} failed."


def _logs(made: Sequence[Made]) -> str:
    logs, clusters = sum(one.logs for one in made), sum(one.clusters for one in made)
    return counted(logs, "log") + f" in {clusters:,} independent clusters" * (clusters < logs)


def _made(runs: Sequence[Made]) -> dict[str, str]:
    """A suite's row in the table of what was run."""
    return {
        "command": runs[0].suite_command,
        "version": "; ".join(_versions_run(runs)),
        "machine": "; ".join(dict.fromkeys(_machine(one) for one in runs)),
        "logs": f"{_logs(runs)}, {counted(sum(one.datasets for one in runs), 'dataset')}",
        "costs": _timing(runs),
    }


def _versions_run(runs: Sequence[Made]) -> Iterator[str]:
    """Names the versions that made runs, and the days."""
    days: dict[tuple[str, str], dict[str, None]] = {}
    for one in runs:
        days.setdefault((one.version, one.revision), {})[_day(one.date)] = None
    for (version, revision), found in days.items():
        yield f"{_called(version, revision)} of {listed([*found])}"


def _machine(one: Made) -> str:
    memory = "" if math.isnan(one.memory_gb) else f", {number(one.memory_gb)} GB"
    return f"{one.processor}, {counted(one.cores, 'core')}{memory}"


def _timing(runs: Sequence[Made]) -> str:
    """Says beside what the cells were timed."""
    beside = max(one.workers for one in runs)
    low = min((one.load_low for one in runs if not math.isnan(one.load_low)), default=math.nan)
    high = max((one.load_high for one in runs if not math.isnan(one.load_high)), default=math.nan)
    said = "one cell at a time" if beside == 1 else f"{beside} cells at once"
    return said if math.isnan(low) else f"{said}, load {low:.1f} to {high:.1f}"


def _missing(runs: Sequence[Made]) -> Iterator[str]:
    """Says what was not run, suite by suite: with the command that does it, or why it was skipped."""
    for one in runs:
        if one.state == MADE:
            if one.cells < one.planned:
                some = f"{one.cells:,} of {one.planned:,} cells"
                yield f"{one.title}, {one.run}: {some}, `{one.suite_command}` continues it."
        elif not one.run:
            yield f"**{one.title}**: not run yet, `{one.suite_command}`. {one.question}"
        elif one.state == NOT_RUN:
            yield f"{one.title}, {one.run}: not run yet, `{one.suite_command}`."
        else:
            yield f"{one.title}: {one.why} Then `{one.suite_command}`."


def _suite(runs: Sequence[Made], named: Sequence[Named]) -> dict[str, Any]:
    """The section of a suite, as text."""
    mine = [one for one in named if one.suite == runs[0].suite]
    shown = [purpose for purpose in PURPOSES if any(one.purpose == purpose for one in mine)]
    cells = {(one.run, one.dataset, one.purpose): _named(one) for one in mine}
    rows = dict.fromkeys((one.run, one.dataset, one.basis) for one in mine)
    often = [dataset for _, dataset, _ in rows]
    return {
        "title": runs[0].title,
        "question": runs[0].question,
        "commands": [one.command for one in runs],
        "headings": [PURPOSES[purpose].lower() for purpose in shown],
        "rows": [
            [
                f"`{_cell(dataset)}`{f' ({run})' * (often.count(dataset) > 1)}, {_cell(basis)}",
                *(cells.get((run, dataset, purpose), "") for purpose in shown),
            ]
            for run, dataset, basis in rows
        ],
    }


def _named(one: Named) -> str:
    """The backend that is named with its numbers, or why none is."""
    if not one.backend:
        return _cell(one.why)
    ends = one.ends and f" ({one.ends})"
    more = "".join(f", {text}" for text in (one.consistency, one.cost) if text)
    return _cell(f"**{one.backend}** {one.error}{ends}{more}")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _versions(past: Sequence[Past]) -> Iterator[str]:
    """Says which versions of each suite are kept, and what has changed since the last but one."""
    by_suite: dict[str, list[Past]] = {}
    for one in past:
        if not one.dataset:
            by_suite.setdefault(one.suite, []).append(one)
    for suite, kept in by_suite.items():
        *before, newest = (_version(one.version, one.revision, one.date) for one in kept)
        if before:
            yield f"`{suite}`: {newest}, after {'; '.join(reversed(before))}. Since {before[-1]}: {kept[-1].change}."
        else:
            yield f"`{suite}`: {newest}, the first that is kept."
    if not by_suite:
        yield NONE_KEPT


def _changes(past: Sequence[Past]) -> Iterator[list[str]]:
    """The values that have changed since the last but one version, each over the versions."""
    rows: dict[tuple[str, str, str, str], list[Past]] = {}
    for one in past:
        if one.dataset:
            rows.setdefault((one.suite, one.dataset, one.backend, one.column), []).append(one)
    for (suite, dataset, backend, column), values in rows.items():
        kind, heading = about(column).kind, about(column).heading
        over = " → ".join(f"{one.version}: {_value(one.value)}" for one in values)
        last = values[-1]
        yield [
            f"{suite}, `{_cell(dataset)}`", f"`{_cell(backend)}`", f"{heading}{kind.unit and f', {kind.unit}'}",
            over, f"**{last.verdict}**, {last.change}",
        ]  # fmt: skip


def _value(value: float) -> str:
    return "\N{EN DASH}" if math.isnan(value) else number(value)


def _version(version: str, revision: str, day: str) -> str:
    """Names a version: 0.2.0 (01c0101) of 26 November 2026."""
    return f"{_called(version, revision)} of {_day(day)}"


def _called(version: str, revision: str) -> str:
    return version + (f" ({revision[:SHOWN_REVISION]}{'+' * revision.endswith('+')})" if revision else "")


def _day(day: str) -> str:
    when = date.fromisoformat(day)
    return f"{when.day} {when:%B %Y}"
