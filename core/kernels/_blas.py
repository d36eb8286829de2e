"""Two BLAS routines for compiled code, called at scipy's addresses, which are passed as arguments.

A numba function with a routine's address as a constant cannot be cached on disk, since addresses differ between
processes; with the address as an argument it can.
"""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import get_cython_function_address
from numba.extending import intrinsic as numba_intrinsic

intrinsic: Any = numba_intrinsic
"""Typed explicitly: the decorator's result takes one argument less than the function under it."""


def routine(name: str) -> int:
    """The address in this process of a BLAS routine such as "dgemm"."""
    return get_cython_function_address("scipy.linalg.cython_blas", name)


def _call(builder: Any, address: Any, arguments: list[Any]) -> None:
    """Calls a Fortran routine without return value: all arguments by reference, integers as 32 bits."""
    pointers: list[Any] = []
    for argument in arguments:
        wide = isinstance(argument.type, ir.IntType) and argument.type.width > 32
        value = builder.trunc(argument, ir.IntType(32)) if wide else argument
        pointers.append(value if value.type.is_pointer else cgutils.alloca_once_value(builder, value))
    signature = ir.FunctionType(ir.VoidType(), [pointer.type for pointer in pointers])
    builder.call(builder.inttoptr(address, signature.as_pointer()), pointers)


def _letter(letter: str) -> Any:
    return ir.Constant(ir.IntType(8), ord(letter))


def _array(builder: Any, address: Any) -> Any:
    return builder.inttoptr(address, ir.DoubleType().as_pointer())


# As many parameters as dgemm has, and in its order: who knows that one can read a call of this one.
@intrinsic
def add_product(
    typing: Any,
    dgemm: Any,
    m: Any,
    n: Any,
    k: Any,
    sign: Any,
    a: Any,
    a_row: Any,
    b: Any,
    b_row: Any,
    c: Any,
    c_row: Any,
) -> Any:
    """C += sign B' A, where in C order A is (k, m), B (k, n) and C (n, m).

    `a`, `b`, `c` are the addresses of their first entries, `a_row` and so on the entries from one row to the next.
    """
    del typing, dgemm, m, n, k, sign, a, a_row, b, b_row, c, c_row  # argument types, given by the signature
    whole = (types.intp,)
    signature = types.void(*whole * 4, types.float64, *whole * 6)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature
        dgemm, m, n, k, sign, a, a_row, b, b_row, c, c_row = values
        one = ir.Constant(ir.DoubleType(), 1.0)
        a, b, c = (_array(builder, address) for address in (a, b, c))
        _call(builder, dgemm, [_letter("N"), _letter("T"), m, n, k, sign, a, a_row, b, b_row, one, c, c_row])
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def add_square(typing: Any, dsyrk: Any, n: Any, k: Any, sign: Any, a: Any, a_row: Any, c: Any, c_row: Any) -> Any:
    """The lower triangle of C += sign A' A, where in C order A is (k, n) and C (n, n); the rest as in `add_product`."""
    del typing, dsyrk, n, k, sign, a, a_row, c, c_row  # argument types, given by the signature
    whole = (types.intp,)
    signature = types.void(*whole * 3, types.float64, *whole * 4)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature
        dsyrk, n, k, sign, a, a_row, c, c_row = values
        one = ir.Constant(ir.DoubleType(), 1.0)
        a, c = _array(builder, a), _array(builder, c)
        _call(builder, dsyrk, [_letter("U"), _letter("N"), n, k, sign, a, a_row, one, c, c_row])
        return context.get_dummy_value()

    return signature, generate
