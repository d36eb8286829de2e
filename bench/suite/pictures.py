"""The pictures of an overview: for each purpose backends against datasets, and cost against error."""

from ..drawing.figure import ReportFigure
from .cost_panels import COSTS, cost_panels
from .matrix import matrix
from .overview import Overview

CALLED = {"online": "online", "final": "afterwards", "map": "map"}  # in the names of files


def pictures(found: Overview) -> list[ReportFigure]:
    """Draws those that there are values for, online first."""
    drawn = [
        figure
        for purpose, name in CALLED.items()
        for figure in (
            matrix(name, found.backends, purpose),
            cost_panels(f"{name}-cost", found.backends, purpose) if purpose in COSTS else None,
        )
    ]
    return [figure for figure in drawn if figure is not None]
