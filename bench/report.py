"""A run's report: report.html, one file that needs no network, and report.md with its figures beside it."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from ..frontend.files import write_whole
from .definitions import COLUMNS, WORKED_OUT
from .diagnostics import diagnosed
from .exhibit import Exhibit
from .export import label
from .looks import Look, looks
from .numerals import counted, listed, number
from .scene import Scene, scene
from .store import Row, Store
from .summary import Line, lines, remarks, short
from .tables import Table, accuracy_table, cells_table, cost_table, fit_table, inner_table
from .verdict import Verdict, verdict

TEMPLATES = Path(__file__).with_name("templates")
FIGURES = "figures"


class Failure(NamedTuple):
    """The cells of a backend that ended in the same way: not done, or done with a remark."""

    backend: str
    seeds: str
    status: str
    reason: str
    traceback: str


class Section(NamedTuple):
    """All on one dataset."""

    dataset: str
    anchor: str
    kind: str  # "truth", "reference" or ""
    places: str  # whose the known landmarks' places are, if any are known: "truth" or "reference"
    verdict: Verdict
    facts: str
    accuracy: Table
    cost: Table
    fit: Table  # J by its terms
    fit_note: str
    inner: Table  # particles and gates
    alone: bool  # no time in it is marked
    scene: Scene | None
    panels: Sequence[Exhibit]  # the paths
    exhibits: Sequence[Exhibit]
    failures: Sequence[Failure]


def write_report(store: Store) -> None:
    """Write report.html, report.md and figures/ into the record's folder, each file all or nothing."""
    from .svg import alone  # matplotlib: a run should not wait for it before it begins

    run, rows = store.run(), list(store.cells())
    parts, look = sections(store)
    page = {
        "run": run,
        "sections": parts,
        "looks": look,
        "cells": cells_table(rows, run["folders"]),
        "counts": _counts(rows, run.get("cells", 0)),
        "started": datetime.fromtimestamp(run["started"], UTC),
        "digests": _digests(rows),
        "given": run.get("map"),
        "definitions": COLUMNS | WORKED_OUT,
    }
    (store.folder / FIGURES).mkdir(exist_ok=True)
    for section in parts:
        for exhibit in (*section.panels, *section.exhibits):
            write_whole(store.folder / FIGURES / f"{exhibit.name}.svg", alone(exhibit.svg))
    for name in ("report.md", "report.html"):
        write_whole(store.folder / name, rendered(f"{name}.jinja", page))


def sections(store: Store) -> tuple[list[Section], Mapping[str, Look]]:
    """What there is to say of each dataset, and how each backend looks in all of it."""
    run = store.run()
    found = [diagnosed(store, line) for line in lines(store.cells())]
    look = looks(line.backend for line in sorted(found, key=lambda line: line.done == 0))
    datasets = dict.fromkeys(line.dataset for line in found)
    return [_section(store, run, [line for line in found if line.dataset == name], look) for name in datasets], look


def _section(store: Store, run: Mapping[str, Any], found: Sequence[Line], look: Mapping[str, Look]) -> Section:
    from .plots import exhibits
    from .trajectories import trajectories

    shown = scene(store, found, look, run["folders"])
    slug = run["folders"][found[0].dataset]
    return Section(
        dataset=found[0].dataset,
        anchor=slug,
        kind=found[0].truth_kind,
        places="truth" if found[0].surveyed else found[0].truth_kind,
        verdict=verdict(found),
        facts=_facts(found, shown),
        accuracy=accuracy_table(found),
        cost=cost_table(found, shown.lengths if shown else {}),
        fit=fit_table(found),
        fit_note=_fit_note(found),
        inner=inner_table(found),
        alone=all(line.alone for line in found),
        scene=shown,
        panels=list(trajectories(f"{slug}-trajectory", shown)) if shown else [],
        exhibits=exhibits(slug, shown, found, look) if shown else [],
        failures=[failure for line in found for failure in _failures(line)],
    )


def _failures(line: Line) -> list[Failure]:
    alike: dict[tuple[str, str], list[Row]] = {}
    for row in line.rows:
        c = row.columns
        reason = remarks(c["reason"] or "")
        if c["status"] != "done" or reason:
            alike.setdefault((c["status"], reason), []).append(row)
    return [
        Failure(line.backend, _seeds(rows), status, reason, rows[0].traceback)
        for (status, reason), rows in alike.items()
    ]


def _seeds(rows: Sequence[Row]) -> str:
    return f"seed{'s' * (len(rows) > 1)} {listed([str(row.columns['seed']) for row in rows])}"


def _facts(found: Sequence[Line], shown: Scene | None) -> str:
    """What the log is, in a line."""
    first = {name: value for line in reversed(found) for name, value in line.values.items()}
    said = [counted(round(first[name].median), name[:-1]) for name in ("steps", "sightings") if name in first]
    length = shown and shown.lengths.get(shown.seed)
    if length:
        said.append(f"{number(length)} s")
    return ", ".join(said)


def _fit_note(found: Sequence[Line]) -> str:
    """What J is to be held against: its size were all stated noise true; and why that of an online path is large."""
    numbers = {
        (3 * (c["steps"] - 1), 2 * (c["sightings"] - c["ignored"]))
        for c in (row.columns for line in found for row in line.rows)
        if c["status"] == "done" and c["sightings"] is not None
    }
    said = ""
    if numbers:
        motions, seen = np.median(list(numbers), axis=0)
        said = f"True noise would give about {number(motions)} of odometry and {number(seen)} of sightings at the true "
        said += "path and map; an optimum has less."
    if any("j_online" in line.values for line in found):
        said += " A filter's online path jumps where a sighting corrects it, and no odometry has reported the jump: "
        said += "its J is large by nature, and no fault."
    return said


def _counts(rows: Sequence[Row], planned: int) -> str:
    """How many cells ended how, and how many of those planned have not been run."""
    statuses = [row.columns["status"] for row in rows]
    counts = {status: statuses.count(status) for status in sorted(statuses)}
    counts |= {"not run yet": planned - len(rows)} if planned > len(rows) else {}
    return ", ".join(f"{n} {status}" for status, n in counts.items())


def _digests(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """(log, digest), each once; one that is the same for all seeds has no seed."""
    by_log: dict[str, dict[int, str]] = {}
    for row in rows:
        c = row.columns
        by_log.setdefault(label(c["dataset"], c["dataset_options"]), {})[c["seed"]] = c["digest"]
    return [
        (name if len(set(digests.values())) == 1 else f"{name}, seed {seed}", digest)
        for name, digests in by_log.items()
        for seed, digest in sorted(digests.items())
        if len(set(digests.values())) > 1 or seed == min(digests)
    ]


def rendered(template: str, page: Mapping[str, Any]) -> str:
    """The template of that name, filled in; what goes into one of HTML is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from .svg import alone, on_page

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=template.endswith(".html.jinja"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"md": _markdown, "on_page": on_page, "alone": alone, "short": short, "url": quote}
    return environment.get_template(template).render(page)


def _markdown(text: object) -> str:
    """Text that Markdown takes as it is, on one line and inside a table too."""
    escaped = " ".join(str(text).replace("&", "&amp;").replace("<", "&lt;").split())
    return "".join(f"\\{letter}" if letter in "\\`*_[]|#$~" else letter for letter in escaped)
