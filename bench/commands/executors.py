"""The options of the executor, shared by `bench run`, `ablate` and `suite`, and how a stopped one goes on."""

import argparse
import contextlib
import shlex
import sys
from collections.abc import Callable, Generator
from pathlib import Path

from ...core.errors import InputError, Interrupted
from ..plan.values import count
from ..workers.executor import Executor

EXECUTORS = ("local", "here", "dask", "slurm")

SLURM_JOBS = 4


@contextlib.contextmanager
def resumable() -> Generator[None]:
    """Raises Interrupted, with the command that goes on from there, where the user stops what it is around."""
    try:
        yield
    except (KeyboardInterrupt, Interrupted):
        again = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        raise Interrupted(f"{again} continues from here") from None


def arguments(parser: argparse.ArgumentParser, jobs: str) -> None:
    """Adds --executor, --jobs and --scheduler; `jobs` is the help on the second."""
    add = parser.add_argument
    add(
        "--executor",
        choices=EXECUTORS,
        default="local",
        help="where cells run: processes of this machine (default), this very process, a Dask cluster, SLURM's jobs",
    )
    add("--jobs", type=count, metavar="N", help=jobs)
    add("--scheduler", metavar="ADDRESS", help="dask: tcp://host:port, or the scheduler's file")


def executor(
    namespace: argparse.Namespace, jobs: int | None, local: int, *, exclusive: bool, say: Callable[[str], None]
) -> Executor:
    """Makes the executor; `exclusive`: some cells must run alone. InputError for options that do not go together."""
    kind, address = namespace.executor, namespace.scheduler
    if address is not None and kind != "dask":
        raise InputError(f"--scheduler {address}: found --executor {kind} beside it, expected --executor dask.")
    if jobs is not None and kind in ("here", "dask"):
        raise InputError(f"--jobs {jobs}: found --executor {kind} beside it, expected local or slurm.")
    if kind == "here":
        from ..workers.executor import Here

        return Here()
    if kind == "local":
        from ..workers.local_executor import Local

        return Local(jobs or local)
    if kind == "slurm":
        from ..workers.slurm_executor import Slurm

        return Slurm(jobs or SLURM_JOBS, exclusive=exclusive, say=say)
    if address is None:
        raise InputError("--executor dask: expected --scheduler ADDRESS beside it, tcp://host:port or a file.")
    from ..workers.dask_executor import Dask

    return Dask(address, say=say)
