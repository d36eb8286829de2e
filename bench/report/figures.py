"""Makes a dataset's figures, in the order in which a report shows them."""

from importlib import import_module

from ..drawing.figure import ReportFigure
from .drawn_log import DrawnLog

FIGURES = {
    "pareto": ".pareto:pareto",
    "paths": ".path_figures:overlay",
    "seeds": ".accuracy_figures:by_log",
    "pairs": ".accuracy_figures:online_pairs",
    "final-pairs": ".accuracy_figures:final_pairs",
    "error": ".accuracy_figures:errors",
    "heading": ".accuracy_figures:headings",
    "association": ".association_figure:taken",
    "ranges": ".range_figure:residuals",
    "nees": ".belief_figures:nees",
    "nis": ".belief_figures:nis",
    "cost": ".cpu_figures:spread",
    "cost-rounds": ".cpu_figures:by_round",
    "cost-along": ".cpu_figures:over_time",
    "growth-steps": ".cpu_figures:growth_over_steps",
    "growth-landmarks": ".cpu_figures:growth_over_landmarks",
    "effective": ".belief_figures:effective",
    "ancestors": ".belief_figures:ancestors",
}
"""End of its file's name -> module of this room and the function `(name, log)` in it.

The function returns None where the log has nothing that the figure shows.
"""


def report_figures(name: str, log: DrawnLog) -> list[ReportFigure]:
    """Makes those for which there is data; `name` begins their files' names."""
    made: list[ReportFigure | None] = []
    for end, place in FIGURES.items():
        module, _, function = place.partition(":")
        made.append(getattr(import_module(module, __package__), function)(f"{name}-{end}", log))
    return [figure for figure in made if figure is not None]
