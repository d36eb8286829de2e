"""Figures of beliefs beside their errors: NEES and NIS along a run, over their degrees of freedom."""

import numpy as np

from .axes import stretches
from .bands import averaged, flagged
from .exhibit import Exhibit
from .names import tags
from .numerals import listed
from .scene import Scene
from .time_curves import Band, Series, along

STRETCHES = 100

MOST = 30.0
"""Values above have nothing to do with the errors: how far above is said, and what is near 1 can be seen."""


def nees(name: str, scene: Scene) -> Exhibit | None:
    """Its mean over independent logs where there are several, else that of the run that is drawn; None without any."""
    return _over_logs(name, scene) or _along(name, scene)


def _over_logs(name: str, scene: Scene) -> Exhibit | None:
    found = {label: mean for label, runs in scene.nees.items() if (mean := averaged(runs)) is not None}
    if not found:
        return None
    series: list[Series] = []
    look = {trace.label: trace.look for trace in scene.traces}
    for label, mean in found.items():
        if label in look:
            t, value = stretches(mean.t, mean.mean, STRETCHES)
            series.append(Series(label, look[label], t, value))
    widest = max(found.values(), key=lambda mean: mean.n.max())
    t, low = stretches(widest.t, widest.low, STRETCHES)
    _, high = stretches(widest.t, widest.high, STRETCHES)
    caption = (
        f"Mean over {widest.n.max()} independent logs. 1 is right, above is overconfident, below cautious. "
        "Grey: where 95 % of means lie if the belief is right."
    )
    called = tags(look)
    for word in ("overconfident", "cautious"):
        names = [called[label] for label, mean in found.items() if label in look and flagged(mean) == word]
        caption += f" Outside more than half of the time, {word}: {listed(names)}." if names else ""
    title, unit = "NEES over the logs", "mean NEES / 3"
    return along(
        name, scene, title, unit, caption, series, group="consistency", level=1.0, most=MOST, band=Band(t, low, high)
    )


def _along(name: str, scene: Scene) -> Exhibit | None:
    series = [
        Series(trace.label, trace.look, *stretches(a["t"][a["at"]], a["nees"] / 3, STRETCHES))
        for trace in scene.traces
        if {"at", "nees"} <= (a := trace.arrays).keys() and np.isfinite(a["nees"]).any()
    ]
    caption = (
        "Mean over short stretches. 1 is right, above is overconfident, below cautious. "
        "No band: errors along one run are not independent."
    )
    title, unit = "NEES along the log", "NEES / 3"
    return along(name, scene, title, unit, caption, series, group="consistency", level=1.0, most=MOST)


def nis(name: str, scene: Scene) -> Exhibit | None:
    """Innovations beside what each backend expected of them; needs no known path. None where no backend tells."""
    series: list[Series] = []
    for trace in scene.traces:
        a = trace.arrays
        seen = np.flatnonzero(a["nis_dof"] > 0) if "nis" in a else np.zeros(0, int)
        seen = seen[np.isfinite(a["nis"][seen])] if len(seen) else seen
        if len(seen):
            t, total = stretches(a["t"][seen], a["nis"][seen], STRETCHES)
            _, dof = stretches(a["t"][seen], a["nis_dof"][seen].astype(float), STRETCHES)
            series.append(Series(trace.label, trace.look, t, total / dof))
    caption = (
        "Squared innovations over what was expected. 1 is right; above, sightings were worse than their stated noise."
    )
    title, unit = "NIS along the log", "NIS / degrees of freedom"
    return along(name, scene, title, unit, caption, series, group="consistency", level=1.0, most=MOST)
