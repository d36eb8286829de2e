"""`bench speed --pool`: what a pool of processes adds to the cells that it runs, beside the cells' own work alone.

The reference is that work in the same run, by as many processes at once and in turns with the pool: the log drawn and
checked, the backend warmed up and taken through it twice, its beliefs asked for, and the outcome judged.
"""

import argparse
import contextlib
import multiprocessing
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from ...backends import registry as backends
from ...datasets import cache
from ...datasets import registry as datasets
from ...frontend.errors import InputError
from ...frontend.files import write_whole
from ..measure.cell import Job, generator
from ..measure.drive import WARM_UP, drive
from ..measure.memory import MEGABYTE
from ..measure.score import score
from ..words.console import plain
from ..workers.batch import Batch
from ..workers.local_executor import Local
from ..workers.tasks import execute

OPTIONS = ("cells", "workers")
"""The study's own."""

CELLS, QUICK = 1000, 100
TURNS = 4
"""Of the pool and the reference."""

MEMORY_MB = 4000
LEAST = 4 * TURNS
EVERY = 20
"""Cells between two looks at what the workers have spent."""


class Share(NamedTuple):
    """What one turn came to."""

    wall_s: float
    cpu_s: float  # of all processes that had a part in it


class Found(NamedTuple):
    """Over all turns. Memory is that of the largest worker."""

    cells_a_second: float
    pool_ms: float  # of CPU, a cell: workers and the process that hears them
    bare_ms: float  # of CPU, a cell: the work itself
    first_mb: float  # after the first turn
    last_mb: float  # after the last

    @property
    def added_ms(self) -> float:
        """CPU a cell that is neither simulation nor backend nor metrics."""
        return self.pool_ms - self.bare_ms


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Add the study's own options."""
    group.add_argument("--cells", type=int, metavar="N", help=f"that are run ({CELLS}; quick {QUICK})")
    group.add_argument("--workers", type=int, metavar="N", help="processes (one a core)")


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measure and print; the files written."""
    cells = namespace.cells or (QUICK if namespace.quick else CELLS)
    workers = namespace.workers or os.cpu_count() or 1
    if cells < LEAST or workers < 1:
        raise InputError(f"--cells {cells}, --workers {workers}: expected at least {LEAST} cells and 1 worker")
    if not Path("/proc/self/stat").exists():
        raise InputError("--pool: found no /proc, expected Linux, which tells what a process costs while it runs")
    found = measured(_batches(cells, namespace.seed), workers)
    rows = {
        "cells a second": found.cells_a_second,
        "CPU of a cell in the pool, ms": found.pool_ms,
        "CPU of its simulation, backend and metrics alone, ms": found.bare_ms,
        "CPU that is added, ms": found.added_ms,
        "pool / bare": found.pool_ms / found.bare_ms,
        "memory of the largest worker after a quarter, MB": found.first_mb,
        "memory of the largest worker at the end, MB": found.last_mb,
    }
    title = f"{cells:,} cells of city[steps=500,landmarks=40] x ekf on {workers} processes"
    table = Table(title=plain(title))
    table.add_column("")
    table.add_column("", justify="right")
    for name, value in rows.items():
        table.add_row(name, f"{value:.2f}")
    console.print(table)
    files = [namespace.csv] * (namespace.csv is not None)
    files += [] if namespace.out is None else [namespace.out / "pool.csv"]
    for path in files:
        write_whole(path, "what,value\n" + "".join(f'"{name}",{value!r}\n' for name, value in rows.items()))
    return files


def measured(batches: Sequence[Batch], workers: int) -> Found:
    """The pool and the reference in turns, over all of `batches`; the first few of them start the workers."""
    pool, held = Local(workers), list[float]()
    list(pool.run(batches[: 2 * workers], alone=False))
    pooled, bare_s = list[Share](), 0.0
    for turn in range(TURNS):
        mine = batches[turn::TURNS]
        pooled.append(_pooled(pool, mine))
        held.append(_resident_mb())
        tasks = [mine[k::workers] for k in range(workers)]
        bare_s += sum(ended.value for ended in execute(bare, [task for task in tasks if task], workers=workers))
    pool.close()
    n = len(batches)
    wall, cpu_s = sum(share.wall_s for share in pooled), sum(share.cpu_s for share in pooled)
    return Found(n / wall, 1e3 * cpu_s / n, 1e3 * bare_s / n, held[0], held[-1])


def bare(batches: Sequence[Batch]) -> float:
    """s of CPU of the work of the batches, in a process of its own that the first of them has warmed up."""
    _work(batches[0])
    return sum(_work(batch) for batch in batches)


def _work(batch: Batch) -> float:
    """s of CPU of one cell's work, with nothing around it."""
    source = datasets.find(batch.dataset)
    ((_, job),) = batch.jobs
    builder = backends.find(job.name)
    began = time.process_time()
    log, truth = cache.prepared(batch.dataset, source, batch.options, batch.seed)
    drawn = time.process_time()
    steps = list(log)
    driven = time.process_time()
    for part, asked in ((steps[:WARM_UP], False), (steps, False), (steps, True)):
        backend = builder.make(log.prior, job.options, generator(job.seed, job.backend))
        for step in part:
            backend.step(step)
            if asked:
                backend.belief()
        backend.map() if asked else backend.finish()
    ended = time.process_time()
    outcome = drive(builder, job.options, log, lambda: generator(job.seed, job.backend))
    judged = time.process_time()
    score(log, outcome, truth)
    return time.process_time() - judged + ended - driven + drawn - began


def _pooled(pool: Local, batches: Sequence[Batch]) -> Share:
    """What it costs the pool, and the process that hears it."""
    began, mine, before = time.perf_counter(), time.process_time(), _spent()
    latest = dict(before)
    for k, finished in enumerate(pool.run(batches, alone=False)):
        if finished.result.status != "done":
            raise InputError(f"a cell of the pool ended as {finished.result.status}: {finished.result.reason}")
        if k % EVERY == 0:  # of a worker that is replaced nobody tells afterwards
            latest |= _spent()
    latest |= _spent()
    cpu = sum(spent - before.get(pid, 0.0) for pid, spent in latest.items())
    return Share(time.perf_counter() - began, cpu + time.process_time() - mine)


def _spent() -> dict[int, float]:
    """s of CPU of each child, by its id."""
    found: dict[int, float] = {}
    for process in multiprocessing.active_children():
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
            found[process.pid or 0] = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    return found


def _resident_mb() -> float:
    """MB that the largest child holds."""
    pages = [
        int(Path(f"/proc/{child.pid}/statm").read_text().split()[1]) for child in multiprocessing.active_children()
    ]
    return max(pages) * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def _batches(cells: int, seed: int) -> list[Batch]:
    city: Any = datasets.find("city").options(steps=500, landmarks=40)
    options = backends.find("ekf").options()
    jobs = [((k, Job("ekf", "ekf", options, seed + k, MEMORY_MB)),) for k in range(cells)]
    return [Batch("city", city, seed + k, job, 600.0, False) for k, job in enumerate(jobs)]
