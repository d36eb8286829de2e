"""Figures of particles: whether there are still many that count, and many histories."""

import numpy as np

from .axes import stretches
from .exhibit import Exhibit
from .scene import Scene
from .time_curves import Series, along

STRETCHES = 100


def effective(name: str, scene: Scene) -> Exhibit | None:
    """How many particles carry the weight."""
    caption = "1 / sum of squared weights: low where few particles carry all."
    return _particles(name, scene, "n_eff", "Effective particles", caption)


def ancestors(name: str, scene: Scene) -> Exhibit | None:
    """How many histories are left."""
    caption = "Starting particles with descendants left. At 1, all share one early path that no sighting can change."
    return _particles(name, scene, "ancestors", "Ancestors left", caption)


def _particles(name: str, scene: Scene, array: str, title: str, caption: str) -> Exhibit | None:
    series = [
        Series(trace.label, trace.look, *stretches(a["t"], a[array].astype(float), STRETCHES))
        for trace in scene.traces
        if array in (a := trace.arrays) and np.isfinite(a[array]).any() and (a[array] > 0).any()
    ]
    return along(name, scene, title, title.lower(), caption, series, group="inside")
