"""Inner loops compiled by numba, cached on disk, and recompiled when any of them changes.

Numba invalidates its cache when a function's own file changes, but not when the files of the functions it calls do.
Here a cache entry is valid until that file changes or any other file with inner loops that it imports. Those are the
files of the package whose names begin with an underscore; they import what they call by relative imports.
"""

import ast
import contextlib
import fcntl
import gc
import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")


_OPTIONS: Any = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles `function` at its first call and caches the machine code on disk.

    Division follows IEEE (no exception), and nothing is reassociated: the bits of a result are those of the source,
    whether the code was compiled now or before.
    """
    file = Path(function.__code__.co_filename)  # ty: ignore[missing-attribute]
    if not file.name.startswith("_"):
        raise ValueError(f"{file}: expected a file name with a leading underscore, for inner loops")
    from numba import config, njit

    settings: Any = config
    # NUMBA_DISABLE_JIT, which debuggers set, is for others' code: some loops here call BLAS and read arrays by address.
    disabled, settings.DISABLE_JIT = settings.DISABLE_JIT, 0
    try:
        dispatcher: Any = njit(**_OPTIONS)(function)
    finally:
        settings.DISABLE_JIT = disabled
    index = dispatcher._cache._cache_file
    index._source_stamp, index._load_index = stamp(file), _or_empty(index._load_index)
    dispatcher.get_call_template = _without_literals(dispatcher.get_call_template)
    dispatcher.compile = _in_turn(dispatcher, dispatcher.compile)
    _dispatchers.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


def _or_empty(load: Callable[[], Any]) -> Callable[[], Any]:
    """Takes an index that cannot be read for an empty one: it is damaged, or names types of an earlier version."""

    def found() -> Any:
        try:
            return load()
        except Exception:  # a damaged pickle raises almost any exception
            return {}

    return found


def _without_literals(template: Callable[..., Any]) -> Callable[..., Any]:
    """Types constant arguments as plain numbers: numba would compile the function again for each literal type."""
    from numba.core.types import unliteral

    def found(args: Any, kws: Any) -> Any:
        return template([unliteral(a) for a in args], {name: unliteral(a) for name, a in kws.items()})

    return found


def _in_turn(dispatcher: Any, compile_: Callable[..., Any]) -> Callable[..., Any]:
    """Waits while another process compiles the same function, and loads its result.

    There is one lock per function, held while its callees are compiled; as calls are not cyclic, no two processes
    deadlock.
    """
    name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
    place = int.from_bytes(hashlib.sha256(name.encode()).digest()[:7])

    def found(signature: Any) -> Any:
        known = dispatcher.overloads.get(tuple(signature)) if isinstance(signature, tuple) else None
        if known is not None:
            return known.entry_point
        _at_work.append(dispatcher)
        try:
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.lockf(_locks(dispatcher._cache.cache_path), fcntl.LOCK_EX, 1, place)
            return _undisturbed(compile_, signature)
        finally:
            _at_work.pop()
            with contextlib.suppress(OSError):
                fcntl.lockf(_locks(dispatcher._cache.cache_path), fcntl.LOCK_UN, 1, place)

    return found


def _undisturbed(compile_: Callable[..., Any], signature: Any) -> Any:
    """Compiles without looking for garbage, which takes a tenth: a compiler makes millions of objects that it needs."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        return compile_(signature)
    finally:
        if collecting:
            gc.enable()


@cache
def _locks(folder: str) -> int:
    """A descriptor, kept open, of the file whose bytes are the locks of the functions cached in a folder."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    return os.open(Path(folder) / "compiling.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)


def kept(dispatcher: Any) -> bool:
    """Tells if machine code of this function is loaded or cached on disk."""
    return bool(dispatcher.overloads or dispatcher._cache._cache_file._load_index())


_dispatchers: list[Any] = []
"""Every function: its machine code by argument types, as compiled or loaded by this process."""


_at_work: list[Any] = []
"""Functions that are being compiled or loaded, or that another process compiles; each is called by the one before."""


def compiling() -> bool:
    """Tells, also in another thread, if a function is being compiled, here or elsewhere, and not loaded from disk."""
    return any(not kept(dispatcher) for dispatcher in tuple(_at_work))


def ready() -> int:
    """Number of pieces of machine code this process has compiled or loaded; it grows at a function's first call."""
    return sum(len(dispatcher.overloads) for dispatcher in _dispatchers)


def made() -> int:
    """Number of those that were compiled here; the memory this takes is not the backend's own."""
    return sum(sum(dispatcher.stats.cache_misses.values()) for dispatcher in _dispatchers)


@cache
def stamp(file: Path) -> str:
    """Digest of the files in the `closure` of one with inner loops."""
    total = hashlib.sha256()
    for one in sorted(closure(file)):
        total.update(one.name.encode() + one.read_bytes())
    return total.hexdigest()


def closure(file: Path) -> set[Path]:
    """The source of a kernel and all sources of ours that it imports, however indirectly."""
    found, waiting = set[Path](), [file]
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting += _imported(one)
    return found


@cache
def _imported(file: Path) -> list[Path]:
    """The files with inner loops that a file imports; a loop itself can import nothing."""
    found = list[Path]()
    for node in ast.parse(file.read_bytes()).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            place = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found += [place.with_suffix(".py"), *(place / f"{alias.name}.py" for alias in node.names)]
    return [one for one in found if one.name.startswith("_") and one.is_file()]
