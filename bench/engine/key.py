"""Computes the keys of logs and results in a record: the same key, the same numbers to the last bit.

A log's key is over the dataset, its options, its seed and the code that makes it. A result's is over the digests of the
log and its truth, the backend with its options, its randomness and its code, and the code that runs and scores it.
Limits of time and memory are in none: they decide whether a cell ends, not how.
"""

import functools
import hashlib
import json
from typing import Any

from ...backends import registry as backends
from ...datasets import archive, cache
from ...datasets import registry as datasets
from ...datasets.on_demand import ready
from ..measure import cell as judge
from ..plan import reference
from ..plan.plan import Cell
from ..plan.variant import OneLog
from ..record.fingerprint import fingerprint
from ..record.store import Known

JUDGE = judge.__name__  # the module that runs and scores a cell
REGISTRIES = frozenset({datasets.__name__, backends.__name__})  # look up modules whose names are in a key
ELSEWHERE = REGISTRIES | {cache.__name__, archive.__name__, reference.__name__}  # affect logs only
MAKER = ready.__name__  # the module that makes logs from what their sources make, and seeds their generators


def from_files(log: OneLog) -> bool:
    """True where the log, or a part of it, is read from files, which may change without its key."""
    source, options = log.dataset.source, log.dataset.options
    return not source.seeded or hasattr(options, "path") or bool(source.files(options))


def made_once(log: OneLog) -> bool:
    """True where another worker might make a different log, in last bits or from other files, so that one is kept.

    A reference, which logs from files may need, is not the same to the last bit on every processor.
    """
    return from_files(log) or not log.dataset.source.portable


def log_key(log: OneLog, given: str = "") -> str:
    """The key of a log; `given` is the digest of the map in its prior."""
    return _digest(f"log {source_key(log.dataset.name, log.dataset.options)} {log.seed} {given}")


def result_key(cell: Cell, log: Known, *, timed: bool, oracle: bool) -> str:
    """The key of the cell's result on a known log."""
    backend = cell.backend
    drawn = cell.seed if backend.builder is not None and backend.builder.random else None
    return _digest(f"result {'/'.join(log)} {backend_key(backend.name, backend.options)} {drawn} {timed} {oracle}")


@functools.cache
def source_key(name: str, options: Any) -> str:
    """The key of the dataset, with the code that makes it."""
    code = [fingerprint(datasets.module(name), REGISTRIES), fingerprint(MAKER, REGISTRIES)]
    return hashed(name, vars(options), code)


@functools.cache
def backend_key(name: str, options: Any) -> str:
    """The key of the backend, with its code and that of its judge."""
    target = _target(name)
    code = [fingerprint(target.partition(":")[0], REGISTRIES), fingerprint(JUDGE, ELSEWHERE)]
    return hashed(name, target, vars(options), code)


_target = functools.cache(backends.target)  # cached: looking for plug-ins costs milliseconds


def hashed(*parts: Any) -> str:
    """Hashes values as JSON; floats are written so that they round-trip."""
    return _digest(json.dumps(parts, sort_keys=True, default=repr))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:32]
