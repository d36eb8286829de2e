"""Writes a run's report: report.html, one file that needs no network, and report.md with figures and tables."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ...core.files import write_whole
from ..drawing.figure import write_figures
from ..drawing.latex import latex
from ..drawing.page import PURPOSES, rendered, script
from ..record.schema import Row, label
from ..record.store import Store
from ..words.columns import COLUMNS
from .section import Recorded, Section, recorded, sections
from .tables import cells_table, paper_table

FIGURES, TABLES = "figures", "tables"  # folders beside the page


@np.errstate(all="ignore")  # a record's numbers may have any size
def write_report(store: Store, figures: Sequence[str] = ()) -> Recorded:
    """Writes the report, each file whole, with every figure also in the formats `figures`: "pdf", "png" (300 dpi).

    Returns the record that was read for it.
    """
    record = recorded(store)
    run, rows = record.run, record.rows
    parts, look = sections(store, record)
    names = {part.dataset: part.name for part in parts}
    page = {
        "run": run,
        "sections": parts,
        "purposes": {
            name: heading
            for name, heading in PURPOSES.items()
            if any(name == u.purpose for p in parts for u in p.verdict.uses)
        },
        "looks": look,
        "cells": cells_table(rows, run["folders"]),
        "counts": _counts(rows, run.get("cells", 0)),
        "started": datetime.fromtimestamp(run["started"], UTC),
        "options": {names.get(label, label): options for label, options in run["options"].items()},
        "digests": _digests(rows, names),
        "given": run.get("map"),
        "definitions": COLUMNS,
        "script": script("report.js"),
    }
    for section in parts:
        panels = (*section.panels, *section.map_panels, *section.grids)
        write_figures(store.folder / FIGURES, (*panels, *section.figures), figures)
        _write_tables(store.folder / TABLES, section)
    for name in ("report.md", "report.html"):
        write_whole(store.folder / name, rendered(f"{name}.jinja", page))
    return record


def _write_tables(folder: Path, section: Section) -> None:
    folder.mkdir(exist_ok=True)
    tables = {
        "main": section.accuracy,
        "paper": paper_table(section.accuracy),
        "pairs": section.pairs,
        "cost": section.cost,
        "cost-pairs": section.cost_pairs,
        "growth": section.growth,
        "landmarks": section.map_errors,
        "fit": section.fit,
        "constants": section.constants,
    }
    tables |= {"inside": section.inner} | {f"detail{k}": found for k, found in enumerate(section.details, 1)}
    for name, table in tables.items():
        if table.rows and len(table.headings) > 1:
            caption = f"{section.name}: {table.caption}."
            text = latex(table, caption, f"tab:{section.anchor}-{name}")
            write_whole(folder / f"{section.anchor}-{name}.tex", text)


def _counts(rows: Sequence[Row], planned: int) -> str:
    """Counts cells by status, with those not run yet, and defines a cell."""
    statuses = [row.columns["status"] for row in rows]
    counts = {status: statuses.count(status) for status in sorted(statuses)}
    counts |= {"not run yet": planned - len(rows)} if planned > len(rows) else {}
    said = ", ".join(f"{n} {status}" for status, n in counts.items()).replace(" ", " cells ", 1)
    return f"{said}: a cell is one run of one backend on one log" if said else ""


def _digests(rows: Sequence[Row], names: Mapping[str, str]) -> list[tuple[str, str]]:
    """Lists (log, digest), each once; without a seed where it is the same for all."""
    by_log: dict[str, dict[int, str]] = {}
    for row in rows:
        c = row.columns
        by_log.setdefault(names[label(c["dataset"], c["dataset_options"])], {})[c["seed"]] = c["digest"]
    return [
        (name if len(set(digests.values())) == 1 else f"{name}, seed {seed}", digest)
        for name, digests in by_log.items()
        for seed, digest in sorted(digests.items())
        if len(set(digests.values())) > 1 or seed == min(digests)
    ]
