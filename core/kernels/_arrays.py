"""Bundles arrays so that compiled code receives them all by one address.

To numba a NamedTuple of twenty arrays is 120 numbers, which each function passes on and takes apart: it doubles
compilation time, and a call from Python spends a microsecond on every three arrays. Here a function gets the address of
a table with the address and shape of each array, and reads from it what it uses.
"""

from functools import cache
from typing import Annotated, Any, Self, get_args, get_type_hints

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)  # fmt: skip
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import as_dtype, from_dtype

from ..se2 import Array, Ints

made_intrinsic: Any = intrinsic
"""Typed explicitly: the decorator's result takes one argument less than the function under it."""

Numbers = Annotated[Array, 1]
Table = Annotated[Array, 2]
Integers = Annotated[Ints, 1]
IntegerTable = Annotated[Ints, 2]

WORDS = 3
"""An array's entry in the table: address, rows and columns."""


class Arrays:
    """Contiguous arrays, named by a subclass, each annotated as one of the four kinds above.

    Compiled code sees the arrays as attributes and can write to their elements. They must stay alive while it runs. In
    compiled code `at` makes the same object from `address`: passing an integer is cheaper than passing an object.
    """

    def __init__(self, **arrays: Any) -> None:
        kinds = layout(type(self))
        self._hold({}, np.zeros((len(kinds), WORDS), np.int64), {name: arrays[name] for name, _, _ in kinds})

    def replaced(self, **arrays: Any) -> Self:
        """A copy with these arrays replaced."""
        made = object.__new__(type(self))
        made._hold(self._arrays, self._table.copy(), arrays)
        return made

    def copied(self) -> Self:
        """A deep copy."""
        return self.replaced(**{name: array.copy() for name, array in self._arrays.items()})

    def _hold(self, before: dict[str, Any], table: Ints, arrays: dict[str, Any]) -> None:
        """Takes the arrays from `before`, with `arrays` in place of some of them, which are entered into the table."""
        kinds = places(type(self))
        for name, array in arrays.items():
            row, dtype, ndim = kinds[name]
            if array.dtype != dtype or array.ndim != ndim or not array.flags.c_contiguous:
                raise TypeError(f"{name} is {array.dtype} of {array.ndim} dimensions, expected {dtype} of {ndim}")
            table[row] = array.ctypes.data, array.shape[0], array.shape[-1]
        self._arrays, self._table = {**before, **arrays}, table
        self.address: int = table.ctypes.data
        vars(self).update(self._arrays)


@cache
def layout(kind: type[Arrays]) -> tuple[tuple[str, str, int], ...]:
    """Name, dtype and dimensions of each array of a subclass, in order."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple((name, *_of(hint)) for name, hint in hints.items())


@cache
def places(kind: type[Arrays]) -> dict[str, tuple[int, Any, int]]:
    """Row in the table, dtype and dimensions of each array, by name."""
    return {name: (row, np.dtype(dtype), ndim) for row, (name, dtype, ndim) in enumerate(layout(kind))}


def at(kind: type[Arrays]) -> Any:
    """Returns a function for compiled code, from the `address` of such arrays to the arrays."""
    made = _known(kind)

    def whole(typing: Any, address: Any) -> Any:
        del typing, address

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            del signature
            return builder.inttoptr(values[0], context.get_value_type(made))

        return made(types.intp), generate

    return intrinsic(whole)


@made_intrinsic
def lent(typing: Any, array: Any) -> Any:
    """The same array, not counted: a function that gets it counts no references. Its owner must be used after it."""
    del typing

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        made = context.make_array(signature.return_type)(context, builder, value=values[0])
        made.meminfo = cgutils.get_null_value(made.meminfo.type)
        return made._getvalue()

    return array(array), generate


def _of(hint: Any) -> tuple[str, int]:
    """Dtype and dimensions of an annotation."""
    array, ndim = get_args(hint)
    return np.dtype(get_args(get_args(array)[1])[0]).name, ndim


class ArraysType(types.Type):
    """Numba's type of a subclass."""

    def __init__(self, kind: type[Arrays]) -> None:
        kinds = layout(kind)
        self.places = {name: row for row, (name, _, _) in enumerate(kinds)}
        self.kinds = {name: types.Array(from_dtype(np.dtype(dtype)), ndim, "C") for name, dtype, ndim in kinds}
        super().__init__(name=f"{kind.__name__}({', '.join(f'{name} {dtype} {ndim}' for name, dtype, ndim in kinds)})")


@cache
def _known(kind: type[Arrays]) -> ArraysType:
    return ArraysType(kind)


@register_model(ArraysType)
class _Pointer(models.PrimitiveModel):
    def __init__(self, dmm: Any, kind: Any) -> None:
        super().__init__(dmm, kind, ir.IntType(64).as_pointer())


@infer_getattr
class _Attributes(AttributeTemplate):
    key = ArraysType

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        return typ.kinds.get(attr)


@lower_getattr_generic(ArraysType)
def _attribute(context: Any, builder: Any, kind: Any, pointer: Any, name: str) -> Any:
    """The array of that name. Loads are marked invariant, so that loops need not repeat them."""
    array = kind.kinds[name]
    invariant = builder.module.add_metadata([])

    def word(n: int) -> Any:
        value = builder.load(builder.gep(pointer, [ir.Constant(ir.IntType(64), WORDS * kind.places[name] + n)]))
        value.set_metadata("invariant.load", invariant)
        return value

    shape = [word(1 + n) for n in range(array.ndim)]
    size = ir.Constant(ir.IntType(64), as_dtype(array.dtype).itemsize)
    strides = [size] if array.ndim == 1 else [builder.mul(size, shape[1]), size]
    made = context.make_array(array)(context, builder)
    populate_array(
        made,
        data=builder.inttoptr(word(0), made.data.type),
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
    )
    return made._getvalue()


@typeof_impl.register(Arrays)
def _type_of(value: Any, context: Any) -> ArraysType:
    del context
    return _known(type(value))


@unbox(ArraysType)
def _unboxed(kind: Any, value: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.builder.bitcast(c.pyapi.long_as_voidptr(address), c.context.get_value_type(kind))
    c.pyapi.decref(address)
    return NativeValue(pointer, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))
