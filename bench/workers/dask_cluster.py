"""A connection to a Dask scheduler that fails fast and reports every problem as one sentence."""

import asyncio
import json
import logging
import warnings
from pathlib import Path
from typing import Any

from ...core.errors import InputError

CONNECT_S = 10  # for a scheduler to answer; reconnecting may take as long again
GO_ON = "All finished cells are stored: the same command continues the study"
RESOURCE = "MACHINE"  # a worker that may run timed cells is started with one of it


class Cluster:
    """The scheduler at an address, or at the one in a scheduler file; InputError without one."""

    def __init__(self, given: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError(
                "--executor dask: Dask is not installed; expected it here and on every worker: "
                "pip install 'slamduel[dask]'."
            ) from None
        quieten()
        try:
            self.address = _address(given)
            asyncio.run(asyncio.wait_for(_identify(self.address), CONNECT_S))  # a client would wait without limit
            self.client: Any = Client(self.address, timeout=CONNECT_S, set_as_default=False, name="slamduel")
        except Exception as error:  # a file or protocol of another program raises anything
            found = str(error) or f"no answer within {CONNECT_S} s"
            raise InputError(
                f"--scheduler {given}: no Dask scheduler: {found}; expected tcp://HOST:PORT as `dask scheduler` prints "
                "it, or the file that it writes."
            ) from None

    def workers(self) -> dict[str, Any]:
        """The scheduler's facts about each worker, by address; InputError if the scheduler is gone."""
        try:
            identity: Any = self.client.scheduler.identity
            return self.client.sync(identity, n_workers=-1, callback_timeout=2 * CONNECT_S)["workers"]
        except Exception:  # however the connection fails
            raise self.lost() from None

    def lost(self) -> InputError:
        """Makes the error of a scheduler that is gone."""
        return InputError(
            f"--scheduler {self.address}: the scheduler has ended or cannot be reached any more. {GO_ON}, once there "
            "is a scheduler again."
        )

    def close(self) -> None:
        """Disconnects; scheduler and workers keep running."""
        self.client.close(timeout=CONNECT_S)


def quieten() -> None:
    """Silences the logs and warnings of Dask and its libraries."""
    from distributed.versions import VersionMismatchWarning

    warnings.filterwarnings("ignore", category=VersionMismatchWarning)  # what matters is compared on every worker
    quiet = "asyncio", "dask", "dask_jobqueue", "distributed", "tornado"
    for logger in (logging.getLogger(name) for name in (*quiet, *logging.root.manager.loggerDict)):
        if logger.name.partition(".")[0] in quiet:
            logger.handlers = [logging.NullHandler()]
            logger.propagate = False


async def _identify(address: str) -> None:
    """Raises what a connection raises, and ValueError where something else than a scheduler answers."""
    from distributed.core import rpc
    from distributed.security import Security

    async with rpc(address, connection_args=Security().get_connection_args("client")) as asked:
        found: Any = await asked.identity()
    if (kind := found["type"]) != "Scheduler":
        raise ValueError(f"found a Dask {kind} there")


def _address(given: str) -> str:
    """The address given, or the one in the scheduler file of that name."""
    if not given.endswith(".json") and not Path(given).is_file():
        return given
    try:
        return json.loads(Path(given).read_text(encoding="utf-8"))["address"]
    except (ValueError, KeyError, TypeError):
        raise ValueError("the file holds no address") from None
