"""Lists the code, libraries and files that a Dask worker needs for the same results, and finds differences.

A worker that runs for days keeps the code that it has loaded, even if its files change; so the package's sources are
read when this module is imported, before the worker runs anything.
"""

import functools
import hashlib
import platform
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from ...backends import registry as backends
from ...datasets import registry as datasets
from ..record.fingerprint import closure, source
from ..record.library_version import version
from .batch import Batch

Inventory = Mapping[tuple[str, str], str]
"""(kind, name) -> version or digest; kinds are python, library, module and file."""

WORK = Batch.__module__  # imports all code behind a cell's numbers but datasets and backends
SHOWN = 3  # differences that a sentence spells out


def inventory(batches: Iterable[Batch]) -> Inventory:
    """Lists what the batches need, with the versions and digests on this machine."""
    modules, paths = {WORK}, set[str]()
    for batch in batches:
        modules |= {datasets.module(batch.dataset)} | {backends.target(j.name).partition(":")[0] for _, j in batch.jobs}
        if batch.kept is None:  # else it is sent, and its files are not needed
            paths.add(str(getattr(batch.options, "path", None) or ""))
    wanted = {("python", "Python")} | {("file", path) for path in paths if path and Path(path).exists()}
    for files, libraries in map(closure, modules):
        wanted |= {("module", name) for name in files} | {("library", name) for name in libraries}
    return {key: _value(*key) for key in sorted(wanted)}


def differences(wanted: Inventory) -> str:
    """Describes in a phrase what differs on this machine, found and expected; "" without a difference."""
    found = ((key, _value(*key), value) for key, value in wanted.items())
    words = [_words(*key, here, there) for key, here, there in found if here != there]
    more = f" and {len(words) - SHOWN} more differences" if len(words) > SHOWN else ""
    return "; ".join(words[:SHOWN]) + more


def _words(kind: str, name: str, here: str, there: str) -> str:
    if kind == "module":
        changed = "is not the same code (changed since the worker started, or another copy)"
        return f"module {name} {changed if here else 'is not there'}"
    if kind == "file":
        return f"file {name} " + ("has another content" if here else "is not there")
    return f"{name} is {here or 'not installed'}, expected {there or 'none'}"


@functools.cache
def _value(kind: str, name: str) -> str:
    if kind == "python":
        return f"{platform.python_version()} for {platform.machine()}"
    if kind == "library":
        return version(name)
    return _module(name) if kind == "module" else _digest(Path(name))


def _module(name: str) -> str:
    """The digest of a module's file, or of one beside it (`module file`); "" without one."""
    module, _, beside = name.partition(" ")
    path = source(module)
    if path is None:
        return ""
    return _digest(path.parent / beside if beside else path)


@functools.cache
def _digest(path: Path) -> str:
    """The sha256 of a file, or of a folder's content; "" if it does not exist."""
    total = hashlib.sha256()
    try:
        for file in _files(path):
            total.update(f"\n{file.relative_to(path).as_posix()}\n".encode())
            with file.open("rb") as stream:
                total.update(hashlib.file_digest(stream, "sha256").digest())
    except OSError:
        return ""
    return total.hexdigest()


def _files(path: Path) -> Iterator[Path]:
    yield from sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


for _layer in ("core", "frontend", "backends", "datasets", "bench"):
    for _path in (Path(__file__).parents[2] / _layer).rglob("*.py"):
        _digest(_path)
