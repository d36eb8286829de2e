"""Makes a dataset's figures, in the order in which a report shows them."""

from collections.abc import Iterator, Mapping, Sequence

from ..drawing.figure import ReportFigure
from ..verdict.statistics import Comparison
from ..verdict.summary import Line
from ..words.styles import Look
from . import accuracy_figures, belief_figures, cpu_figures
from .drawn_log import DrawnLog
from .pareto import pareto
from .path_figures import overlay


def report_figures(
    name: str,
    log: DrawnLog,
    lines: Sequence[Line],
    looks: Mapping[str, Look],
    comparisons: Mapping[str, Sequence[Comparison]] | None = None,
) -> list[ReportFigure]:
    """Makes those for which there is data; `name` begins their files' names. `comparisons` are the verdict's."""
    return [made for made in _made(name, log, lines, looks, comparisons or {}) if made is not None]


def _made(
    name: str,
    log: DrawnLog,
    lines: Sequence[Line],
    looks: Mapping[str, Look],
    comparisons: Mapping[str, Sequence[Comparison]],
) -> Iterator[ReportFigure | None]:
    yield pareto(f"{name}-pareto", log, lines, looks)
    yield overlay(f"{name}-paths", log)
    yield accuracy_figures.by_log(f"{name}-seeds", log, lines, looks)
    if log.kind == "truth":
        yield from accuracy_figures.pairs(name, lines, looks, comparisons)
    yield accuracy_figures.errors(f"{name}-error", log)
    yield accuracy_figures.headings(f"{name}-heading", log)
    yield belief_figures.nees(f"{name}-nees", log)
    yield belief_figures.nis(f"{name}-nis", log)
    yield cpu_figures.spread(f"{name}-cost", log)
    yield cpu_figures.over_time(f"{name}-cost-along", log)
    yield cpu_figures.growth(f"{name}-growth-steps", log, lines, "steps")
    yield cpu_figures.growth(f"{name}-growth-landmarks", log, lines, "landmarks")
    yield belief_figures.effective(f"{name}-effective", log)
    yield belief_figures.ancestors(f"{name}-ancestors", log)
