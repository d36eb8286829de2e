"""The figures of a dataset, in the order in which a report shows them."""

from collections.abc import Callable
from importlib import import_module

from ..drawing.figure import Exhibit
from .drawn_log import Scene

FIGURES = {
    "pareto": ".pareto:pareto",
    "paths": ".path_figures:overlay",
    "seeds": ".accuracy_figures:by_log",
    "pairs": ".accuracy_figures:online_pairs",
    "final-pairs": ".accuracy_figures:final_pairs",
    "error": ".accuracy_figures:errors",
    "heading": ".accuracy_figures:headings",
    "nees": ".belief_figures:nees",
    "nis": ".belief_figures:nis",
    "cost": ".cpu_figures:spread",
    "cost-along": ".cpu_figures:over_time",
    "growth-steps": ".cpu_figures:growth_over_steps",
    "growth-landmarks": ".cpu_figures:growth_over_landmarks",
    "effective": ".particle_figures:effective",
    "ancestors": ".particle_figures:ancestors",
}
"""End of its file's name -> module of this room and the function `(name, scene)` in it.

The function returns None where the scene has nothing that the figure shows.
"""


def exhibits(name: str, scene: Scene) -> list[Exhibit]:
    """Those for which a dataset has what they show; `name` begins their files'."""
    made = (_function(place)(f"{name}-{end}", scene) for end, place in FIGURES.items())
    return [exhibit for exhibit in made if exhibit is not None]


def _function(place: str) -> Callable[[str, Scene], Exhibit | None]:
    module, _, function = place.partition(":")
    return getattr(import_module(module, __package__), function)
