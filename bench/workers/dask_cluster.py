"""A connection to a Dask scheduler: found to be one within seconds, watched, and never heard of but in sentences."""

import asyncio
import json
import logging
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from ...frontend.errors import InputError

CONNECT_S = 10
"""To find a scheduler, or to find it again, as Dask tries to for a while by itself."""

ANSWER_S = 5
"""For a scheduler to say who its workers are, before it is asked once more."""

GO_ON = "Every cell that had finished is in the store: the same command goes on with the study"
RESOURCE = "MACHINE"
"""What a worker that may run timed cells is started with, one of it."""


class Seen(NamedTuple):
    """A worker, as the scheduler knows it."""

    address: str
    host: str
    threads: int
    timed: bool  # it has the resource for timed cells
    last_seen: float  # the scheduler's clock at the last heartbeat
    executing: int  # tasks at that moment, whosever they are
    running: bool  # neither paused nor about to end


class Cluster:
    """The scheduler at an address, or at the one in a scheduler file. InputError where there is none."""

    def __init__(self, given: str) -> None:
        try:
            from dask import config
            from distributed import Client
        except ImportError:
            raise InputError(
                "--executor dask: Dask is not installed; expected it here and on every worker: "
                "pip install 'slamduel[dask]'."
            ) from None
        quieten()
        config.set(
            {
                "distributed.comm.timeouts.connect": f"{CONNECT_S}s",
                "distributed.comm.timeouts.tcp": "15s",
                "distributed.client.heartbeat": "2s",
            }
        )
        self.address = _address(given)
        asyncio.run(_identified(self.address))
        try:
            self._client: Any = Client(self.address, timeout=CONNECT_S, set_as_default=False, name="slamduel")
        except Exception as error:  # of another version of Dask, any
            raise _refused(self.address, f"does not take a client: {type(error).__name__}: {error}") from None
        self._heard = time.monotonic()

    def workers(self) -> list[Seen] | None:
        """Those that there are now; None where the scheduler does not answer, InputError where it never will."""
        try:
            scheduler = self._client.scheduler
            found = self._client.sync(scheduler.identity, n_workers=-1, callback_timeout=ANSWER_S)
        except Exception:  # whichever way a connection fails
            if self._client.status not in ("running", "connecting") or time.monotonic() - self._heard > 2 * CONNECT_S:
                raise InputError(
                    f"--scheduler {self.address}: the scheduler has ended or cannot be reached any more. {GO_ON}, once "
                    "there is a scheduler again."
                ) from None
            return None
        self._heard = time.monotonic()
        return [_seen(address, worker) for address, worker in found["workers"].items()]

    def submit(
        self, call: Callable[[Any], Any], argument: Any, worker: str, *, timed: bool, done: Callable[[Any], None]
    ) -> Any:
        """`call(argument)` on that worker and no other; `done` gets the future in another thread once it has ended.

        None where the scheduler cannot be told.
        """
        resources = {RESOURCE: 1} if timed else None
        try:
            future = self._client.submit(call, argument, workers=[worker], pure=False, retries=0, resources=resources)
        except Exception:  # whichever way a connection fails
            return None
        future.add_done_callback(done)
        return future

    def close(self) -> None:
        """Leave the scheduler and its workers to themselves."""
        self._client.close(timeout=ANSWER_S)


def quieten() -> None:
    """Keep what Dask and its libraries log, and what they warn of, from the user's terminal."""
    from distributed.versions import VersionMismatchWarning

    warnings.filterwarnings("ignore", category=VersionMismatchWarning)  # what matters is compared on every worker
    for name in ("asyncio", "dask", "dask_jobqueue", "distributed", "tornado", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("asyncio", "dask", "dask_jobqueue", "distributed", "tornado"):
            logger = logging.getLogger(name)
            logger.handlers = [logging.NullHandler()]
            logger.propagate = False


async def _identified(address: str) -> None:
    """InputError where what is at the address is no scheduler."""
    from distributed.core import rpc
    from distributed.security import Security

    try:
        async with rpc(address, timeout=CONNECT_S, connection_args=Security().get_connection_args("client")) as asked:
            found: Any = await asyncio.wait_for(asked.identity(), ANSWER_S)
    except OSError as error:
        why = str(error) or f"not within {ANSWER_S} s"
        raise _refused(address, f"no Dask scheduler answers there: {why}") from None
    except Exception as error:  # whatever somebody else's protocol leads to
        raise _refused(address, f"what is there is no Dask scheduler: {type(error).__name__}: {error}") from None
    kind = found.get("type") if isinstance(found, dict) else type(found).__name__
    if kind != "Scheduler":
        raise _refused(address, f"found a Dask {kind} there")


def _address(given: str) -> str:
    """As Dask takes it; a scheduler file is read."""
    if given.endswith(".json") or Path(given).is_file():
        try:
            given = json.loads(Path(given).read_text(encoding="utf-8"))["address"]
        except OSError as error:
            raise InputError(f"--scheduler {given}: {error.strerror}; expected a scheduler file.") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(f"--scheduler {given}: expected a scheduler file as `dask scheduler` writes it.") from None
    scheme, _, rest = given.rpartition("://")
    if scheme in ("http", "https"):
        raise InputError(
            f"--scheduler {given}: this is the address of a dashboard; expected that of the scheduler, "
            f"tcp://{rest.partition(':')[0]}:8786 or the like."
        )
    host, _, port = rest.rstrip("/").rpartition(":")
    if scheme not in ("", "tcp", "tls") or not host or not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise InputError(f"--scheduler {given}: expected tcp://HOST:PORT, tls://HOST:PORT or a scheduler file.")
    return f"{scheme or 'tcp'}://{host}:{port}"


def _refused(address: str, found: str) -> InputError:
    return InputError(f"--scheduler {address}: {found}; expected the address that `dask scheduler` prints.")


def _seen(address: str, worker: dict[str, Any]) -> Seen:
    tasks = worker.get("metrics", {}).get("task_counts", {})
    return Seen(
        address,
        worker["host"],
        worker["nthreads"],
        worker["resources"].get(RESOURCE, 0) >= 1,
        worker["last_seen"],
        sum(
            number for state, number in tasks.items() if state in ("executing", "long-running", "cancelled", "resumed")
        ),
        worker["status"] == "running",
    )
