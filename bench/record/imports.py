"""What a module's source says that it imports, wherever in it that stands, and which files it may read."""

import ast
import functools
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

_CALLED = re.compile(rb"""\(\s*["'](\.{0,2}[A-Za-z_][\w.]*)["']""")
"""A literal name as a call's first argument, as in `import_module(".ekf", __package__)`."""

_TEXT = re.compile(rb"""["']([\w./-]{2,100})["']""")


class Imports(NamedTuple):
    """Names as they stand in the source: relative ones begin with dots."""

    modules: tuple[tuple[str, tuple[str, ...]], ...]  # `from x import y, z` is (x, (y, z)), `import x` is (x, ())
    called: frozenset[str]  # dotted names that a call is handed first
    texts: frozenset[str]  # what may be the name of a file


NONE = Imports((), frozenset(), frozenset())


@functools.cache
def imports(source: bytes) -> Imports:
    """Of a module; what is imported for the type checker alone is not. SyntaxError where it is no Python."""
    modules = tuple(_modules(ast.parse(source).body))
    called = frozenset(found.decode() for found in _CALLED.findall(source) if b"." in found)
    return Imports(modules, called, frozenset(found.decode() for found in _TEXT.findall(source)))


def _modules(body: Sequence[ast.AST]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Statements alone are walked through: an import is one, and most of a tree is expressions."""
    for node in body:
        if isinstance(node, ast.Import):
            yield from ((alias.name, ()) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or ""), tuple(alias.name for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from _modules(node.orelse)
        else:
            for name in ("body", "orelse", "finalbody", "handlers", "cases"):
                inner = getattr(node, name, None)
                if isinstance(inner, list):  # that of a lambda is an expression
                    yield from _modules(inner)
