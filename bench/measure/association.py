"""Scores data association: which sightings a backend took to be of one landmark, against the true ids.

Made-up ids say nothing by themselves. Pairwise precision and recall compare all pairs of sightings: P is the share of
the pairs with one id that are of one true landmark, R the share of the pairs of one true landmark that have one id. A
sighting that was dropped, or whose true landmark is not known, is of a landmark of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Map
from ...core.se2 import Ints


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
    """Returns the columns of an association (s,) with the true ids (s,), UNKNOWN being clutter or not known."""
    if not len(true):
        return {}
    found, used = majority(assigned, true), assigned != UNKNOWN
    both = used & (true != UNKNOWN)
    named, real = _pairs(assigned[used]), _pairs(true[true != UNKNOWN])
    same = _pairs(_joined(assigned[both], true[both]))
    landmarks = found.true[found.true != UNKNOWN]
    row: dict[str, Any] = {
        "dropped_share": float(1 - used.mean()),
        "landmarks_double": len(landmarks) - len(np.unique(landmarks)),
        "landmarks_clutter": len(found.true) - len(landmarks),
        "landmarks_merged": _merged(assigned[both], true[both], found),
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
    best: dict[int, int] = {}  # true id -> row in the map
    for row, landmark in enumerate(landmarks.ids.tolist()):
        k = at.get(landmark)
        name, weight = (landmark, -1) if k is None else (int(found.true[k]), int(found.total[k]))
        other = best.get(name)
        if name <= UNKNOWN and k is not None:
            continue
        if other is None or weight > _weight(landmarks, other, at, found):
            best[name] = row
    names, rows = np.array(list(best), np.int64), np.array(list(best.values()), np.int64)
    entries = np.stack((2 * rows, 2 * rows + 1), axis=1).ravel()
    cov = None if landmarks.cov is None else landmarks.cov[np.ix_(entries, entries)]
    return Map(names, landmarks.xy[rows], cov)


def _weight(landmarks: Map, row: int, at: dict[int, int], found: Majority) -> int:
    k = at.get(int(landmarks.ids[row]))
    return -1 if k is None else int(found.total[k])


def _merged(assigned: Ints, true: Ints, found: Majority) -> int:
    """Counts the landmarks that are the majority of no id: their sightings went to others'."""
    return len(np.setdiff1d(np.unique(true), found.true)) if len(assigned) else 0


def _pairs(ids: Ints) -> int:
    """Counts the pairs of equal ids."""
    counts = np.unique(ids, return_counts=True)[1]
    return int((counts * (counts - 1) // 2).sum())


def _joined(a: Ints, b: Ints) -> Ints:
    """Numbers the different pairs (a, b)."""
    return np.unique(np.stack((a, b)), axis=1, return_inverse=True)[1].ravel() if len(a) else a
