"""Landmarks that are elsewhere: true places that are swapped or far off, and ids that are sighted at two places."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...backends.api import Diverged
from ...backends.common_options import LOSSES
from ...backends.graphs.batch import Batch
from ...core.factors import Log, Map, Truth
from ...core.se2 import Array, Ints
from ...core.truth.doubts import judges
from ...core.truth.errors import named, rows_of, standing
from ...datasets.truth_remarks import COVERED
from ..measure.landmark_places import placed
from ..measure.misfit import misfits
from ..measure.misplaced import Misplaced, misplaced, told
from ..measure.stated_noise import NAMED
from ..words.numerals import listed, number
from .fit import FAR, ITERATIONS, LOSS, TOLERANCE
from .two_places import TwoPlaces, two_places

LARGEST = 50_000  # steps, and sightings, of a log without a true path, the most that are fitted as a whole
BENT = 0.03  # share of sightings that are far out, from which on a fit may be bent by an id at two places
FITS = (
    (LOSS, Batch.start_by_chunks),
    ("geman-mcclure", Batch.start_by_chunks),
    (LOSS, Batch.start_by_odometry),
)
"""Losses and starts of the fits that are tried then."""


class Elsewhere(NamedTuple):
    """The landmarks that are elsewhere, in words."""

    twice: list[str]  # sighted at two places
    ids: Ints  # of these
    places: list[str]  # the true place is another
    fit: tuple[Array, Map] | None = None  # path (n, 3) and map of the whole log, where no true path is known


class _Along(NamedTuple):
    """The landmarks along a path, and those at two places."""

    landmarks: Map
    twice: list[TwoPlaces]
    path: Array | None = None  # (n, 3) of a fit


def elsewhere(log: Log, truth: Truth | None) -> Elsewhere:
    """Looks for them along the true path, else along that of a robust fit of the whole log."""
    log = named(log, truth).identified()
    found = _by_truth(log, truth) or _by_fit(log)
    if found is None:
        return Elsewhere([], np.zeros(0, np.int64), [])
    moving = () if truth is None or truth.moving is None else truth.moving.tolist()
    twice = [one for one in found.twice if one.id not in moving]
    ids = np.array([one.id for one in found.twice], np.int64)
    known = None if truth is None or truth.places != "truth" else standing(truth)
    places = list[str]()
    if known is not None:
        kept = ~np.isin(found.landmarks.ids, ids)
        once = Map(found.landmarks.ids[kept], found.landmarks.xy[kept], None)
        places = list(in_words(misplaced(once, known, told(log, once.ids))))
    fit = None if found.path is None else (found.path, found.landmarks)
    return Elsewhere(list(map(_twice, twice)), ids, places, fit)


def in_words(found: Misplaced) -> Iterator[str]:
    """Says which true places are others'."""
    if found.exchanged is not None:
        cycles = found.exchanged.ids
        pairs = all(len(cycle) == 2 for cycle in cycles)
        names = [str(name) for cycle in cycles for name in cycle]
        before, after = number(found.exchanged.before), number(found.exchanged.after)
        if pairs:
            of = [f"{one} and {other}" for one, other in cycles]
            said = f"of landmarks {', '.join(of[:NAMED])}{' and of more' * (len(of) > NAMED)} look swapped"
        else:
            said = f"of landmarks {listed(names, NAMED)} look permuted"
        yield f"the true places {said}: exchanged, the error of the map falls from {before} to {after} m"
    if found.astray is not None:
        yield _astray(*found.astray)


def _astray(ids: Sequence[int], errors: Sequence[float], others: int, typical: float, most: float) -> str:
    one = len(ids) == 1
    names = listed([str(name) for name in ids], NAMED)
    begun = (
        f"the true place of landmark {names} is not where its sightings have it: it is"
        if one
        else f"the true places of landmarks {names} are not where their sightings have them: they are"
    )
    far = number(errors[0]) if one else f"{number(errors[-1])} to {number(errors[0])}"
    return (
        f"{begun} {far} m off, where the other {others} are {number(typical)} m off (median), {number(most)} m at most"
    )


def _twice(found: TwoPlaces) -> str:
    one, other = found.sightings
    return (
        f"id {found.id} is sighted at two places, {number(found.distance)} m apart ({one:,} and {other:,} sightings), "
        "as of two markers with one id, or of one that was moved"
    )


def _by_truth(log: Log, truth: Truth | None) -> _Along | None:
    """By the true path, if it covers the log and can be its own."""
    if truth is None or len(truth.t) < COVERED * len(log) or not judges(log, truth):
        return None
    row = rows_of(truth.t, log.t)
    path = np.where((row >= 0)[:, None], truth.poses[row], np.nan)
    found = placed(log, truth.poses, row, known=True)
    return _Along(Map(found.ids, found.xy, None), two_places(log, path, found))


def _by_fit(log: Log) -> _Along | None:
    """By a robust fit, of several where many sightings are far out the one with the fewest: an id may have bent it."""
    if not len(log.ids) or max(len(log), len(log.ids)) > LARGEST:
        return None
    best, least = None, np.inf
    for loss, start in FITS:
        batch = Batch(log, list(LOSSES).index(loss), LOSSES[loss])
        try:
            start(batch)
            batch.fit(TOLERANCE, ITERATIONS)
        except Diverged:
            continue
        path, landmarks = batch.place()
        squares = misfits(log, path, landmarks)
        if squares is None or not np.isfinite(path).all():
            continue
        far = float((squares > FAR).mean())
        if far < least:
            best, least = (path, landmarks), far
        if far <= BENT:
            break
    if best is None:
        return None
    path, landmarks = best
    return _Along(landmarks, two_places(log, path, placed(log, path, np.arange(len(log)), known=False)), path)
