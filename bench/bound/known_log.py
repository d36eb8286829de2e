"""A log as one would have it who knows the truth: with right ids, and where all its poses and landmarks were."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.arrays import frozen_ids
from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Array, Ints, compose, inverse
from ...core.truth.doubts import headings_known
from ...core.truth.errors import rows_of, standing

PLACES = "the landmarks' places are unknown"  # of some or of all that are sighted


class KnownLog(NamedTuple):
    """The right ones of a log's factors, and the true state."""

    log: Log  # without false loop closures, and without sightings of nothing, or of what moves
    path: Array  # (n, 3); where the truth is not known, along the odometry from where it is
    landmarks: Map
    at: Ints  # (m,) steps whose true pose is known


def known_log(log: Log, truth: Truth | None) -> KnownLog | None:
    """None where something of the true state is `missing`."""
    if truth is None or missing(log, truth):
        return None
    at = rows_of(log.t, truth.t)
    return KnownLog(_right(log, truth), _whole(log, truth.poses, at), _places(truth), at)


def missing(log: Log, truth: Truth | None) -> str:
    """Says what is not known of a log: its true path, what is sighted, or the place of that; "" where all is."""
    if truth is None or truth.kind != "truth" or not len(truth.t):
        return "the true path is unknown"
    if not headings_known(log, truth):
        return "the true headings are unknown"
    partial = log.partial
    unknown = truth.assigned is None and (log.ids == UNKNOWN).any()
    if partial is not None:
        unknown |= truth.assigned_partial is None and (partial.ids == UNKNOWN).any()
    if unknown:
        return "the true ids of sightings are unknown"
    known, given = _places(truth).ids, log.prior.map
    placed = given is None or np.isin(given.ids, known).all()
    return "" if placed and np.isin(_right(log, truth).seen, known).all() else PLACES


def _places(truth: Truth) -> Map:
    return standing(truth) or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)


def _right(log: Log, truth: Truth) -> Log:
    """The log with the true ids of its sightings, as far as these are known, without what is of no landmark."""
    moving = np.zeros(0, np.int64) if truth.moving is None else truth.moving
    partial = log.partial
    if partial is not None:
        ids = partial.ids if truth.assigned_partial is None else truth.assigned_partial
        partial = replace(partial, ids=frozen_ids(np.where(np.isin(ids, moving), UNKNOWN, ids)))
    ids = log.ids if truth.assigned is None else truth.assigned
    log = replace(log, ids=frozen_ids(np.where(np.isin(ids, moving), UNKNOWN, ids)), partial=partial).identified()
    if truth.false_loops is None or not len(truth.false_loops):
        return log
    kept = np.delete(np.arange(len(log.loop_to)), truth.false_loops)
    first = np.searchsorted(log.loop_step[kept], np.arange(len(log) + 1))
    return replace(
        log,
        loop_first=frozen_ids(first),
        loop_to=frozen_ids(log.loop_to[kept]),
        loop_delta=log.loop_delta[kept],
        loop_cov=log.loop_cov[kept],
    )


def _whole(log: Log, poses: Array, at: Ints) -> Array:
    """(n, 3) a path with the `poses` (m, 3) at the steps `at` (m,), and odometry from the last of them in between."""
    reckoned = log.dead_reckoned()
    last = np.maximum(np.searchsorted(at, np.arange(len(log)), side="right") - 1, 0)
    path = compose(compose(poses[last], inverse(reckoned[at[last]])), reckoned)
    path[at] = poses
    return path
