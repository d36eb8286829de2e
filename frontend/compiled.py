"""Inner loops as machine code: numba's, kept on disk between processes, and made anew when any of them changes.

Numba keeps a function's code for as long as the file it stands in is unchanged, and does not look at the files of the
functions that it calls: an edit to one of those would go unnoticed. Here what is kept is good for as long as no file
with inner loops has changed. Those are the files of the package whose names begin with an underscore.
"""

import hashlib
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
    if not Path(function.__code__.co_filename).name.startswith("_"):
        raise ValueError(f"{function.__code__.co_filename}: a file with inner loops begins with an underscore")
    from numba import njit

    dispatcher: Any = njit(cache=True, error_model="numpy")(function)
    dispatcher._cache._cache_file._source_stamp = stamp()
    _dispatchers.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


_dispatchers: list[Any] = []
"""Every function: its machine code by the types of its arguments, as far as this process has made or loaded it."""


def ready() -> int:
    """How many pieces of machine code this process has made or loaded; it grows at a function's first call."""
    return sum(len(dispatcher.overloads) for dispatcher in _dispatchers)


def made() -> int:
    """How many of these it had to make: what compiling takes, memory above all, is no backend's own."""
    return sum(sum(dispatcher.stats.cache_misses.values()) for dispatcher in _dispatchers)


@cache
def stamp() -> str:
    """A digest of every file with inner loops in the package."""
    total = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].glob("*/_*.py")):
        total.update(file.name.encode() + file.read_bytes())
    return total.hexdigest()
