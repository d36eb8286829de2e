"""Checks a record's rows by their columns and its arrays by their shapes, against edits by hand."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..words.columns import about
from .schema import TEXTS

STATUSES = ("done", "diverged", "timeout", "error", "skipped")
KINDS = ("truth", "reference", "", None)

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
"""The arrays of a cell: n steps, m of them with a known pose, l landmarks of the online map, f of the final one."""


def wrong_row(columns: Mapping[str, Any]) -> str:
    """Describes the first invalid value: what was found and expected; "" where all are valid."""
    for name in TEXTS:
        value = columns[name]
        if value is not None and (not isinstance(value, str) or "\N{REPLACEMENT CHARACTER}" in value):
            return f"{name} is {_cut(value)}, expected a text"
    for name, known in (("status", STATUSES), ("truth_kind", KINDS)):
        if columns[name] not in known:
            return f"{name} is {_cut(columns[name])}, expected {', '.join(filter(None, known))}"
    least = 1 if columns["status"] == "done" else 0
    if not isinstance(columns["seed"], int) or (
        least and not (isinstance(columns["steps"], int) and columns["steps"] > 0)
    ):
        return f"seed is {_cut(columns['seed'])} and steps {_cut(columns['steps'])}, expected whole numbers"
    for name, value in columns.items():
        if name in TEXTS or value is None:
            continue
        if not isinstance(value, int | float) or math.isnan(value):
            return f"{name} is {_cut(value)}, expected a number"
        if value < 0 and about(name).kind.never_negative:
            return f"{name} is {value:g}, expected 0 or more"
    return ""


def wrong_arrays(arrays: Mapping[str, Any], steps: int | None) -> str:
    """Describes the first array that does not fit the others or the number of steps; "" where all do."""
    sizes: dict[str, int] = {} if steps is None else {"n": steps}
    for name, shape in SHAPES.items():
        if name not in arrays:
            continue
        array: Any = arrays[name]
        wanted = tuple(size if isinstance(size, int) else sizes.get(size, -1) for size in shape)
        fits = array.dtype.kind in "fiu" and array.ndim == len(wanted)
        if not fits or any(w not in (-1, s) for w, s in zip(wanted, array.shape, strict=True)):
            expected = " x ".join("any" if size == -1 else str(size) for size in wanted)
            return f"{name} is {' x '.join(map(str, array.shape))} of {array.dtype}, expected numbers, {expected}"
        sizes |= {size: n for size, n in zip(shape, array.shape, strict=True) if isinstance(size, str)}
    if "at" in arrays and "n" in sizes and not np.isin(arrays["at"], np.arange(sizes["n"])).all():
        return f"at names a step outside the {sizes['n']} there are"
    return ""


def _cut(value: Any) -> str:
    return repr(value)[:40]
