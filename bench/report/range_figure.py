"""The figure of what ranges alone are off by along the log."""

import numpy as np

from ...core.se2 import Array
from ..drawing.axes import stretches
from ..drawing.figure import ReportFigure
from .drawn_log import DrawnLog
from .time_curves import Series, along

STRETCHES = 100


def residuals(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws residuals of ranges along the log; None without ranges alone."""
    series = list[Series]()
    for trace in log.traces:
        step, off = trace.arrays.get("range_step"), trace.arrays.get("range_off")
        t = trace.arrays.get("t", np.zeros(0))
        if step is None or off is None or not len(step) or step.min() < 0 or step.max() >= len(t):
            continue
        final = "final" in trace.arrays
        series.append(Series(trace.label, trace.look, *_rms(t[step], off), final=final))
    caption = (
        "Measured less expected, from the final path and map where there are any, else from the online path and the "
        "last map; constant errors of ranges are taken out. Root mean square over short stretches: the stated noise "
        "where all is right, more where the path, a beacon's place or a reflection is off."
    )
    begun = next((float(trace.arrays["t"][0]) for trace in log.traces if len(trace.arrays.get("t", ()))), None)
    title, unit = "Residuals of ranges along the log", "range residual, m"
    return along(name, log, title, unit, caption, series, group="accuracy", start=begun)


def _rms(t: Array, off: Array) -> tuple[Array, Array]:
    """Times and root mean squares of stretches."""
    at, squares = stretches(t, off**2, STRETCHES)
    return at, np.sqrt(squares)
