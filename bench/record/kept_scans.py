"""Laser scans beside a log, among the arrays of the record: grids are drawn from them along every backend's path."""

from collections.abc import Mapping
from typing import Any

from ...frontend.laser_scans import COLUMNS, Scans, misfit, scan_columns, scans_from

_PREFIX = "scan_"

SCANS = tuple(f"{_PREFIX}{name}" for name in COLUMNS)
"""The names of their arrays."""


def scan_arrays(scans: Scans | None) -> dict[str, Any]:
    """Returns the arrays by name; none without scans."""
    return {} if scans is None else {f"{_PREFIX}{name}": column for name, column in scan_columns(scans).items()}


def kept_scans(arrays: Mapping[str, Any], steps: int) -> Scans | None:
    """Restores the scans of a log of so many steps; None where none are kept, or they are not those of such a log."""
    if any(name not in arrays for name in SCANS):
        return None
    found = {name: arrays[f"{_PREFIX}{name}"] for name in COLUMNS}
    return None if misfit(found, steps) else scans_from(found)
