"""Figures of consistency, NEES and NIS over their degrees of freedom, and of particles."""

import numpy as np
from scipy.special import chdtri

from ..drawing.axes import stretches
from ..drawing.figure import ReportFigure
from ..verdict.bands import averaged
from ..verdict.consistency import belief_clauses
from ..words.names import tags
from ..words.numerals import listed, number
from ..words.styles import BASELINE
from .drawn_log import DrawnLog, Trace
from .time_curves import Band, Series, along

STRETCHES = 100

NIS_STRETCHES = 50  # of all logs together
MOST = 30.0  # values above are unrelated to the errors and left out, so that those near 1 stay visible


def nees(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws mean NEES over independent logs, else that of the drawn run; None without any."""
    return _over_logs(name, log) or _along(name, log)


def _over_logs(name: str, log: DrawnLog) -> ReportFigure | None:
    found = {
        label: mean for label, runs in log.nees.items() if (mean := averaged(runs, log.units.get(label))) is not None
    }
    if not found:
        return None
    series: list[Series] = []
    look = {trace.label: trace.look for trace in log.traces}
    for label, mean in found.items():
        if label in look:
            t, value = stretches(mean.t, mean.mean, STRETCHES)
            series.append(Series(label, look[label], t, value))
    widest = max(found.values(), key=lambda mean: mean.n.max())
    t, low = stretches(widest.t, widest.low, STRETCHES)
    _, high = stretches(widest.t, widest.high, STRETCHES)
    clustered = any(len(set(units)) < len(units) for units in log.units.values())
    what = "clusters of logs" if clustered else "independent logs"
    caption = (
        f"Mean over {widest.n.max()} {what}. 1 is consistent, above is overconfident, below cautious. "
        "Grey: where 95 % of a consistent filter's means lie."
    )
    called = tags(look)
    judged = belief_clauses(log.lines, {label: called[label] for label in found if label in look})
    medians = "Table and verdict have the median over the logs instead, which one lost run does not move"
    caption += f" {medians}: by it, {judged}." if judged else ""
    title, unit = "NEES over the logs", "mean NEES / 3"
    return along(
        name, log, title, unit, caption, series, group="consistency", level=1.0, most=MOST, band=Band(t, low, high)
    )


def _along(name: str, log: DrawnLog) -> ReportFigure | None:
    series = [
        Series(trace.label, trace.look, *stretches(a["t"][a["at"]], a["nees"] / 3, STRETCHES))
        for trace in log.traces
        if {"at", "nees"} <= (a := trace.arrays).keys() and np.isfinite(a["nees"]).any()
    ]
    caption = (
        "Mean over short stretches. 1 is consistent, above is overconfident, below cautious. "
        "No band: errors along one run are not independent."
    )
    title, unit = "NEES along the log", "NEES / 3"
    return along(name, log, title, unit, caption, series, group="consistency", level=1.0, most=MOST)


def nis(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws squared innovations over their covariance; None without, or on a single log, where only scatter shows."""
    known = {label: [run for run in runs if len(run[0])] for label, runs in log.nis.items()}
    shown = {trace.label: known[trace.label] for trace in log.traces if len(known.get(trace.label, ())) > 1}
    if not shown:
        return None
    look = {trace.label: trace.look for trace in log.traces}
    end = max(float(t[-1]) for runs in shown.values() for t, _, _ in runs)
    edges = np.linspace(0, end, NIS_STRETCHES + 1)
    series: list[Series] = []
    bands: list[Band] = []
    for label, runs in shown.items():
        t, total, dof = (np.concatenate([run[k] for run in runs]) for k in range(3))
        sums, counts = (np.histogram(t, edges, weights=weights)[0] for weights in (total, dof))
        seen = counts > 0
        middle = ((edges[:-1] + edges[1:]) / 2)[seen]
        series.append(Series(label, look[label], middle, sums[seen] / counts[seen]))
        bands.append(Band(middle, *(chdtri(counts[seen], p) / counts[seen] for p in (0.975, 0.025))))
    caption = (
        "Squared innovations over what was expected, over short stretches of "
        f"{max(map(len, shown.values()))} independent logs. 1 is consistent; above, sightings were worse than their "
        "stated noise, below, better. Grey: where 95 % of a consistent filter's lie."
    )
    without = [label for label in look if label not in log.nis and label != BASELINE]
    if without:
        called = tags(look)
        caption += f" {listed([called[label] for label in without])} {'gives' if len(without) == 1 else 'give'} no NIS."
    title, unit = "NIS over the logs", "NIS / degrees of freedom"
    return along(
        name, log, title, unit, caption, series, group="consistency", level=1.0, most=MOST, band=bands[0], start=0.0
    )


def effective(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws the effective number of particles."""
    caption = "1 / sum of squared weights: low where few particles carry all. "
    return _particles(name, log, "n_eff", "Effective particles", caption)


def ancestors(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws the number of surviving ancestors."""
    caption = (
        "Starting particles with descendants left: at 1, all share one early path. The belief is their spread, so few "
        "ancestors make it overconfident. "
    )
    return _particles(name, log, "ancestors", "Ancestors left", caption)


def _particles(name: str, log: DrawnLog, array: str, title: str, caption: str) -> ReportFigure | None:
    having = [
        trace
        for trace in log.traces
        if array in (a := trace.arrays) and np.isfinite(a[array]).any() and (a[array] > 0).any()
    ]
    if not having:
        return None
    series = [
        Series(trace.label, trace.look, *stretches(trace.arrays["t"], trace.arrays[array].astype(float), STRETCHES))
        for trace in having
    ]
    called = tags(trace.label for trace in log.traces)
    counts = [f"{called[trace.label]} {number(_count(trace))}" for trace in having]
    caption += f"Particles in all: {listed(counts)}."
    return along(name, log, title, title.lower(), caption, series, group="inside")


def _count(trace: Trace) -> float:
    """Returns its number of particles: as many are effective and ancestors at first."""
    counts = [trace.arrays[name] for name in ("n_eff", "ancestors") if name in trace.arrays]
    return float(np.round(max(np.nanmax(one) for one in counts if np.isfinite(one).any())))
