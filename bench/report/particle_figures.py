"""Figures of particles: whether there are still many that count, and many histories."""

import numpy as np

from ..drawing.axes import stretches
from ..drawing.figure import Exhibit
from ..words.names import tags
from ..words.numerals import listed, number
from .drawn_log import Scene, Trace
from .time_curves import Series, along

STRETCHES = 100


def effective(name: str, scene: Scene) -> Exhibit | None:
    """How many particles carry the weight."""
    caption = "1 / sum of squared weights: low where few particles carry all. "
    return _particles(name, scene, "n_eff", "Effective particles", caption)


def ancestors(name: str, scene: Scene) -> Exhibit | None:
    """How many histories are left."""
    caption = (
        "Starting particles with descendants left: at 1, all share one early path. The belief is the spread of what "
        "is left, so that few ancestors make it too sure. "
    )
    return _particles(name, scene, "ancestors", "Ancestors left", caption)


def _particles(name: str, scene: Scene, array: str, title: str, caption: str) -> Exhibit | None:
    having = [
        trace
        for trace in scene.traces
        if array in (a := trace.arrays) and np.isfinite(a[array]).any() and (a[array] > 0).any()
    ]
    if not having:
        return None
    series = [
        Series(trace.label, trace.look, *stretches(trace.arrays["t"], trace.arrays[array].astype(float), STRETCHES))
        for trace in having
    ]
    called = tags(trace.label for trace in scene.traces)
    counts = [f"{called[trace.label]} {number(_count(trace))}" for trace in having]
    caption += f"Particles in all: {listed(counts)}."
    return along(name, scene, title, title.lower(), caption, series, group="inside")


def _count(trace: Trace) -> float:
    """How many particles it has: as many are effective while their weights are the same, and begin a history."""
    a = trace.arrays
    return float(np.round(max(np.nanmax(a[name]) for name in ("n_eff", "ancestors") if name in a)))
