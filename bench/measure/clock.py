"""What it costs to read the clocks: measured where they are read, and taken off what they say."""

import time
from statistics import median

READINGS = 1000
"""Of the first measurement in a process."""

FEWER = 50
"""Of each later one: whatever has become of the machine since is in the median of the last few."""

LATEST = 9
"""Measurements whose median counts."""


class Clock:
    """The clocks of this process, which may run many cells."""

    def __init__(self) -> None:
        self._costs: list[int] = []

    def cost(self) -> int:
        """ns that reading both clocks takes, as `clock_cost` has it; the median of what was found lately."""
        self._costs = [*self._costs, clock_cost(FEWER if self._costs else READINGS)][-LATEST:]
        return int(median(self._costs))


CLOCK = Clock()


def clock_cost(readings: int = READINGS) -> int:
    """ns that reading both clocks before and after an empty call takes, as a timing pass sees it; the median."""
    costs: list[int] = []
    for _ in range(readings):
        before = time.process_time_ns()
        time.perf_counter_ns()
        time.perf_counter_ns()
        costs.append(time.process_time_ns() - before)
    return int(median(costs))
