"""Which version of a library is installed, found out without importing it: from the folder that its installer left."""

import functools
import sys
from importlib import util
from importlib.machinery import ModuleSpec
from pathlib import Path

_INSTALLED = ("site-packages", "dist-packages")


@functools.cache
def located(name: str) -> ModuleSpec | None:
    """Where a top-level module comes from; None for Python's own, and where there is none."""
    if name in sys.stdlib_module_names:
        return None
    try:
        return util.find_spec(name)
    except (ValueError, ImportError):  # of a module that has been put together by hand
        return None


def is_library(name: str) -> bool:
    """Whether the top-level name is of code that is installed and not worked on, other than Python's own."""
    return home_of(name) is not None


@functools.cache
def version(name: str) -> str:
    """The distributions that the library of that top-level name is from, with versions; "" where none is known."""
    home = home_of(name)
    if home is None:
        return ""
    plain = name.lower()
    infos = [path for path in home.iterdir() if path.suffix in (".dist-info", ".egg-info")]
    found = [info for info in infos if _distribution(info) == plain]
    return ",".join(sorted(info.stem for info in found or infos if info in found or _holds(info, name)))


@functools.cache
def home_of(name: str) -> Path | None:
    """The folder of installed libraries that the top-level name is found in."""
    spec = located(name)
    if spec is None:
        return None
    places = [*(spec.submodule_search_locations or ()), *([spec.origin] if spec.has_location and spec.origin else [])]
    homes = [parent for place in places for parent in [Path(place).parent] if parent.name in _INSTALLED]
    return homes[0] if homes else None


def _distribution(info: Path) -> str:
    return info.stem.partition("-")[0].lower()


def _holds(info: Path, name: str) -> bool:
    """Whether the distribution's list of files has the module."""
    for record in (info / "RECORD", info / "SOURCES.txt"):
        if record.is_file():
            lines = f"\n{record.read_text(encoding='utf-8', errors='replace')}"
            return f"\n{name}/" in lines or f"\n{name}.py" in lines
    return False
