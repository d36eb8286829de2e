"""Readings at the end of a sensor's range: a value that the extreme repeats, where others do not repeat."""

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...frontend.inertial.imu import GRAVITY

RUN = 3  # readings in a row with one value
ALL = 0.99  # share of all readings beyond which one value is what there is to measure, without noise
SELDOM = 0.01  # share of other readings in such runs: of more, a sensor repeats values anyway

RATES = tuple(np.deg2rad((125.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0)).tolist())
FORCES = tuple(GRAVITY * one for one in (2.0, 4.0, 8.0, 16.0))
"""rad/s and m/s^2, ranges that sensors have."""

NEAR = 0.015  # share by which a sensor's range may differ from the one on its data sheet


def clipped(values: Array, ranges: tuple[float, ...]) -> NDArray[np.bool_]:
    """(n,) at which readings one of the axes of `values` (n, 3) is at the end of its range, one of `ranges` or not."""
    found = np.zeros(len(values), np.bool_)
    for axis in values.T:
        most = float(np.abs(axis).max())
        runs = _in_runs(axis)
        ends = runs & (np.abs(axis) >= most * (1 - 1e-9)) & (most > 0)
        usual = any(abs(most / one - 1) < NEAR for one in ranges)
        if usual or ((runs & ~ends).mean() < SELDOM and ends.mean() < ALL):
            found |= ends
    return found


def _in_runs(axis: Array) -> NDArray[np.bool_]:
    """(n,) which values are among at least `RUN` equal ones in a row."""
    new = np.append(True, np.diff(axis) != 0)
    lengths = np.diff(np.append(np.flatnonzero(new), len(axis)))
    return np.repeat(lengths >= RUN, lengths)
