"""Writes the site: an index of all suites and a page for each, without script or network; tables as CSV beside them."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_whole
from ..drawing.figure import ReportFigure, write_figures
from ..drawing.page import rendered
from ..report.pareto import trade_off
from ..report.tables import accuracy_table
from ..verdict.summary import representative
from ..words.styles import Look, looks
from .best import bests
from .figures import costs, gaps
from .overview import Overview, overview
from .pictures import pictures
from .results import SuiteResults, results, where
from .site_folder import SuiteFolder
from .standing import Standing
from .submission import Submission, submissions
from .tables import history_csv, overview_csv, overview_tables, pairs_csv, ranking_csv

DATA, FIGURES = "data", "figures"


@np.errstate(all="ignore")  # a record's numbers may have any size
def write_site(site: Path, forms: Sequence[str] = ()) -> Path:
    """Writes pages, tables and figures again, these also in `forms`; returns the index. InputError without a suite."""
    entered = submissions(site)
    found = results(site, entered)
    whole = overview(found)
    parts = [_part(one, where(site)) for one in found]
    for part in parts:
        _write_tables(site / DATA, part, whole)
        write_figures(site / FIGURES, part["figures"], forms)
        write_whole(site / f"{part['name']}.html", rendered("suite.html.jinja", part))
    (site / DATA).mkdir(exist_ok=True)
    for name, text in overview_tables(whole).items():
        write_whole(site / DATA / f"{'overview' if name == 'named' else name}.csv", text)
    drawn = pictures(whole)
    write_figures(site / FIGURES, drawn, forms)
    index = site / "index.html"
    write_whole(index, rendered("suite_index.html.jinja", _index(parts, entered, whole, drawn, where(site))))
    return index


def _part(one: SuiteResults, place: str) -> dict[str, Any]:
    """Collects the values of a suite's page."""
    folder, found, suite = one.folder, one.found, one.folder.suite
    commands = {run.name: run.command for run in suite.runs}
    look = looks(line.backend for one in found for line in sorted(one.lines, key=lambda line: line.done == 0))
    figures = [
        gaps(f"{suite.name}-online", found, look, "online"),
        gaps(f"{suite.name}-afterwards", found, look, "final"),
        costs(f"{suite.name}-cost", found, look),
    ]
    drawn = [figure for figure in figures if figure is not None]
    datasets = [_dataset(suite.name, folder, one, look, commands[one.run]) for one in found]
    return {
        "name": suite.name,
        "suite": suite,
        "command": one.command,
        "where": place,
        "datasets": datasets,
        "purposes_shown": [
            purpose
            for purpose in ("online", "final", "map")
            if any(purpose == b.purpose for d in datasets for b in d["bests"])
        ],
        "looks": look,
        "wide": drawn,
        "figures": [*drawn, *(one["figure"] for one in datasets if one["figure"] is not None)],
        "missing": [(run, why) for run, why in folder.skipped.items() if run not in folder.runs],
        "kept": one.kept,
        "history": one.history,
        "facts": found[0].facts if found else None,
        "started": max((datetime.fromtimestamp(one.facts["started"], UTC) for one in found), default=None),
        "submitted": {backend: one for standing in found for backend, one in standing.submitted.items()},
    }


def _dataset(
    suite: str, folder: SuiteFolder, found: Standing, look: Mapping[str, Look], command: str
) -> dict[str, Any]:
    """Collects the values of a dataset's section."""
    slug = f"{suite}-{found.run}-{found.slug}"
    kind = representative(found.lines).truth_kind
    figure: ReportFigure | None = trade_off(f"{slug}-trade-off", kind, found.lines, look)
    return {
        "standing": found,
        "anchor": f"{found.run}-{found.slug}",
        "slug": slug,
        "bests": bests(found),
        "table": accuracy_table(found.lines),
        "figure": figure,
        "report": "/".join((*folder.folder.parts[-2:], found.run, "report.html")),
        "cells": "/".join((*folder.folder.parts[-2:], found.run, "cells.csv")),
        "command": command,
    }


def _write_tables(folder: Path, part: Mapping[str, Any], whole: Overview) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for one in part["datasets"]:
        write_whole(folder / f"{one['slug']}-ranking.csv", ranking_csv(one["standing"]))
        write_whole(folder / f"{one['slug']}-pairs.csv", pairs_csv(one["standing"]))
    mine = [one for one in whole.named if one.suite == part["name"]]
    write_whole(folder / f"{part['name']}-overview.csv", overview_csv(mine))
    write_whole(folder / f"{part['name']}-history.csv", history_csv(part["kept"]))


def _index(
    parts: Sequence[Mapping[str, Any]],
    entered: Sequence[Submission],
    whole: Overview,
    drawn: Sequence[ReportFigure],
    place: str,
) -> dict[str, Any]:
    """Collects the values of the index."""
    found = [one["standing"] for part in parts for one in part["datasets"]]
    machines = {
        (facts["environment"].get("processor"), facts["environment"].get("cores")): facts["environment"]
        for facts in (one.facts for one in found)
    }
    return {
        "parts": parts,
        "datasets": len(found),
        "backends": len({line.backend for one in found for line in one.lines}),
        "cells": sum(line.done for one in found for line in one.lines),
        "pictures": drawn,
        "not_run": [one for one in whole.runs if not one.run],
        "missing": [(part["name"], run, why) for part in parts for run, why in part["missing"]],
        "entered": [(one, _places(one, parts)) for one in entered],
        "machines": list(machines.values()),
        "where": place,
        "example": parts[0]["suite"].runs[0].datasets,
        "looks": looks(line.backend for one in found for line in one.lines),
        "purposes_shown": [p for p in ("online", "final", "map") if any(p in part["purposes_shown"] for part in parts)],
        "latest": max((part["started"] for part in parts if part["started"]), default=None),
    }


def _places(one: Submission, parts: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Lists the backends of a submission with whose they are, and the suites that they are in."""
    backends = dict.fromkeys(
        backend for part in parts for backend, submission in part["submitted"].items() if submission.name == one.name
    )
    return [
        (backend, one.whose(backend), ", ".join(part["name"] for part in parts if backend in part["submitted"]))
        for backend in backends
    ]
