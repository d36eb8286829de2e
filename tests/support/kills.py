"""Kills a study at random moments and resumes it to the end, then compares its store with an uninterrupted run's.

As a program it kills that many times: python tests/support/kills.py 20 (make study-kills). The runner, a worker, the
scheduler and a worker of a Dask cluster are killed in turn, with SIGKILL.
"""

import contextlib
import itertools
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

from slamduel.bench.record.schema import ABOUT
from slamduel.bench.words.columns import COLUMNS

STUDY = """
title = "Killed"
question = "Does a study that is killed end as if it had not been?"

[[cells]]
dataset = "matlab-report"
backend = ["dead-reckoning", "ekf", "fastslam[particles=20]"]
seeds = SEEDS
grid."dataset.tags" = [6, 12]

[[claim]]
says = "the EKF is closer than odometry alone"
measure = "ate_m"
less = { backend = "ekf" }
than = { backend = "dead-reckoning" }
each = "tags"
"""
TIMES = {column.name for column in COLUMNS.values() if column.kind.is_time} | {"peak_mb", *ABOUT}
"""Columns of times and places."""

PATIENCE = 300.0
"""s; timeout of an uninterrupted end."""

LATEST = 5.0
"""s after the first result, at most, at which something is killed."""

Processes = list[subprocess.Popen[bytes]]


def started(folder: Path, *more: str) -> subprocess.Popen[bytes]:
    """Resumes the study in `folder`."""
    study = folder.parent / "killed.toml"
    command = [sys.executable, "-m", "slamduel.bench.cli", "ablate", str(study), "--out", str(folder), *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=folder.parent)


def rows(folder: Path) -> list[tuple[Any, ...]]:
    """The store's rows of the study's cells, without times and places."""
    with sqlite3.connect(f"file:{folder / 'results.sqlite'}?mode=ro", uri=True) as db:
        found = db.execute("SELECT * FROM cells")
        kept = [k for k, about in enumerate(found.description) if about[0] not in TIMES]
        return [tuple(row[k] for k in kept) for row in found]


def stray(folder: Path) -> tuple[int, int]:
    """The number of results in the store, and of those that belong to no cell of the study."""
    with sqlite3.connect(f"file:{folder / 'results.sqlite'}?mode=ro", uri=True) as db:
        (every,) = db.execute("SELECT count(*) FROM results").fetchone()
        (lost,) = db.execute("SELECT count(*) FROM results WHERE key NOT IN (SELECT key FROM plan)").fetchone()
    return every, lost


def descendants(pid: int) -> list[int]:
    """The process's descendants; parents first."""
    parents: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        parents.setdefault(int(words[1]), []).append(int(stat.parent.name))
    found, waiting = [], [pid]
    while waiting:
        children = parents.get(waiting.pop(), [])
        found += children
        waiting += children
    return found


@contextlib.contextmanager
def cluster(folder: Path, workers: int) -> Generator[tuple[str, Processes]]:
    """A Dask cluster for the test: its address, and its processes, the scheduler first."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    module = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    log = (folder / "cluster.txt").open("ab")
    running: Processes = []
    try:
        for command in (module, *[worker] * workers):
            running.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=folder))
        yield address, running
    finally:
        for pid in [child for process in running for child in [process.pid, *descendants(process.pid)]]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for process in running:
            process.wait()
        log.close()


def under_way(folder: Path, runner: subprocess.Popen[bytes], wait_s: float) -> bool:
    """Waits for a new result in the store, and then `wait_s`; False if the runner has ended."""
    before, end = held(folder), time.monotonic() + PATIENCE
    while runner.poll() is None and held(folder) == before:
        if time.monotonic() > end:
            raise AssertionError("no cell was finished in time")
        time.sleep(0.05)
    with contextlib.suppress(subprocess.TimeoutExpired):
        runner.wait(wait_s)
    return runner.poll() is None


def held(folder: Path) -> int:
    """The number of results in the store; 0 before it exists."""
    try:
        return stray(folder)[0]
    except sqlite3.Error:
        return 0


def killed(folder: Path, victim: str, draws: random.Random, latest: float = LATEST) -> tuple[bool, int, str]:
    """Resumes the study in `folder` and kills the victim; returns if that succeeded, exit status and last output."""
    distant = victim in ("scheduler", "worker of Dask's")
    with cluster(folder.parent, 3) if distant else contextlib.nullcontext(("", [])) as (address, processes):
        where = ["--executor", "dask", "--scheduler", address] if distant else ["--jobs", "2"]
        runner = started(folder, *where)
        try:
            struck = under_way(folder, runner, draws.uniform(0, latest))
            if struck:
                os.kill(_process(victim, runner, processes, draws), signal.SIGKILL)
            said = runner.communicate(timeout=PATIENCE)[1].decode()
        finally:
            runner.kill()
    return struck, runner.returncode, said


def _process(victim: str, runner: subprocess.Popen[bytes], processes: Processes, draws: random.Random) -> int:
    if victim == "runner":
        return runner.pid
    if victim == "scheduler":
        return processes[0].pid
    started_by = [runner] if victim == "worker" else [draws.choice(processes[1:])]
    return draws.choice([pid for process in started_by for pid in descendants(process.pid)])


def main(times: int) -> None:
    """Kills that many times, over as many runs of the study as that takes; AssertionError if a row differs."""
    draws, done = random.Random(1), 0
    victims = itertools.cycle(["runner", "worker", "scheduler", "worker of Dask's"])
    with tempfile.TemporaryDirectory() as name:
        here = Path(name)
        write(here, seeds=30)
        expected = uninterrupted(here / "uninterrupted")
        while done < times:
            folder, status = here / f"killed-{done}", -1
            while status != 0:
                victim = next(victims)
                struck, status, said = killed(folder, victim, draws)
                done += struck
                print(f"{done}: {victim}{'' if struck else ', too late'}: status {status} {said.strip()}", flush=True)
                assert struck or status == 0, "it failed by itself"
            same(folder, expected)
            print(f"all {len(expected)} rows equal those of an uninterrupted run", flush=True)


def write(folder: Path, *, seeds: int) -> None:
    """Writes the study's file."""
    (folder / "killed.toml").write_text(STUDY.replace("SEEDS", str(seeds)))


def uninterrupted(folder: Path) -> list[tuple[Any, ...]]:
    """The rows of the study in `folder` after an uninterrupted run."""
    runner = started(folder)
    assert runner.communicate(timeout=PATIENCE)[1] == b""
    assert runner.returncode == 0
    return rows(folder)


def same(folder: Path, expected: list[tuple[Any, ...]]) -> None:
    """AssertionError if the store has an unexpected row, lacks one, or has one twice."""
    assert rows(folder) == expected
    assert stray(folder) == (len(expected), 0)


if __name__ == "__main__":
    main(int(sys.argv[1]))
