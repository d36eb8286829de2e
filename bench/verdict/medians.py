"""What a backend typically has on a dataset: a median over logs, with what is known of how far it can be relied on."""

from typing import NamedTuple

import numpy as np

from .statistics import FEWEST, estimate
from .summary import Line


class Typical(NamedTuple):
    """Of a column, over logs."""

    value: float  # the median; infinite where half of the cells have failed
    low: float
    high: float
    n: int  # logs
    interval: bool  # whether low and high are the ends of a 95 % interval, or of the range that was measured


def typical(line: Line, column: str) -> Typical:
    """Of a column in which the line has a value. On a single log, the median and range of the runs on it."""
    by_log = line.by_log(column)
    values = list(by_log.values()) if len(by_log) > 1 else [value for _, value in line.runs(column)]
    if len(by_log) >= FEWEST:
        return Typical(*estimate(values), interval=True)
    return Typical(float(np.median(values)), min(values), max(values), len(by_log), interval=False)
