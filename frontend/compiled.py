"""Inner loops as machine code: numba's, kept on disk between processes, and made anew when any of them changes.

Numba keeps a function's code for as long as the file it stands in is unchanged, and does not look at the files of the
functions that it calls: an edit to one of those would go unnoticed. Here what is kept is good for as long as neither
that file has changed nor any other with inner loops that it imports. Those are the files of the package whose names
begin with an underscore; they import what they call from one another, by relative imports.
"""

import ast
import contextlib
import fcntl
import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """`function` as machine code of this machine, compiled at its first call and kept on disk.

    Division follows IEEE (no exception), and nothing is reassociated: the bits of a result are those of the source, and
    the same whether the code was compiled now or before.
    """
    file = Path(function.__code__.co_filename)
    if not file.name.startswith("_"):
        raise ValueError(f"{file}: a file with inner loops begins with an underscore")
    from numba import njit

    dispatcher: Any = njit(cache=True, error_model="numpy")(function)
    dispatcher._cache._cache_file._source_stamp = stamp(file)
    dispatcher.get_call_template = _without_literals(dispatcher.get_call_template)
    dispatcher.compile = _in_turn(dispatcher, dispatcher.compile)
    _dispatchers.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


def _without_literals(template: Callable[..., Any]) -> Callable[..., Any]:
    """A call with a constant is one with any number: numba would compile the function once more for its type."""
    from numba.core.types import unliteral

    def found(args: Any, kws: Any) -> Any:
        return template([unliteral(a) for a in args], {name: unliteral(a) for name, a in kws.items()})

    return found


def _in_turn(dispatcher: Any, compile_: Callable[..., Any]) -> Callable[..., Any]:
    """Where another process is compiling the same function, wait for it and load what it has made.

    A lock a function: it is held while those that it calls are compiled, but calls go one way only, so that no two
    processes wait for one another.
    """
    name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
    place = int.from_bytes(hashlib.sha256(name.encode()).digest()[:7])

    def found(signature: Any) -> Any:
        known = dispatcher.overloads.get(tuple(signature)) if isinstance(signature, tuple) else None
        if known is not None:
            return known.entry_point
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.lockf(_locks(dispatcher._cache.cache_path), fcntl.LOCK_EX, 1, place)
        try:
            return compile_(signature)
        finally:
            with contextlib.suppress(OSError):
                fcntl.lockf(_locks(dispatcher._cache.cache_path), fcntl.LOCK_UN, 1, place)

    return found


@cache
def _locks(folder: str) -> int:
    """A descriptor of the file whose bytes are the locks of the functions kept in a folder; it stays open."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    return os.open(Path(folder) / "compiling.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)


def kept(dispatcher: Any) -> bool:
    """Whether machine code of this function is known here or kept on disk."""
    return bool(dispatcher.overloads or dispatcher._cache._cache_file._load_index())


_dispatchers: list[Any] = []
"""Every function: its machine code by the types of its arguments, as far as this process has made or loaded it."""


def ready() -> int:
    """How many pieces of machine code this process has made or loaded; it grows at a function's first call."""
    return sum(len(dispatcher.overloads) for dispatcher in _dispatchers)


def made() -> int:
    """How many of these it had to make: what compiling takes, memory above all, is no backend's own."""
    return sum(sum(dispatcher.stats.cache_misses.values()) for dispatcher in _dispatchers)


@cache
def stamp(file: Path) -> str:
    """A digest of a file with inner loops and of all such files that it imports, directly or through others."""
    total = hashlib.sha256()
    for one in sorted(closure(file)):
        total.update(one.name.encode() + one.read_bytes())
    return total.hexdigest()


def closure(file: Path) -> set[Path]:
    """These files."""
    found, waiting = set[Path](), [file]
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting += _imported(one)
    return found


@cache
def _imported(file: Path) -> list[Path]:
    """The files with inner loops that a file imports, or imports something from; a loop itself can import nothing."""
    found = list[Path]()
    for node in ast.parse(file.read_bytes()).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            place = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found += [place.with_suffix(".py"), *(place / f"{alias.name}.py" for alias in node.names)]
    return [one for one in found if one.name.startswith("_") and one.is_file()]
