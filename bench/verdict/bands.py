"""Tests consistency over time: NEES averaged over independent logs, with its chi-square band.

Logs of one cluster are not independent: their mean counts as one log. That of a consistent belief varies no more than
one log's, so the band holds 95 % of the means or more.

Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 5.4.2. Within a
run NEES is correlated, so its mean over time has no such band; over N independent logs N times the mean at one time is
chi-square distributed with 3 N degrees of freedom if the covariance is that of the errors.
"""

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array

DOF = 3  # degrees of freedom of a pose's NEES
LEVEL = 0.05  # share of times outside that is expected of a consistent belief


class Averages(NamedTuple):
    """Mean NEES over its degrees of freedom at each time; 1 is consistent."""

    t: Array  # (m,) s
    mean: Array  # (m,) over the units of logs that have a covariance then; NaN where fewer than two have
    low: Array  # (m,) the 95 % band's ends, on the same scale; NaN where the mean is
    high: Array  # (m,)
    n: Array  # (m,) units that have a covariance then
    inside: float  # share of the times with a mean at which it is inside the band


def averaged(runs: Sequence[tuple[Array, Array]], units: Sequence[Hashable] | None = None) -> Averages | None:
    """Averages the NEES of runs at common times, on logs of these units, or on independent ones.

    A run is its times (k,) in s, rising, and its pose NEES (k,), NaN without a covariance. Common times are those of
    the run that has the fewest between the latest start and the earliest end; the others are read at their nearest
    earlier step. None where no two runs have a NEES at one time.
    """
    of = [unit for unit, run in zip(units or range(len(runs)), runs, strict=True) if len(run[0])]
    runs = [run for run in runs if len(run[0])]
    if len(runs) < 2:
        return None
    start, end = max(times[0] for times, _ in runs), min(times[-1] for times, _ in runs)
    t = min((times[(times >= start) & (times <= end)] for times, _ in runs), key=len)
    nees = np.array([values[np.searchsorted(times, t, side="right") - 1] for times, values in runs]) / DOF
    nees = _by_unit(nees, of)
    n = (~np.isnan(nees)).sum(0)
    shared = n >= 2
    if not shared.any():
        return None
    mean = np.where(shared, np.nansum(nees, 0) / np.maximum(n, 1), np.nan)
    low, high = (np.where(shared, end, np.nan) for end in band(np.maximum(n, 2)))
    return Averages(t, mean, low, high, n, float(((low <= mean) & (mean <= high))[shared].mean()))


def _by_unit(nees: Array, units: Sequence[Hashable]) -> Array:
    """Averages the rows (logs, m) of each unit; NaN where none of its logs has a value."""
    rows: dict[Hashable, list[int]] = {}
    for row, unit in enumerate(units):
        rows.setdefault(unit, []).append(row)
    if len(rows) == len(nees):
        return nees
    known = ~np.isnan(nees)
    with np.errstate(invalid="ignore"):
        return np.array([np.nansum(nees[mine], 0) / known[mine].sum(0) for mine in rows.values()])


def band(n: Array) -> tuple[Array, Array]:
    """The ends of the 95 % band of the mean NEES/3 of n logs; n is of any shape."""
    from scipy.special import chdtri

    dof = DOF * np.asarray(n, float)
    return chdtri(dof, 1 - LEVEL / 2) / dof, chdtri(dof, LEVEL / 2) / dof
