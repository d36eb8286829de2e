"""Scores data association against the true ids, and what was taken out of a log on the way to a backend.

Made-up ids say nothing by themselves. Pairwise precision and recall compare all pairs of sightings: P is the share of
the pairs with one id that are of one true landmark, R the share of the pairs of one true landmark that have one id. A
sighting that was dropped, or whose true landmark is not known, is of a landmark of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Ints
from .drive import Outcome

MOST = 20  # landmarks of a kind that a remark names


class Majority(NamedTuple):
    """The true landmark that most sightings of each made-up one are of."""

    ids: Ints  # (m,) as the backend numbers them
    true: Ints  # (m,) UNKNOWN where most are of none, which are clutter
    right: Ints  # (m,) sightings of that
    total: Ints  # (m,) sightings


def majority(assigned: Ints, true: Ints) -> Majority:
    """Finds the majority's landmark of each id that s sightings were assigned to, `true` (s,) being the right ones."""
    used = assigned != UNKNOWN
    pairs, counts = np.unique(np.stack((assigned[used], true[used])), axis=1, return_counts=True)
    order = np.lexsort((pairs[1], -counts, pairs[0]))  # of each id the most frequent first
    ids, first = np.unique(pairs[0][order], return_index=True)
    total = np.bincount(np.searchsorted(ids, pairs[0]), counts, len(ids)).astype(np.int64)
    return Majority(ids, pairs[1][order][first], counts[order][first].astype(np.int64), total)


def association_columns(assigned: Ints, true: Ints) -> dict[str, Any]:
    """The columns of an association (s,) with the true ids (s,), UNKNOWN being clutter or not known."""
    if not len(true):
        return {}
    found, used = majority(assigned, true), assigned != UNKNOWN
    both = used & (true != UNKNOWN)
    named, real = _pairs(assigned[used]), _pairs(true[true != UNKNOWN])
    together = np.stack((assigned[both], true[both]))
    same = _pairs(np.unique(together, axis=1, return_inverse=True)[1].ravel()) if both.any() else 0
    landmarks = found.true[found.true != UNKNOWN]
    row: dict[str, Any] = {
        "dropped_share": float(1 - used.mean()),
        "landmarks_double": len(landmarks) - len(np.unique(landmarks)),
        "landmarks_clutter": len(found.true) - len(landmarks),
        "landmarks_merged": len(np.setdiff1d(true[both], found.true)),  # their sightings went to others'
    }
    if used.any():
        row["wrong_share"] = float(1 - found.right.sum() / found.total.sum())
    if named:
        row["pair_precision"] = same / named
    if real:
        row["pair_recall"] = same / real
    return row


def by_true_ids(landmarks: Map, assigned: Ints, true: Ints) -> Map:
    """The map with the majorities' true ids: of several for one landmark that of most sightings, and no clutter.

    Landmarks that no sighting was assigned to keep their ids.
    """
    found = majority(assigned, true)
    at = {landmark: k for k, landmark in enumerate(found.ids.tolist())}
    best: dict[int, tuple[int, int]] = {}  # true id -> sightings, row in the map
    for row, landmark in enumerate(landmarks.ids.tolist()):
        k = at.get(landmark)
        name, weight = (landmark, -1) if k is None else (int(found.true[k]), int(found.total[k]))
        if (name > UNKNOWN or k is None) and (name not in best or weight > best[name][0]):
            best[name] = weight, row
    names, rows = np.array(list(best), np.int64), np.array([row for _, row in best.values()], np.int64)
    entries = np.stack((2 * rows, 2 * rows + 1), axis=1).ravel()
    cov = None if landmarks.cov is None else landmarks.cov[np.ix_(entries, entries)]
    return Map(names, landmarks.xy[rows], cov)


def _pairs(ids: Ints) -> int:
    """Counts the pairs of equal ids."""
    counts = np.unique(ids, return_counts=True)[1]
    return int((counts * (counts - 1) // 2).sum())


def moved(log: Log, outcome: Outcome, truth: Truth | None) -> tuple[dict[str, Any], list[str]]:
    """Scores what was taken out, landmarks that have moved and misread sightings: columns, and remarks that name them.

    A made-up id stands for the true landmark of most of its sightings. Both are empty where nothing can be taken out.
    """
    if outcome.taken_out is None:
        return {}, []
    ids, misread = outcome.taken_out
    named, said = np.unique(ids), list[str]()
    if outcome.assigned is not None and truth is not None and truth.assigned is not None:
        found = majority(outcome.assigned, truth.assigned)
        true = dict(zip(found.ids.tolist(), found.true.tolist(), strict=True))
        named = np.unique(np.array([true.get(i, i) for i in ids.tolist()], np.int64))
        named = named[named != UNKNOWN]
    row: dict[str, Any] = {"moved_out": len(named)}
    if len(log.ids):
        row["misread_share"] = misread / len(log.ids)
    words = f"took out landmark{'s' * (len(named) > 1)} {_names(named)} as moved"
    if truth is not None and truth.map is not None:
        moving = np.zeros(0, np.int64) if truth.moving is None else truth.moving
        right = np.isin(named, moving)
        row["moved_false"] = int((~right).sum())
        sighted = np.intersect1d(moving, log.ids if truth.assigned is None else truth.assigned)
        if len(sighted):
            row["moved_found"] = float(np.isin(sighted, named).mean())
        words += ": " + ", ".join(
            f"{'all' if len(group) == len(named) > 1 else _names(group)} {one if len(group) == 1 else several}"
            for group, one, several in ((named[right], "does move", "do move"), (named[~right], "stands", "stand"))
            if len(group)
        )
    said += [words] * bool(len(named))
    said += [f"left out {misread} sighting{'s' * (misread > 1)} as misread"] * bool(misread)
    return row, said


def _names(ids: Ints) -> str:
    names = [str(i) for i in ids[:MOST].tolist()] + [f"{len(ids) - MOST} more"] * (len(ids) > MOST)
    return "".join(names) if len(names) < 2 else f"{', '.join(names[:-1])} and {names[-1]}"
