"""Measures the cost of reading the clocks, which is subtracted from what they measure."""

import time
from statistics import median

READINGS = 1000  # of the first measurement in a process
FEWER = 50  # of each later one; the machine's latest state is in the median of the last few
LATEST = 9  # measurements whose median counts


class Clock:
    """The clocks of this process, which may run many cells."""

    def __init__(self) -> None:
        self._costs: list[int] = []

    def cost(self) -> int:
        """Returns the ns that reading both clocks takes, as the median of the latest measurements."""
        self._costs = [*self._costs, clock_cost(FEWER if self._costs else READINGS)][-LATEST:]
        return int(median(self._costs))


CLOCK = Clock()


def clock_cost(readings: int = READINGS) -> int:
    """Measures the ns that reading both clocks around an empty call takes, as in a timing pass; the median."""
    costs: list[int] = []
    for _ in range(readings):
        before = time.process_time_ns()
        time.perf_counter_ns()
        time.perf_counter_ns()
        costs.append(time.process_time_ns() - before)
    return int(median(costs))
