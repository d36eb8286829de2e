"""Whether what a record holds can be believed: a row by its columns, arrays by their shapes."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..words.columns import about
from .schema import COLUMNS, TEXTS

STATUSES = ("done", "diverged", "timeout", "error", "skipped")
KINDS = ("truth", "reference", "")

SHAPES: Mapping[str, tuple[str | int, ...]] = {
    **dict.fromkeys(
        ("t", "nis", "nis_dof", "n_eff", "ancestors", "refused", "step_ns", "wall_ns", "belief_ns", "mapped"), ("n",)
    ),
    **dict.fromkeys(("online", "final"), ("n", 3)),
    **dict.fromkeys(("at", "nees", "final_nees"), ("m",)),
    **dict.fromkeys(("aligned", "final_aligned"), ("m", 3)),
    **dict.fromkeys(("alignment", "final_alignment"), (3,)),
    "cov": ("n", 3, 3),
    "other_ns": (4,),
    "cost_terms": (4,),
    "map_ids": ("l",),
    "map_xy": ("l", 2),
    "map_cov": ("l", 2, 2),
    "final_map_ids": ("f",),
    "final_map_xy": ("f", 2),
    "final_map_cov": ("f", 2, 2),
}
"""The arrays of a cell: n steps, m of them with a known pose, l landmarks of the online map and f of the final one."""

LOG_SHAPES: Mapping[str, tuple[str | int, ...]] = {"t": ("m",), "poses": ("m", 3), "ids": ("l",), "xy": ("l", 2)}
"""The arrays of a log's truth."""

FINITE = ("t", "poses", "online", "final", "aligned", "final_aligned", "xy")
"""Arrays without a gap."""


BELONGING: Mapping[str, str] = {
    **dict.fromkeys(("online", "final"), "t"),
    **dict.fromkeys(("aligned", "final_aligned", "nees", "final_nees"), "at"),
    **{name: f"{name.rpartition('_')[0]}_ids" for name in ("map_xy", "map_cov", "final_map_xy", "final_map_cov")},
    **{name: f"{name.rpartition('_')[0]}_xy" for name in ("map_ids", "final_map_ids")},
}
"""What an array says nothing without."""


def disbelief(columns: Mapping[str, Any]) -> str:
    """Why nothing can be made of a cell's row: what was found, and what was expected; "" where something can."""
    for name in TEXTS:
        value = columns[name]
        if not isinstance(value, str) and not (value is None and (name == "reason" or name not in COLUMNS)):
            return f"{name} is {repr(value)[:40]}, expected a text"
        if value and "\N{REPLACEMENT CHARACTER}" in value:
            return f"{name} is {value[:40]!r}, which is no longer text"
    for name in ("dataset", "backend", "digest"):
        if not columns[name]:
            return f"{name} is empty, expected a text"
    for name, known in (("status", STATUSES), ("truth_kind", KINDS)):
        if columns[name] not in known:
            return f"{name} is {columns[name][:40]!r}, expected {', '.join(filter(None, known))}"
    counts = {"seed": 0} | ({"steps": 1, "sightings": 0, "ignored": 0} if columns["status"] == "done" else {})
    for name, least in counts.items():
        if not isinstance(columns[name], int) or columns[name] < least:
            return f"{name} is {repr(columns[name])[:40]}, expected a whole number of at least {least}"
    if columns["timing_alone"] not in (0, 1):
        return f"timing_alone is {repr(columns['timing_alone'])[:40]}, expected 0 or 1"
    return ""


def nonsense(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The values, by column, that stand where a number belongs and are none, or are below zero where none can be."""
    return {
        name: value
        for name, value in columns.items()
        if name not in TEXTS
        and value is not None
        and (not isinstance(value, int | float) or math.isnan(value) or (value < 0 and about(name).kind.never_negative))
    }


def misfit(
    arrays: Mapping[str, Any], sizes: Mapping[str, int], shapes: Mapping[str, tuple[str | int, ...]] = SHAPES
) -> str:
    """What is wrong with the first array that cannot belong to the others, or to the `sizes` known; "" if none is."""
    known: dict[str, int] = dict(sizes)
    for name, shape in shapes.items():
        if name not in arrays:
            continue
        array: Any = arrays[name]
        if array.dtype.kind not in "fiu":
            return f"{name} holds no numbers"
        wanted = tuple(size if isinstance(size, int) else known.get(size, -1) for size in shape)
        if array.ndim != len(wanted) or any(w not in (-1, s) for w, s in zip(wanted, array.shape, strict=True)):
            expected = " x ".join("any" if size == -1 else str(size) for size in wanted)
            return f"{name} is {' x '.join(map(str, array.shape)) or 'one number'}, expected {expected}"
        known |= {size: n for size, n in zip(shape, array.shape, strict=True) if isinstance(size, str)}
        if name in FINITE and not np.isfinite(array).all():
            return f"{name} has a value that is not finite"
    if "at" in arrays and "n" in known and not (np.isin(arrays["at"], np.arange(known["n"])).all()):
        return f"at names a step outside the {known['n']} there are"
    return ""


def incomplete(arrays: Mapping[str, Any]) -> str:
    """Which of a cell's arrays is there without the one it belongs to; "" if none is."""
    alone = [f"{name} without {other}" for name, other in BELONGING.items() if name in arrays and other not in arrays]
    return f"there is {alone[0]}" if alone else ""
