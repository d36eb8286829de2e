"""Measures what else affects a time: the cost of reading the clocks, and what the machine did meanwhile."""

import contextlib
import os
import resource
import time
from pathlib import Path
from statistics import median

READINGS = 1000  # of the first measurement in a process
FEWER = 50  # of each later one; the machine's latest state is in the median of the last few
LATEST = 9  # measurements whose median counts

WORK = 3000  # turns of the fixed piece of work, some 0.2 ms
TRIES = 3  # of it, before and after what is timed
SHORTEST_S = 0.1  # s; the system counts the time of processors in 10 ms, too coarse for what is shorter

BUSY = (0, 1, 2, 5, 6)  # fields of /proc/stat: user, nice, system, irq, softirq
STOLEN = 7  # taken by other virtual machines


class Clock:
    """The clocks of this process, which may run many cells."""

    def __init__(self) -> None:
        self._costs: list[int] = []

    def cost(self) -> int:
        """The ns that reading both clocks takes, as the median of the latest measurements."""
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


class Meanwhile:
    """Watches the machine from when it is made; another process beside this one shows in all that it measures."""

    def __init__(self) -> None:
        self._work = _work()
        self._ticks, self._switches = _ticks(), _switches()
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def columns(self) -> dict[str, float]:
        """Returns what it measured since, by column; a column that cannot be read here is absent."""
        wall, cpu = time.perf_counter() - self._wall, time.process_time() - self._cpu
        found = {"waited_share": max(0.0, 1 - cpu / wall), "switches": _switches() - self._switches}
        before, after = self._ticks, _ticks()
        if before and after and wall >= SHORTEST_S:
            tick, all_cores = 1 / os.sysconf("SC_CLK_TCK"), wall * (os.cpu_count() or 1)
            busy, stolen = (tick * (b - a) for a, b in zip(before, after, strict=True))
            found |= {"others_share": min(1.0, max(0.0, busy - cpu) / all_cores), "stolen_share": stolen / all_cores}
        with contextlib.suppress(OSError):
            found["load"] = os.getloadavg()[0]
        if (mhz := _mhz()) is not None:
            found["clock_mhz"] = mhz
        return found | {"work_us": median((*self._work, *_work())) / 1e3}


def _work() -> list[int]:
    """Times a fixed piece of work, in ns of CPU time: longer where the processor is slower or shared."""
    took: list[int] = []
    for _ in range(TRIES):
        start, total = time.process_time_ns(), 0
        for k in range(WORK):
            total += k * k
        took.append(time.process_time_ns() - start)
    return took


def _switches() -> int:
    """Counts how often the system gave this process's core to another one."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw


def _ticks() -> tuple[int, int] | None:
    """The ticks that all cores were busy, and those stolen from them; None where the system does not say."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        fields = [int(text) for text in Path("/proc/stat").read_text().partition("\n")[0].split()[1:]]
        return sum(fields[k] for k in BUSY), fields[STOLEN]
    return None


def _mhz() -> float | None:
    """The mean clock frequency of the cores as the system states it; None where it does not."""
    with contextlib.suppress(OSError, ValueError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        stated = [float(line.partition(":")[2]) for line in lines if line.startswith("cpu MHz")]
        return sum(stated) / len(stated) if stated else None
    return None
