"""What a reader must know of a run as a whole, made good where a damaged record no longer says it."""

import hashlib
from collections.abc import Iterable, Mapping
from typing import Any

UNKNOWN = "not known"

_ENVIRONMENT: dict[str, Any] = {
    "processor": UNKNOWN,
    "cores": None,
    "memory_gb": None,
    "system": UNKNOWN,
    "python": UNKNOWN,
    "packages": {},
    "revision": None,
}
_STAND_INS: dict[str, Any] = {
    "command": UNKNOWN,
    "options": {},
    "folders": {},
    "environment": _ENVIRONMENT,
    "workers": 1,
    "timing_policy": "How times were taken is not known.",
    "started": 0.0,
}
_KINDS: dict[str, Any] = {
    **{name: type(value) for name, value in _STAND_INS.items()},
    **dict.fromkeys(("started", "finished"), (int, float)),
    "plan": dict,
    "cells": int,
    "random": list,
    "implementations": dict,
    "truths": dict,
    "sketches": dict,
    "map": (str, type(None)),
}

PLAN: dict[str, Any] = {"backend": str, "dataset": str, "seeds": int, "timeout_s": (int, float), "memory_mb": int}
"""What a plan says in any version, and in what form."""

SOUND: dict[str, Any] = {"backend": "", "dataset": "", "seeds": 1, "timeout_s": 1.0, "memory_mb": 1}


def completed(
    run: Mapping[str, Any], variants: Iterable[tuple[str, str]], started: float
) -> tuple[dict[str, Any], list[str]]:
    """What a report needs to know of a run, and the names of what was not known or not as it should be.

    `variants` are datasets and backends, (label, name), each of which gets the name of a folder; `started`, seconds
    since 1970, stands in for the time of the run.
    """
    found = {name: value for name, value in run.items() if isinstance(value, _KINDS.get(name, object))}
    whole: dict[str, Any] = _STAND_INS | {"started": started} | found
    whole["environment"] = _ENVIRONMENT | whole["environment"]
    if not isinstance(whole["environment"]["packages"], dict):
        whole["environment"]["packages"] = {}
    whole["options"] = {label: given for label, given in whole["options"].items() if isinstance(given, dict)}
    told: dict[Any, Any] = found.get("implementations", {})  # a run of an earlier version has none
    whole["implementations"] = {label: text for label, text in told.items() if isinstance(text, str)}
    folders: dict[str, Any] = {name: place for name, place in whole["folders"].items() if _is_name(place)}
    wanted = {label: _folder(label, name) for label, name in variants if label not in folders}
    whole["folders"] = folders | wanted
    unknown = [name for name in {**_STAND_INS, **run} if name not in found]
    if wanted and "folders" not in unknown:
        unknown.append("folders")
    return whole, unknown


def sound_plan(words: Any) -> bool:
    """Whether a run can go on by these words."""
    return isinstance(words, dict) and all(isinstance(words.get(name), kind) for name, kind in PLAN.items())  # pyright: ignore[reportUnknownMemberType]


def _is_name(place: Any) -> bool:
    """Whether it is the name of a folder in that of the run, and not the way to somewhere else."""
    return isinstance(place, str) and place not in ("", ".", "..") and not set(place) & set("/\\\0")


def _folder(label: str, name: str) -> str:
    """As a run names it: the name, and a short hash where that does not say it all."""
    plain = "".join(c if c.isalnum() or c in "-_." else "-" for c in name)
    return plain if plain == label else f"{plain}-{hashlib.sha256(label.encode()).hexdigest()[:8]}"
