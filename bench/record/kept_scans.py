"""Laser scans beside a log, among the arrays of the record: grids are drawn from them along every backend's path."""

from collections.abc import Mapping
from typing import Any

from ...frontend.laser_scans import COLUMNS, Scans, scan_columns, scans_from

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
    k, b = len(found["step"]), len(found["angles"])
    shapes = {"step": (k,), "since": (k, 3), "until": (k, 3), "share": (k,), "ranges": (k, b), "scanner": (3,)}
    fits = all(found[name].shape == shape and found[name].dtype.kind in "fiu" for name, shape in shapes.items())
    inside = (
        fits and found["step"].dtype.kind in "iu" and k > 0 and 0 <= found["step"].min() <= found["step"].max() < steps
    )
    return scans_from(found) if inside else None
