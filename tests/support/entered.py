"""Notes which compiled functions of the package are entered: each stores a byte before its first statement.

A function counts where its code ran, in whichever function it was called. What numba has compiled tells less: a call in
a branch that is never taken is compiled, too.
"""

import ast
import ctypes
import os
from importlib import import_module
from pathlib import Path
from typing import Any

from llvmlite import binding, ir
from numba.core import types
from numba.extending import intrinsic

from places import LAYERS, ROOT
from slamduel.core.kernels import compiled

_names = list[str]()
_marks = (ctypes.c_uint8 * 1000)()


@intrinsic
def _mark(typing: Any, place: Any) -> Any:
    """Marks a place among `_marks`, named by a symbol: code from the disk would have an earlier process's address."""
    del typing, place

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature
        known, byte = builder.module.globals, ir.IntType(8)
        marks = known.get("slamduel_marks") or ir.GlobalVariable(builder.module, byte, "slamduel_marks")
        builder.store(byte(1), builder.gep(marks, [values[0]]))
        return context.get_dummy_value()

    return types.void(types.intp), generate


def note() -> None:
    """Imports all modules with compiled functions, which have marks then; none may have been imported before.

    Their code is of no use to others: NUMBA_CACHE_DIR keeps it out of the package.
    """
    assert "NUMBA_CACHE_DIR" in os.environ, "expected NUMBA_CACHE_DIR"
    os.cpu_count = lambda: 1  # a second process, which compiles ahead, would know nothing of marks
    binding.add_symbol("slamduel_marks", ctypes.addressof(_marks))
    plain, compiled.compiled = compiled.compiled, lambda function: plain(_marked(function))
    for file in (file for layer in LAYERS for file in sorted((ROOT / layer).rglob("_[!_]*.py"))):
        import_module(".".join(["slamduel", *file.relative_to(ROOT).with_suffix("").parts]))
    compiled.compiled = plain
    assert len(compiled._dispatchers) == len(_names)  # pyright: ignore[reportPrivateUsage]


def never() -> list[str]:
    """The functions that were not entered."""
    return [name for name, entered in zip(_names, _marks, strict=False) if not entered]


def _marked(function: Any) -> Any:
    """The function, compiled again from its source with the mark before its first statement."""
    file, line = function.__code__.co_filename, function.__code__.co_firstlineno
    tree = ast.parse(Path(file).read_bytes())
    (found,) = (one for one in tree.body if isinstance(one, ast.FunctionDef) and _first_line(one) == line)
    (call,) = ast.parse(f"_mark({len(_names)})").body
    found.body.insert(0, ast.fix_missing_locations(ast.copy_location(call, found.body[0])))
    tree.body, found.decorator_list = [found], []
    made = compile(tree, file, "exec")
    function.__code__ = next(one for one in made.co_consts if hasattr(one, "co_code")).replace(co_firstlineno=line)
    function.__globals__["_mark"] = _mark
    _names.append(f"{function.__module__.partition('.')[2]}.{function.__name__}")
    return function


def _first_line(function: ast.FunctionDef) -> int:
    """As Python counts: that of its first decorator."""
    return min(one.lineno for one in (function, *function.decorator_list))
