"""Fingerprints the code that a result depends on: a module, all that it imports, and library versions.

A module's fingerprint is over its own source, that of every module of its own package and of this one that it imports,
directly or not, the files beside these that they name, and the versions of the libraries that any of them imports. So a
change to one backend changes the fingerprints of what uses that backend, and no others.

Imports are read from the source: at the top of a module, inside a function, or by a literal name in a call, as in
`import_module("scipy.linalg")`. A name that is looked up in a table, as the registries do, is not followed: which
backend a cell has is in its key.
"""

import ast
import functools
import hashlib
import platform
import re
from collections.abc import Collection, Iterator, Sequence
from importlib import util
from pathlib import Path
from typing import NamedTuple

from .library_version import is_library, located, version

_CALLED = re.compile(rb"""\(\s*["'](\.{0,2}[A-Za-z_][\w.]*)["']""")  # a literal name as first argument

_TEXT = re.compile(rb"""["']([\w./-]{2,100})["']""")


class Imports(NamedTuple):
    """Names as written in a module's source: relative ones begin with dots."""

    modules: tuple[tuple[str, tuple[str, ...]], ...]  # `from x import y, z` is (x, (y, z)), `import x` is (x, ())
    called: frozenset[str]  # dotted names that are the first argument of a call
    texts: frozenset[str]  # possible names of files


NONE = Imports((), frozenset(), frozenset())


@functools.cache
def imports(source: bytes) -> Imports:
    """Lists a module's imports, those for the type checker left out; SyntaxError where it is not Python."""
    modules = tuple(_modules(ast.parse(source).body))
    called = frozenset(found.decode() for found in _CALLED.findall(source) if b"." in found)
    return Imports(modules, called, frozenset(found.decode() for found in _TEXT.findall(source)))


def _modules(body: Sequence[ast.AST]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Walks through statements alone: an import is one, and most of a tree is expressions."""
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


PACKAGE = __name__.partition(".")[0]


@functools.cache
def fingerprint(module: str, beyond: Collection[str] = frozenset()) -> str:
    """The sha256 of all code that the module runs, except modules `beyond`; also for a missing module."""
    files, libraries = closure(module, beyond)
    total = hashlib.sha256(platform.python_version().encode())
    for name in sorted(files):
        total.update(f"\n{name} {hashlib.sha256(read(files[name])).hexdigest()}".encode())
    for name in sorted(libraries):
        total.update(f"\n{name} {version(name)}".encode())
    return total.hexdigest()


def closure(module: str, beyond: Collection[str] = frozenset()) -> tuple[dict[str, Path], set[str]]:
    """Finds the module's files and libraries, without the modules `beyond` and what only these import."""
    home = module.partition(".")[0]
    own = {PACKAGE, home}
    files: dict[str, Path] = {}
    libraries = {home} - {PACKAGE} if is_library(home) else set[str]()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        top = name.partition(".")[0]
        if name in files or name in beyond:
            continue
        if top not in own and is_library(top):
            libraries.add(top)
            continue
        path = source(name)
        if path is None:
            continue
        files[name] = path
        waiting += _parents(name)
        stated = _imports(path)
        waiting += _imported(name, path, stated)
        files |= {f"{name} {file.relative_to(path.parent)}": file for file in _beside(path.parent, stated.texts)}
    return files, libraries


@functools.cache
def read(path: Path) -> bytes:
    """Reads a file; b"" where it no longer exists."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


@functools.cache
def source(name: str) -> Path | None:
    """Finds the file of the named module; None where there is none, or it is Python's own."""
    package, _, last = name.rpartition(".")
    if not package:
        spec = located(name)
        return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None
    folder = folder_of(package)
    if folder is None:
        return None
    places = folder / f"{last}.py", folder / last / "__init__.py", *folder.glob(f"{last}.*.so")
    return next((path for path in places if path.is_file()), None)


@functools.cache
def folder_of(package: str) -> Path | None:
    """Finds the folder of the package's modules, without importing anything."""
    outer, _, last = package.rpartition(".")
    if not outer:
        spec = located(package)
        places = list(spec.submodule_search_locations or ()) if spec is not None else []
        return Path(places[0]) if places else None
    above = folder_of(outer)
    return above / last if above is not None and (above / last).is_dir() else None


def _parents(name: str) -> Iterator[str]:
    """Yields the packages that Python runs before the module; this one's outermost runs nothing."""
    parts = name.split(".")
    for k in range(1 + (parts[0] == PACKAGE), len(parts)):
        yield ".".join(parts[:k])


def _imports(path: Path) -> Imports:
    try:
        return imports(read(path)) if path.suffix == ".py" else NONE
    except (SyntaxError, ValueError):  # it will fail where it is run
        return NONE


def _imported(name: str, path: Path, found: Imports) -> Iterator[str]:
    """Yields full names of what the module imports; `from x import y` is x, and x.y where that is a module."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for module, names in (*found.modules, *((called, ()) for called in found.called)):
        try:
            base = util.resolve_name(module, package)
        except ImportError:  # relative, and beyond the outermost package
            continue
        yield base
        yield from (inner for inner in (f"{base}.{each}" for each in names) if source(inner) is not None)


def _beside(folder: Path, texts: Collection[str]) -> Iterator[Path]:
    """Yields the files of a package that lie beside a module and are named in it, or are in a folder that is."""
    if not (folder / "__init__.py").is_file():
        return
    for text in texts:
        named = folder / text
        if text.startswith(("/", "__")) or ".." in named.parts:
            continue
        if named.is_file() and named.suffix != ".py":
            yield named
        elif named.is_dir() and not (named / "__init__.py").is_file():
            yield from (file for file in named.rglob("*") if file.is_file() and file.suffix != ".pyc")
