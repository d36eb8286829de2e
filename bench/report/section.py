"""A report's section on one dataset: verdict, tables, figures, and what failed."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...frontend.maps.obstacles import HIGH
from ..drawing.figure import GROUPS, ReportFigure
from ..drawing.table import Table
from ..record.schema import Row
from ..record.store import Store
from ..verdict.bound_words import bound_sentence
from ..verdict.cost_words import basis, grown, meanwhile
from ..verdict.implementations import sentence
from ..verdict.ranking import ordered
from ..verdict.summary import Line, lines, representative
from ..verdict.verdict import Verdict, verdict
from ..words.numerals import counted, listed, number
from ..words.styles import Look, looks
from .constants_table import constants_table
from .drawn_log import DrawnLog, drawn_log
from .landmark_errors import landmark_errors, landmark_table
from .pair_tables import cost_pairs_table, pairs_table
from .tables import accuracy_table, cost_table, details_tables, fit_table, growth_table, inner_table, meanwhile_table


class Failure(NamedTuple):
    """The cells of a backend that ended in the same way: not done, or done with a remark."""

    backend: str
    seeds: str
    status: str
    reason: str
    traceback: str


class Section(NamedTuple):
    """A report's section on one dataset."""

    dataset: str  # label
    name: str  # display name
    anchor: str
    kind: str  # of the path that is known: "truth", "reference", or "" for none
    places: str  # source of the known landmarks' places, if any: "truth" or "reference"
    verdict: Verdict
    facts: str
    remarks: Sequence[str]  # what is legal in its logs yet odd
    accuracy: Table  # the small one that answers most questions
    bound: str  # of the errors in it: the least that the logs allow
    pairs: Table  # every comparison behind the verdict
    details: list[Table]
    cost: Table  # of a step, and of the log
    cost_pairs: Table  # every two backends' costs, where there are repeats
    meanwhile: Table  # what the machine did
    cost_note: str  # the programs that are compared, if several; how often, and what the machine did
    growth: Table  # of a step, along the log
    growth_note: str  # with which backends it grows, where the log is long
    fit: Table  # J by its terms
    fit_note: str
    constants: Table  # errors of the sensors that backends have estimated
    inner: Table  # particles and gates
    log: DrawnLog | None
    panels: Sequence[ReportFigure]  # the paths
    map_errors: Table  # of single landmarks
    map_panels: Sequence[ReportFigure]  # the same, drawn
    grids: Sequence[ReportFigure]  # the occupancy grids of a laser log, or views from above of a depth camera's
    figures: Sequence[ReportFigure]
    failures: Sequence[Failure]

    @property
    def high(self) -> float:
        """The height above the floor, m, up to which views from above show what was seen."""
        return HIGH

    @property
    def groups(self) -> dict[str, list[ReportFigure]]:
        """Groups the figures by subject, in order; those of accuracy over time go with those of consistency."""
        timed = [e for e in self.figures if e.group == "accuracy" and e.plot is not None and e.plot.timed]
        by_group = {group: [e for e in self.figures if e.group == group and e not in timed] for group in GROUPS}
        return by_group | {"consistency": timed + by_group["consistency"]}


class Recorded(NamedTuple):
    """A run's record as its report and its verdict take it, read once for both."""

    run: Mapping[str, Any]  # the content of run.json
    rows: Sequence[Row]
    lines: Sequence[Line]
    remarks: Mapping[str, Sequence[str]]  # on the logs, by dataset


def recorded(store: Store) -> Recorded:
    """Reads the record."""
    run, rows = store.run(), list(store.cells())
    return Recorded(run, rows, lines(rows, run.get("implementations")), store.remarks())


@np.errstate(all="ignore")  # a record's numbers may have any size
def sections(store: Store, record: Recorded) -> tuple[list[Section], Mapping[str, Look]]:
    """Makes a section for each dataset, and the backends' looks in all of them."""
    found = record.lines
    look = looks(line.backend for line in sorted(found, key=lambda line: line.done == 0))
    datasets = dict.fromkeys(line.dataset for line in found)
    of = {name: [line for line in found if line.dataset == name] for name in datasets}
    return [_section(store, record.run, mine, look, record.remarks.get(name, ())) for name, mine in of.items()], look


def _section(
    store: Store, run: Mapping[str, Any], found: Sequence[Line], look: Mapping[str, Look], remarks: Sequence[str]
) -> Section:
    from .figures import report_figures
    from .landmark_figures import landmark_panels
    from .map_figures import grids
    from .path_figures import trajectories

    ruling = verdict(found)
    shown = drawn_log(store, found, look, run["folders"], ruling.comparisons)
    known, slug = representative(found), run["folders"][found[0].dataset]
    errors = landmark_errors(shown) if shown else None
    return Section(
        dataset=found[0].dataset,
        name=found[0].name,
        anchor=slug,
        kind=known.truth_kind if known.truth_kind != "relations" else "",
        places="truth" if known.surveyed else known.truth_kind,
        verdict=ruling,
        facts=_facts(found, shown),
        remarks=remarks,
        accuracy=accuracy_table(found),
        bound=bound_sentence(found),
        pairs=pairs_table(ruling),
        details=details_tables(found),
        cost=cost_table(found),
        cost_pairs=cost_pairs_table(ruling),
        meanwhile=meanwhile_table(found),
        cost_note=" ".join(said for said in (sentence(found), basis(found), meanwhile(found)) if said),
        growth=growth_table(found),
        growth_note=grown(ordered(found)),
        fit=fit_table(found),
        fit_note=_fit_note(found),
        constants=constants_table(found),
        inner=inner_table(found),
        log=shown,
        panels=list(trajectories(f"{slug}-trajectory", shown)) if shown else [],
        map_errors=landmark_table(errors),
        map_panels=list(landmark_panels(f"{slug}-landmarks", errors)) if errors else [],
        grids=list(grids(f"{slug}-grid", shown)) if shown else [],
        figures=report_figures(slug, shown) if shown else [],
        failures=[failure for line in found for failure in _failures(line)],
    )


def _failures(line: Line) -> list[Failure]:
    alike: dict[tuple[str, str], list[Row]] = {}
    for row in line.rows:
        c = row.columns
        if c["status"] != "done" or c["reason"]:
            alike.setdefault((c["status"], c["reason"] or ""), []).append(row)
    return [
        Failure(
            line.backend,
            f"seed{'s' * (len(rows) > 1)} {listed([str(r.columns['seed']) for r in rows])}",
            status,
            reason,
            rows[0].traceback,
        )
        for (status, reason), rows in alike.items()
    ]


def _facts(found: Sequence[Line], shown: DrawnLog | None) -> str:
    first = {name: value for line in reversed(found) for name, value in line.values.items()}
    said = [counted(round(first[name].median), name[:-1]) for name in ("steps", "sightings") if name in first]
    length = shown and shown.lengths.get(shown.seed)
    if length:
        said.append(f"{number(length)} s")
    return ", ".join(said)


def _fit_note(found: Sequence[Line]) -> str:
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
        said += " A filter's online path jumps where a sighting corrects it, and odometry does not explain the jump: "
        said += "its large J is no defect."
    return said
