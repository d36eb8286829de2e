"""Landmarks that ranges or bearings alone place, tried elsewhere: lower minima of J than the one next to the start.

A ring or a ray leaves several places open, and a path that is off makes a wrong one the likeliest. The fit then bends
the path to it, and J has a minimum there. So each landmark in turn is moved to the other places that its sightings
leave open, along the path that was found and along the one that the fit began with, all of them together first, as a
mirrored path has mirrored landmarks. Everything is fitted again from there, and the lowest J is kept, until no other
place is better.
"""

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from ...core.factors import Map
from ...core.partial import PartialTable
from ...core.se2 import Array
from ...core.truth.errors import rows_of
from ..api import Diverged
from ..smoothing.valleys import here
from ..starting.placing import are_apart, places
from .batch import Batch
from .distances import of_partial, unevenness

FEW = 3  # places of a landmark along each path
TRIES = 40  # most fits
COARSE, MOST = 1e-6, 40  # tolerance and most iterations of a fit that is tried
LOWER = 1e-6  # share by which J has to be lower

BESIDE = 3.0
"""Standard deviations by which a landmark's mean distance is above the others' median where it may be elsewhere."""


def lowest(batch: Batch, start: Array, empty: Callable[[], Batch]) -> Batch:
    """The fit of least J found from `batch`, which began with the path `start` (n, 3); itself where none is lower.

    `empty` makes a batch of the same log and loss.
    """
    tries, fallen = TRIES, True
    while fallen:
        fallen = False
        for path, landmarks in _elsewhere(batch, start):
            if not tries:
                return batch
            tries -= 1
            other = empty()
            with contextlib.suppress(Diverged):
                other.start_at(path, landmarks, batch.constant(landmarks.ids))
                other.fit(COARSE, MOST)
                if here(other.forest) < here(batch.forest) * (1 - LOWER):
                    batch, fallen = other, True
                    break
    return batch


def _elsewhere(batch: Batch, start: Array) -> Iterator[tuple[Array, Map]]:
    """Paths (n, 3) and maps to fit from: all landmarks at their first, second, ... places, then one at each of its own.

    The path is that found, or `start`. Of single landmarks, those that are furthest from their sightings are first.
    Nothing where all are about as far, and distances even.
    """
    log, (found, landmarks) = batch.log, batch.place()
    table = log.partial
    if table is None:
        return
    rows, beside = _worst_first(batch, table)
    if not beside and unevenness(log, found, landmarks) <= 1:
        return
    each = {row: list[tuple[Array, Array]]() for row in rows}
    for path in (found, start):
        open_ = [_places(table, path, landmarks.ids[row])[:FEW] for row in rows]
        for k in range(max(map(len, open_), default=0)):
            moved = landmarks.xy.copy()
            for row, some in zip(rows, open_, strict=True):
                if some:  # a single range leaves none that is better than others
                    moved[row] = some[min(k, len(some) - 1)]
            yield path, landmarks._replace(xy=moved)
        for row, some in zip(rows, open_, strict=True):
            each[row] += [(path, xy) for xy in some if are_apart(xy, landmarks.xy[row], path[-1])]
    for row in rows:
        for path, xy in each[row]:
            moved = landmarks.xy.copy()
            moved[row] = xy
            yield path, landmarks._replace(xy=moved)


def _worst_first(batch: Batch, table: PartialTable) -> tuple[list[int], bool]:
    """Rows in the map of the landmarks of partial sightings alone, by their mean distance from these.

    True with them where one is significantly further than the others.
    """
    path, landmarks = batch.place()
    far = of_partial(batch.log, path, landmarks, batch.constant(landmarks.ids))
    ids, which, number = np.unique(table.ids, return_inverse=True, return_counts=True)
    mean = np.bincount(which, far, len(ids)) / number
    beside = bool((mean > np.median(mean) * (1 + BESIDE * np.sqrt(2 / number))).any())
    rows = rows_of(landmarks.ids, ids[np.argsort(-mean, kind="stable")])
    given = [] if batch.log.prior.map is None else batch.log.prior.map.ids
    return rows[~np.isin(landmarks.ids[rows], [*batch.log.ids, *given])].tolist(), beside


def _places(table: PartialTable, path: Array, landmark: int) -> list[Array]:
    mine = table.ids == landmark
    return places(path[table.step[mine]], table.kind[mine], table.z[mine], table.var[mine])
