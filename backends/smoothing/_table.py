"""The arrays of a smoother handed to compiled code by their addresses.

To hand over a Graph costs a microsecond for every three arrays, a fifth of a plain step; its table costs a tenth of
that.
"""

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic as numba_intrinsic
from numba.np.numpy_support import carray

from ...frontend.compiled import compiled
from ...frontend.se2 import Ints
from ._graph import Graph

intrinsic: Any = numba_intrinsic
"""Typed so: what it makes takes one argument less than the function under it."""


def _pointer(to: Any) -> Any:
    """Signature and code of an address taken for a pointer."""
    pointer = types.CPointer(to)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature
        return builder.inttoptr(values[0], context.get_value_type(pointer))

    return pointer(types.intp), generate


@intrinsic
def ints_at(typing: Any, address: Any) -> Any:
    """The whole numbers at an address."""
    del typing, address
    return _pointer(types.int64)


@intrinsic
def reals_at(typing: Any, address: Any) -> Any:
    """The numbers at an address."""
    del typing, address
    return _pointer(types.float64)


def table(g: Graph) -> Ints:
    """(19, 3) address, rows and columns of each array of a graph, which has to be kept."""
    return np.array([(a.ctypes.data, *(*a.shape, 1)[:2]) for a in g], np.int64)


@compiled
def graph(T: Ints) -> Graph:
    """The graph of a table; its arrays are not kept alive by it."""
    return Graph(
        carray(ints_at(T[0, 0]), (T[0, 1],)),
        carray(ints_at(T[1, 0]), (T[1, 1], T[1, 2])),
        carray(reals_at(T[2, 0]), (T[2, 1], T[2, 2])),
        carray(ints_at(T[3, 0]), (T[3, 1], T[3, 2])),
        carray(reals_at(T[4, 0]), (T[4, 1], T[4, 2])),
        carray(ints_at(T[5, 0]), (T[5, 1], T[5, 2])),
        carray(reals_at(T[6, 0]), (T[6, 1], T[6, 2])),
        carray(reals_at(T[7, 0]), (T[7, 1], T[7, 2])),
        carray(ints_at(T[8, 0]), (T[8, 1],)),
        carray(ints_at(T[9, 0]), (T[9, 1], T[9, 2])),
        carray(ints_at(T[10, 0]), (T[10, 1],)),
        carray(reals_at(T[11, 0]), (T[11, 1],)),
        carray(ints_at(T[12, 0]), (T[12, 1], T[12, 2])),
        carray(ints_at(T[13, 0]), (T[13, 1],)),
        carray(ints_at(T[14, 0]), (T[14, 1],)),
        carray(reals_at(T[15, 0]), (T[15, 1],)),
        carray(reals_at(T[16, 0]), (T[16, 1],)),
        carray(ints_at(T[17, 0]), (T[17, 1],)),
        carray(reals_at(T[18, 0]), (T[18, 1],)),
    )
