"""Has numba check every index of an array, in a process that was started with NUMBA_BOUNDSCHECK=1."""

import os
from typing import Any

from numba import types
from numba.np import arrayobj


def begin() -> None:
    """From here on, compiled code raises an IndexError for an index beyond an end or below zero.

    Numba's own checks let one below zero count from the end, as in Python, which no compiled function means to do.
    """
    assert os.environ.get("NUMBA_BOUNDSCHECK") == "1", "expected NUMBA_BOUNDSCHECK=1"
    arrayobj.fix_integer_index = _as_it_is


def _as_it_is(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
    """In place of numba's function that adds the size to an index below zero."""
    del size
    return context.cast(builder, index, kind, types.intp)
