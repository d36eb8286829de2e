"""Checks a record's facts and rows by their types and its arrays by their shapes, against edits by hand."""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ..words.columns import about
from .schema import STATUSES, TEXTS

KINDS = ("truth", "reference", "relations", "", None)

SHAPES: Mapping[str, tuple[str | int, ...]] = {
    **dict.fromkeys(
        ("t", "nis", "nis_dof", "n_eff", "ancestors", "refused", "step_ns", "wall_ns", "belief_ns", "mapped"), ("n",)
    ),
    "constants": ("constants", 5),
    **dict.fromkeys(("online", "final"), ("n", 3)),
    **dict.fromkeys(("at", "nees", "final_nees"), ("m",)),
    **dict.fromkeys(("aligned", "final_aligned"), ("m", 3)),
    **dict.fromkeys(("alignment", "final_alignment"), (3,)),
    "cov": ("n", 3, 3),
    "other_ns": (4,),
    **dict.fromkeys(("range_step", "range_off"), ("r",)),
    "cost_terms": (4,),
    "map_ids": ("l",),
    "map_xy": ("l", 2),
    "map_cov": ("l", 2, 2),
    "final_map_ids": ("f",),
    "final_map_xy": ("f", 2),
    "final_map_cov": ("f", 2, 2),
    **dict.fromkeys(("assigned", "final_assigned"), ("s",)),
}
"""The arrays of a cell: n steps, m of them with a known pose, s sightings, l landmarks of the online map, f of the
final one, r ranges alone."""

FACTS: Mapping[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("environment", "folders", "options"), dict),
    "workers": int,
    "timing_policy": str,
    "started": (int, float),
}
"""The facts of a run or a study that every reader needs, and their types."""

MORE_FACTS: Mapping[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("plan", "implementations", "distributions"), dict),
    "kind": str,
    "command": (str, list),
    "random": list,
}
"""Those that earlier versions, or studies, have not."""


def wrong_facts(about: Mapping[str, Any], labels: Collection[str]) -> str:
    """Describes the first fact that is not there or of another type; `labels` need a folder each. "" where all fit."""
    lacking = {} if about.get("kind") == "study" else {"command": str}
    for name, kind in {**FACTS, **lacking}.items():
        if not isinstance(about.get(name), kind):
            return f"about: {name} is {_cut(about.get(name))}, expected {_KINDS[kind]}"
    for name, kind in MORE_FACTS.items():
        if name in about and not isinstance(about[name], kind):
            return f"about: {name} is {_cut(about[name])}, expected {_KINDS[kind]}"
    if not isinstance(about["environment"].get("packages"), dict):
        return "about: environment has no packages, expected their versions by name"
    texts = {"folders": about["folders"]} | {name: about.get(name, {}) for name in ("implementations", "distributions")}
    for name, label, text in ((name, *one) for name, words in texts.items() for one in words.items()):
        if not isinstance(text, str):
            return f"about: {name} has {_cut(text)} for {label}, expected a text"
    without = next((name for name in labels if name not in about["folders"]), None)
    return "" if without is None else f"about: folders has none for {without}, which the plan names"


_KINDS: Mapping[Any, str] = {
    dict: "a table",
    list: "a list",
    str: "a text",
    int: "a whole number",
    (int, float): "a number",
    (str, list): "a text or its words",
}


def wrong_truth(known: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """Describes how the arrays of a log's truth do not fit one another, or a cell's `arrays`; "" where they do."""
    t, poses = known.get("t"), known.get("poses")
    if not known:
        return "the poses that its path is measured from are not there" if "at" in arrays else ""
    if t is None or poses is None or any(a.dtype.kind not in "fiu" for a in (t, poses)):
        return "the truth of its log has no times or no poses"
    if t.ndim != 1 or poses.shape != (len(t), 3):
        return f"the truth of its log has {' x '.join(map(str, poses.shape))} poses, expected {t.size} x 3"
    if "at" in arrays and "t" in arrays and not np.isin(arrays["t"][arrays["at"]], t).all():
        return "the truth of its log lacks poses at steps that its path is measured at"
    if "ids" in known or "xy" in known:
        ids, xy = known.get("ids"), known.get("xy")
        if ids is None or xy is None or ids.ndim != 1 or xy.shape != (len(ids), 2) or xy.dtype.kind not in "fiu":
            return "the truth of its log has other landmarks than places, expected as many"
        if "times" in known and known["times"].shape != ids.shape:
            return "the truth of its log has other landmarks than numbers of their sightings, expected as many"
    return _wrong_sightings(known, arrays)


def _wrong_sightings(known: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """Describes how the landmarks of a log's sightings do not fit their steps or a cell's; "" where they do."""
    if "sighted" not in known and "sighted_at" not in known:
        return ""
    ids, at = (known.get(name, np.zeros(0)) for name in ("sighted", "sighted_at"))
    if ids.ndim != 1 or ids.shape != at.shape or any(a.dtype.kind not in "iu" for a in (ids, at)):
        return "the truth of its log has other landmarks of sightings than steps of them, expected as many"
    for name in ("assigned", "final_assigned"):
        if name in arrays and len(arrays[name]) != len(ids):
            return f"{name} has {len(arrays[name])} landmarks, expected one for each of the log's {len(ids)} sightings"
    if "t" in arrays and len(at) and not (at.min() >= 0 and at.max() < len(arrays["t"])):
        return f"the truth of its log has sightings of a step outside the {len(arrays['t'])} there are"
    return ""


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
