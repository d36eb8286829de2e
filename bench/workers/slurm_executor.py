"""Runs cells on a Dask cluster whose workers are SLURM jobs, submitted by dask-jobqueue as configured by the user."""

import contextlib
import shutil
import signal
import threading
from collections.abc import Callable, Generator
from functools import cached_property
from typing import Any

from ...core.errors import InputError
from .dask_cluster import RESOURCE, Cluster, quieten
from .dask_executor import Dask, to_stderr

QUIET = {"dashboard": False, "dashboard_address": ":0"}  # of the scheduler: no dashboard, and a free port for HTTP
QUEUE_S = 24 * 3600  # s for SLURM to start a first job, or the next one when all have reached their time limits


class Slurm(Dask):
    """An executor of so many jobs, each as `jobqueue.slurm` in the user's Dask configuration describes.

    `exclusive`: each job has its node to itself, as a study with timed cells needs it. The Dask scheduler runs in this
    process, not in a job.
    """

    name = "slurm"

    def __init__(
        self, workers: int, *, exclusive: bool, patience_s: float = QUEUE_S, say: Callable[[str], None] = to_stderr
    ) -> None:
        super().__init__("slurm", patience_s=patience_s, say=say)
        self.workers = workers
        self.exclusive = exclusive

    @property
    def times(self) -> bool:
        """True where each job has its node to itself."""
        return self.exclusive

    def close(self) -> None:
        """Ends the jobs."""
        super().close()
        if "_jobs" in self.__dict__:
            self._jobs.close(timeout=30)
            del self._jobs

    def job_script(self) -> str:
        """The script that sbatch is given for each worker."""
        return self._jobs.job_script()

    @cached_property
    def cluster(self) -> Cluster:
        """Submits the jobs and connects to a scheduler of its own; InputError where that is not possible."""
        self._jobs.scale(jobs=self.workers)
        return Cluster(self._jobs.scheduler_address)

    @cached_property
    def _jobs(self) -> Any:
        """Makes a SLURMCluster without jobs; InputError if it is not installed, not configured or not possible."""
        try:
            from dask import config

            with _own_interrupt():
                from dask_jobqueue.slurm import SLURMCluster
        except ImportError:
            raise InputError(
                "--executor slurm: dask-jobqueue is not installed; expected it here: pip install 'slamduel[slurm]'."
            ) from None
        quieten()
        if shutil.which("sbatch") is None:
            raise InputError("--executor slurm: there is no sbatch here; expected a machine that submits SLURM's jobs.")
        unset = [name for name in ("cores", "memory") if config.get(f"jobqueue.slurm.{name}", None) is None]
        if unset:
            raise InputError(
                f"--executor slurm: jobqueue.slurm.{unset[0]} is not set; expected jobqueue: {{slurm: {{cores: 8, "
                f"memory: 16GB, walltime: '04:00:00'}}}} or the like in {config.PATH}/jobqueue.yaml."
            )
        given: dict[str, Any] = {"scheduler_options": QUIET | _configured("scheduler-options", {})}
        if self.exclusive:
            given["processes"] = 1
            given["worker_extra_args"] = [*_configured("worker-extra-args", []), "--resources", f"{RESOURCE}=1"]
            given["job_extra_directives"] = [*_configured("job-extra-directives", []), "--exclusive"]
        try:
            return SLURMCluster(**given)
        except (ValueError, TypeError, OSError) as error:
            raise InputError(
                f"--executor slurm: {error}; expected a configuration that dask-jobqueue takes, in {config.PATH}."
            ) from None


@contextlib.contextmanager
def _own_interrupt() -> Generator[None]:
    """Restores the handler of Ctrl-C: importing dask-jobqueue makes it end the process without a message."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, before)


def _configured(name: str, default: Any) -> Any:
    from dask import config

    return config.get(f"jobqueue.slurm.{name}", None) or default
