"""Positions by GPS and headings by compass in a simulated world, as options of the dataset.

Their errors are drawn from generators of their own: everything else of the log is the same, bit for bit.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...core.elementary import sincos
from ...core.factors import CONSTANTS_NOTE, Dataset, Log
from ...core.fixes import FixTable
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ...core.truth.errors import rows_of

FIXES_NOTE = "fixes"  # the key of how many there are, among the log's notes


@dataclass(frozen=True)
class WorldFixes:
    """Measurements of the pose in the world, by default none; a simulated world's options inherit it."""

    gps: float = option(0.0, "time between positions by GPS, s; 0: none", minimum=0.0, maximum=1e6)
    gps_sd: float = option(1.0, "standard deviation of x and of y of these, m", minimum=1e-4, maximum=1e4, beside="gps")
    gps_x: float = option(0.0, "place of the antenna, m ahead", minimum=-100.0, maximum=100.0, beside="gps")
    gps_y: float = option(0.0, "likewise, m to the left", minimum=-100.0, maximum=100.0, beside="gps")
    compass: float = option(0.0, "time between headings by compass, s; 0: none", minimum=0.0, maximum=1e6)
    compass_sd: float = option(0.05, "standard deviation of these, rad", minimum=1e-6, maximum=3.0, beside="compass")
    compass_offset: float = option(
        0.0, "sd of a constant error of the compass, drawn and stated, rad", minimum=0.0, maximum=1.0, beside="compass"
    )


def with_fixes(dataset: Dataset, options: WorldFixes, rng: np.random.Generator) -> Dataset:
    """Adds positions and headings to the log, at the first step after each period from the start on.

    A step without a true pose has none.
    """
    log, truth = dataset
    if truth is None or not (options.gps or options.compass):
        return dataset
    positioning, pointing = rng.spawn(2)
    at, by_gps = _true(log, truth.t, truth.poses, due(log.t, options.gps))
    s, c = sincos(by_gps[:, 2])
    arm = np.tile((options.gps_x, options.gps_y), (len(at), 1))
    ahead = np.column_stack((c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]))
    z = np.full((len(at), 3), np.nan)
    z[:, :2] = by_gps[:, :2] + ahead + options.gps_sd * positioning.standard_normal((len(at), 2))
    cov = np.full((len(at), 3, 3), np.nan)
    cov[:, :2, :2] = options.gps_sd**2 * np.eye(2)
    offset = options.compass_offset * pointing.standard_normal()
    then, by_compass = _true(log, truth.t, truth.poses, due(log.t, options.compass))
    heading = by_compass[:, 2] + offset + options.compass_sd * pointing.standard_normal(len(then))
    nothing = np.full((len(then), 2), np.nan)
    compass_cov = np.full((len(then), 3, 3), np.nan)
    compass_cov[:, 2, 2] = options.compass_sd**2
    step = np.concatenate((at, then))
    order = np.argsort(step, kind="stable")
    fixes = FixTable.from_arrays(
        len(log),
        step[order],
        np.concatenate((z, np.column_stack((nothing, wrap(heading)))))[order],
        np.concatenate((cov, compass_cov))[order],
        np.concatenate((arm, np.zeros((len(then), 2))))[order],
    )
    constant = log.prior.systematic._replace(heading_offset=options.compass_offset)
    notes = {**log.notes, FIXES_NOTE: {"positions": len(at), "headings": len(then)}}
    if options.compass and options.compass_offset:
        notes[CONSTANTS_NOTE] = {**log.notes.get(CONSTANTS_NOTE, {}), "heading_offset": float(offset)}
    return Dataset(replace(log, prior=log.prior._replace(systematic=constant), fixes=fixes, notes=notes), truth)


def due(t: Array, period: float) -> Ints:
    """The first step at or after each multiple of the period, from the first one on; none without a period."""
    if not period:
        return np.zeros(0, np.int64)
    passed = np.floor((t - t[0]) / period * (1 + 1e-12))
    return np.flatnonzero(np.diff(passed) > 0) + 1


def _true(log: Log, t: Array, poses: Array, step: Ints) -> tuple[Ints, Array]:
    """Those of the steps that have a true pose, and it (m, 3)."""
    row = rows_of(t, log.t[step])
    return step[row >= 0], poses[row[row >= 0]]
