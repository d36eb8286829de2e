"""Measures a log's noise against ground truth: figures for choosing noise settings and judging their limits.

Errors are sighted minus true, and commanded minus true. Their centre is the median; their spread is given twice, by the
median absolute deviation (MAD), which is robust to gross errors, and as the root mean square (RMS) without gross
errors. Choosing settings per robot from these would leak ground truth: no backend is given them.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, between
from ...core.truth.errors import difference, sighting_errors

GROSS = (1.0, 0.15)
"""m, rad. Sightings with larger errors count as gross, and are excluded from the figures."""

EDGES = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # m; bins of distance
FEWEST = 20  # fewest errors for a figure

HORIZON = 10.0
"""s over which the motion's error is evaluated: over one second it is dominated by the wheels' lag."""

_TO_SD = 1.4826  # the standard deviation of a Gaussian per median absolute deviation


def noise(log: Log, truth: Truth) -> dict[str, Any]:
    """The figures of `log` as notes: of sightings in m and rad, of motions in m and rad per root second.

    Figures of fewer than `FEWEST` errors are left out.
    """
    row, errors = sighting_errors(log, truth)
    distance = log.z[row, 0] - errors[:, 0]
    fair = (np.abs(errors) <= GROSS).all(axis=1)
    found: dict[str, Any] = {"sightings compared": len(row), "gross": int((~fair).sum())}
    for axis, name in enumerate(("range", "bearing")):
        figures = _figures(errors[fair, axis])
        alike = _correlation(log, row[fair], errors[fair, axis])
        found[name] = figures if alike is None else figures | {"correlation within 1 s": alike}
    for low, high in pairwise(EDGES):
        here = fair & (low <= distance) & (distance < high)
        found[f"range at {low:g} to {high:g} m"] = _figures(errors[here, 0])
    for name, column in zip(("forward", "lateral", "turn"), motion_errors(log, truth).T, strict=True):
        found[name] = _figures(column)
    return {name: figures for name, figures in found.items() if figures != {}}


def motion_errors(log: Log, truth: Truth, horizon: float = HORIZON) -> Array:
    """(m, 3) errors of the odometry over `horizon` s, in the body frame before it, divided by the root of the time.

    For errors independent from second to second that is the standard deviation over one second, for any horizon.
    """
    poses, driven = _poses(log, truth), log.dead_reckoned()
    first = np.searchsorted(log.t, np.arange(log.t[0], log.t[-1] - horizon, horizon))
    last = np.searchsorted(log.t, log.t[first] + horizon)
    both = np.isfinite(poses[first, 0]) & np.isfinite(poses[last % len(log), 0]) & (last < len(log))
    first, last = first[both], last[both]
    errors = difference(between(driven[first], driven[last]), between(poses[first], poses[last]))
    return errors / np.sqrt(log.t[last] - log.t[first])[:, None]


def _poses(log: Log, truth: Truth) -> Array:
    """(n, 3) the true pose of every step, NaN where unknown."""
    poses = np.full((len(log), 3), np.nan)
    poses[np.searchsorted(log.t, truth.t)] = truth.poses
    return poses


def _figures(errors: Array) -> dict[str, float]:
    if len(errors) < FEWEST:
        return {}
    middle = np.median(errors)
    figures = {
        "median": middle,
        "sd by MAD": _TO_SD * np.median(np.abs(errors - middle)),
        "RMS": np.sqrt(np.mean(errors**2)),
    }
    return {name: round(float(figure), 4) for name, figure in figures.items()}


def _correlation(log: Log, row: Ints, errors: Array) -> float | None:
    """Correlation of errors (m,) between successive sightings, `row` (m,), of a landmark within a second.

    None with too few.
    """
    t, ids = log.t[log.sighting_step[row]], log.ids[row]
    order = np.lexsort((t, ids))
    one, two = order[:-1], order[1:]
    near = (ids[one] == ids[two]) & (t[two] - t[one] <= 1.0)
    if near.sum() < FEWEST:
        return None
    a, b = (errors[side[near]] - np.median(errors) for side in (one, two))
    size = np.sqrt((a @ a) * (b @ b))
    return round(float(a @ b / size), 2) if size > 0 else None
