"""The figures of a dataset, in the order in which a report shows them."""

from collections.abc import Iterator, Mapping, Sequence

from ..drawing.figure import Exhibit
from ..verdict.statistics import Comparison
from ..verdict.summary import Line
from ..words.styles import Look
from . import accuracy_figures, belief_figures, cpu_figures, particle_figures
from .drawn_log import Scene
from .pareto import pareto
from .path_figures import overlay


def exhibits(
    name: str,
    scene: Scene,
    lines: Sequence[Line],
    looks: Mapping[str, Look],
    comparisons: Mapping[str, Sequence[Comparison]] | None = None,
) -> list[Exhibit]:
    """Those for which a dataset has what they show; `name` begins their files'. `comparisons` are the verdict's."""
    return [made for made in _made(name, scene, lines, looks, comparisons or {}) if made is not None]


def _made(
    name: str,
    scene: Scene,
    lines: Sequence[Line],
    looks: Mapping[str, Look],
    comparisons: Mapping[str, Sequence[Comparison]],
) -> Iterator[Exhibit | None]:
    yield pareto(f"{name}-pareto", scene, lines, looks)
    yield overlay(f"{name}-paths", scene)
    yield accuracy_figures.by_log(f"{name}-seeds", scene, lines, looks)
    if scene.kind == "truth":
        yield from accuracy_figures.pairs(name, lines, looks, comparisons)
    yield accuracy_figures.errors(f"{name}-error", scene)
    yield accuracy_figures.headings(f"{name}-heading", scene)
    yield belief_figures.nees(f"{name}-nees", scene)
    yield belief_figures.nis(f"{name}-nis", scene)
    yield cpu_figures.spread(f"{name}-cost", scene)
    yield cpu_figures.over_time(f"{name}-cost-along", scene)
    yield cpu_figures.growth(f"{name}-growth-steps", scene, lines, "steps")
    yield cpu_figures.growth(f"{name}-growth-landmarks", scene, lines, "landmarks")
    yield particle_figures.effective(f"{name}-effective", scene)
    yield particle_figures.ancestors(f"{name}-ancestors", scene)
