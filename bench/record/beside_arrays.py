"""Measurements beside a log, among the arrays of the record: maps are drawn from them along every backend's path."""

from collections.abc import Mapping
from typing import Any

from ...core.beside import KINDS, columns_of, misfit, names, restored
from ...core.factors import Log


def beside_arrays(log: Log) -> dict[str, Any]:
    """The arrays by name; none without scans or clouds."""
    there = [kind for kind in KINDS if getattr(log, kind) is not None]
    taken = {kind: columns_of(kind, getattr(log, kind)) for kind in there}
    return {kept_name(kind, name): column for kind, columns in taken.items() for name, column in columns.items()}


def kept_name(kind: str, name: str) -> str:
    """The name of an array of a kind in the record."""
    return f"{kind.removesuffix('s')}_{name}"


def kept_beside(kind: str, arrays: Mapping[str, Any], steps: int) -> Any:
    """Restores those of a log of so many steps; None where none are kept, or they are not those of such a log."""
    found = {name: arrays[kept] for name in names(kind) if (kept := kept_name(kind, name)) in arrays}
    if len(found) < len(names(kind)):
        return None
    return None if misfit(kind, found, steps) else restored(kind, found)
