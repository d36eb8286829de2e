"""What a backend typically has on a dataset: a median over logs, with what is known of how far it can be relied on."""

from typing import NamedTuple

import numpy as np

from .statistics import FEWEST, estimate
from .summary import Line

ERRORS = frozenset((
    "ate_m", "ate_origin_m", "heading_rad", "map_rmse_m", "final_ate_m", "final_ate_origin_m", "final_heading_rad",
    "final_map_rmse_m", "rpe_m", "rpe_10m_m", "rpe_100m_m", "rpe_1s_m", "rpe_10s_m", "rpe_rad", "final_rpe_m",
    "final_rpe_10m_m", "final_rpe_100m_m", "final_rpe_1s_m", "final_rpe_10s_m", "final_rpe_rad",
))  # fmt: skip
"""Columns in which a cell that failed counts as the worst there is: infinite."""


class Typical(NamedTuple):
    """Of a column, over logs."""

    value: float  # the median; infinite where half of the cells have failed
    low: float
    high: float
    n: int  # logs
    interval: bool  # whether low and high are the ends of a 95 % interval, or of the range that was measured


def typical(line: Line, column: str) -> Typical:
    """Of a column in which the line has a value. On a single log, the median and range of the runs on it."""
    by_log = line.by_log(column) if column in ERRORS else line.measured(column)
    values = list(by_log.values()) if len(by_log) > 1 else [value for _, value in line.runs(column)]
    if len(by_log) >= FEWEST:
        return Typical(*estimate(values), interval=True)
    if column not in ERRORS:
        values = [value for value in values if np.isfinite(value)]
    return Typical(float(np.median(values)), min(values), max(values), len(by_log), interval=False)
