"""Tells installed libraries from code that is worked on, and finds their versions, without importing them."""

import functools
import sys
from collections.abc import Sequence
from importlib import metadata, util
from importlib.machinery import ModuleSpec
from pathlib import Path

from ...backends.registry import distributions

_INSTALLED = ("site-packages", "dist-packages")


@functools.cache
def located(name: str) -> ModuleSpec | None:
    """Finds the spec of a top-level module; None for Python's own, and where there is none."""
    if name in sys.stdlib_module_names:
        return None
    try:
        return util.find_spec(name)
    except (ValueError, ImportError):  # of a module that has been put together by hand
        return None


@functools.cache
def is_library(name: str) -> bool:
    """True for a top-level module that is installed and not worked on; False for Python's own."""
    spec = located(name)
    if spec is None:
        return False
    places = [*(spec.submodule_search_locations or ()), *([spec.origin] if spec.has_location and spec.origin else [])]
    return any(Path(place).parent.name in _INSTALLED for place in places)


def _provided(name: str) -> Sequence[str]:
    """Finds the distributions that provide a top-level module: most have its name, else the files of all are read."""
    try:
        files = metadata.distribution(name).read_text("RECORD") or ""
    except metadata.PackageNotFoundError:
        files = ""
    return [name] if f"\n{name}/__init__.py," in f"\n{files}" else distributions().get(name, ())


@functools.cache
def version(name: str) -> str:
    """Lists the distributions of the library of that top-level name as name-version; "" where none is known."""
    found = set(_provided(name)) if is_library(name) else set[str]()
    return ",".join(sorted(f"{distribution}-{metadata.version(distribution)}" for distribution in found))
