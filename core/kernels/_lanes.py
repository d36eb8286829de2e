"""Arithmetic on eight numbers at a time, each on its own, so that the bits are those of a loop over them.

numba leaves it to LLVM to make such code of loops; for rows of ten to a hundred numbers half of the time is then spent
in the loops before and after that. Fewer lanes than eight in a processor's registers only mean more instructions.
"""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic as numba_intrinsic
from numba.extending import models, register_model

intrinsic: Any = numba_intrinsic
"""Typed explicitly: the decorator's result takes one argument less than the function under it."""

LANES = 8
"""Numbers at a time."""

_EIGHT = ir.VectorType(ir.DoubleType(), LANES)
_FIRST = ir.Constant(ir.IntType(32), 0)


class Lanes(types.Type):
    """numba's type of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


lanes: Any = Lanes()


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):
    """Held in a register."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _EIGHT)


def _place(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """The address of an array's entry: its first two arguments."""
    array = context.make_array(signature.args[0])(context, builder, value=values[0])
    return builder.bitcast(builder.gep(array.data, [values[1]]), _EIGHT.as_pointer())


@intrinsic
def load(typing: Any, F: Any, at: Any) -> Any:
    """The eight numbers F[at : at + 8], at an unsigned index; whether they are there is not checked."""
    del typing

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(_place(context, builder, signature, values), align=8)

    return lanes(F, at), generate


@intrinsic
def put(typing: Any, F: Any, at: Any, eight: Any) -> Any:
    """Writes eight numbers to F[at : at + 8]; likewise."""
    del typing

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        builder.store(values[2], _place(context, builder, signature, values), align=8)
        return context.get_dummy_value()

    return types.void(F, at, eight), generate


@intrinsic
def eightfold(typing: Any, x: Any) -> Any:
    """The number x in each lane."""
    del typing, x

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del context, signature
        nothing, same = (
            ir.Constant(_EIGHT, ir.Undefined),
            ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES),
        )
        return builder.shuffle_vector(builder.insert_element(nothing, values[0], _FIRST), nothing, same)

    return lanes(types.float64), generate


def _each(name: str) -> Any:
    """Signature and code of an operation on two numbers in each lane, by its name in LLVM."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del context, signature
        return getattr(builder, name)(*values)

    return lanes(lanes, lanes), generate


@intrinsic
def times(typing: Any, a: Any, b: Any) -> Any:
    """The products a b."""
    del typing, a, b
    return _each("fmul")


@intrinsic
def plus(typing: Any, a: Any, b: Any) -> Any:
    """The sums a + b."""
    del typing, a, b
    return _each("fadd")


@intrinsic
def minus(typing: Any, a: Any, b: Any) -> Any:
    """The differences a - b."""
    del typing, a, b
    return _each("fsub")
