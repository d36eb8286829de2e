"""Dask schedulers and workers as local processes, each with a log for failures at start."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

WITHOUT = 'import sys; sys.modules["slamduel"] = None; '
"""Prefix of the code of a process without this package."""

HASTY = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "5s", "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
"""A silent worker is given up after 5 s, a task after one death of a worker."""


class Processes:
    """A scheduler and its workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.running: list[subprocess.Popen[bytes]] = []
        here = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file))
        self.scheduler = self._start("", "dask_scheduler", *here)
        self.until(self.file.exists)
        self.address = str(json.loads(self.file.read_text())["address"])

    def worker(
        self, *options: str, path: Path | None = None, before: str = "", environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        """Starts one, without a nanny unless the options have `--nanny`.

        `path`: where it finds modules first, `before`: what it runs first.
        """
        local = str(self.folder / "local")
        wanted = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", local, *options)
        return self._start(before, "dask_worker", self.address, *wanted, path=path, more=environment)

    def until(self, there: Callable[[], bool], seconds: float = 60) -> None:
        """Waits for a condition; on timeout, fails with the processes' output."""
        end = time.monotonic() + seconds
        while not there():
            said = "\n".join(path.read_text() for path in self.folder.glob("*.log"))
            assert time.monotonic() < end, said
            time.sleep(0.05)

    def close(self) -> None:
        """Ends all of them."""
        for process in self.running:
            process.send_signal(signal.SIGCONT)
            process.kill()
        for process in self.running:
            process.wait()

    def _start(
        self, before: str, name: str, *options: str, path: Path | None = None, more: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        modules = [str(path or Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        own = {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(modules)}
        environment = {**os.environ, **HASTY, **own, **(more or {})}
        code = f"{before}from distributed.cli.{name} import main; main()"
        with (self.folder / f"{len(self.running)}-{name}.log").open("w") as log:
            command = [sys.executable, "-c", code, *options]
            process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
        self.running.append(process)
        return process
