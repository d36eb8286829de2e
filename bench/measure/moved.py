"""Scores what was taken out of a log on the way to a backend: landmarks that have moved, and misread sightings."""

from typing import Any

import numpy as np

from ...core.factors import UNKNOWN, Log, Truth
from ...core.se2 import Ints
from .association import majority
from .drive import Outcome

MOST = 20
"""Landmarks of a kind that a remark names."""


def moved_columns(log: Log, outcome: Outcome, truth: Truth | None) -> dict[str, Any]:
    """Returns the columns of what was taken out; empty where nothing is."""
    if outcome.taken_out is None:
        return {}
    named, misread = _true(outcome, truth), outcome.taken_out.misread
    row: dict[str, Any] = {"moved_out": len(named)}
    if len(log.ids):
        row["misread_share"] = misread / len(log.ids)
    if truth is None or truth.map is None:
        return row
    moving = np.zeros(0, np.int64) if truth.moving is None else truth.moving
    row["moved_false"] = int((~np.isin(named, moving)).sum())
    sighted = np.intersect1d(moving, log.ids if truth.assigned is None else truth.assigned)
    if len(sighted):
        row["moved_found"] = float(np.isin(sighted, named).mean())
    return row


def moved_remarks(outcome: Outcome, truth: Truth | None) -> list[str]:
    """Names the landmarks that were taken out, and counts the sightings that were misread."""
    if outcome.taken_out is None:
        return []
    named, misread = _true(outcome, truth), outcome.taken_out.misread
    said: list[str] = []
    if len(named):
        words = f"took out landmark{'s' * (len(named) > 1)} {_names(named)} as moved"
        if truth is not None and truth.map is not None:
            right = np.isin(named, np.zeros(0, np.int64) if truth.moving is None else truth.moving)
            words += ": " + ", ".join(
                f"{'all' if len(group) == len(named) > 1 else _names(group)} {one if len(group) == 1 else several}"
                for group, one, several in ((named[right], "does move", "do move"), (named[~right], "stands", "stand"))
                if len(group)
            )
        said.append(words)
    if misread:
        said.append(f"left out {misread} sighting{'s' * (misread > 1)} as misread")
    return said


def _true(outcome: Outcome, truth: Truth | None) -> Ints:
    """The landmarks taken out, a made-up id being the true one of most of its sightings; UNKNOWN for clutter."""
    assert outcome.taken_out is not None
    ids = outcome.taken_out.moved
    if outcome.assigned is None or truth is None or truth.assigned is None:
        return np.unique(ids)
    found = majority(outcome.assigned, truth.assigned)
    true = dict(zip(found.ids.tolist(), found.true.tolist(), strict=True))
    named = np.unique(np.array([true.get(i, i) for i in ids.tolist()], np.int64))
    return named[named != UNKNOWN]


def _names(ids: Ints) -> str:
    names = [str(i) for i in ids[:MOST].tolist()] + [f"{len(ids) - MOST} more"] * (len(ids) > MOST)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
