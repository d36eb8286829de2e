"""Measurement errors against ground truth."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import slices
from ..elementary import arctan2, hypot
from ..factors import UNKNOWN, Log, Map, Truth
from ..partial import RANGE
from ..se2 import Array, Ints, between, wrap

STANDING = 0.05  # of the motion in a slow step that is driven; wheels and truth of a robot that stands move by less
SLOWEST = 0.1  # share of the way that is driven in slower steps than that one
TRACK = 0.25  # m of a wheel's way per rad of turn


class Errors(NamedTuple):
    """Errors of a log's sightings or motions."""

    row: Ints  # (m,) index of the sighting, or step
    values: Array  # (m, 2) range, bearing; or (m, 3) in the coordinates of delta


def sighting_errors(log: Log, truth: Truth) -> Errors:
    """Errors of sightings where pose and landmark have ground truth, without those of landmarks that move.

    A true id takes precedence over the given one.
    """
    ids = log.ids if truth.assigned is None else truth.assigned
    known = standing(truth)
    if known is None:
        return Errors(np.zeros(0, np.int64), np.zeros((0, 2)))
    pose, step, order = rows_of(truth.t, log.t), log.sighting_step, np.argsort(known.ids)
    row, values, count = np.empty(len(ids), np.int64), np.empty((len(ids), 2)), 0
    for some in slices(len(ids)):
        at, place = pose[step[some]], _sorted_rows(known.ids, order, ids[some])
        there = np.flatnonzero((at >= 0) & (place >= 0) & (ids[some] != UNKNOWN))
        into = slice(count, count := count + len(there))
        row[into] = some.start + there
        right = sighted_from(truth.poses[at[there]], known.xy[place[there]])
        values[into] = difference(log.z[row[into]], right)
    return Errors(row[:count], values[:count])


def partial_errors(log: Log, truth: Truth) -> Errors:
    """Errors (m,) of partial sightings where pose and landmark have ground truth, without those of moving landmarks."""
    table, known = log.partial, standing(truth)
    if table is None or known is None:
        return Errors(np.zeros(0, np.int64), np.zeros(0))
    ids = table.ids if truth.assigned_partial is None else truth.assigned_partial
    pose, place = rows_of(truth.t, log.t[table.step]), rows_of(known.ids, ids)
    row = np.flatnonzero((pose >= 0) & (place >= 0) & (ids != UNKNOWN))
    right = sighted_from(truth.poses[pose[row]], known.xy[place[row]])
    off = table.z[row, None] - right
    return Errors(row, np.where(table.kind[row] == RANGE, off[:, 0], wrap(off[:, 1])))


def odometry_errors(log: Log, truth: Truth) -> Errors:
    """Errors of the motions between consecutive steps that both have a true pose."""
    row, right = _true_motions(log, truth)
    return Errors(row, difference(log.delta[row], right))


def driven_errors(log: Log, truth: Truth) -> Errors:
    """Errors of the motions as `odometry_errors`, without those of a robot that stands, which tell nothing of driving.

    It stands where neither odometry nor truth moves by STANDING of what they do in most of the way.
    """
    row, right = _true_motions(log, truth)
    size = np.maximum(
        *(np.hypot(*motion[:, :2].T) + TRACK * np.abs(motion[:, 2]) for motion in (log.delta[row], right))
    )
    ranked = np.sort(size)
    gone = np.cumsum(ranked)
    slow = ranked[np.searchsorted(gone, SLOWEST * gone[-1])] if len(row) and gone[-1] > 0 else np.inf
    moves = size > STANDING * slow
    return Errors(row[moves], difference(log.delta[row[moves]], right[moves]))


def _true_motions(log: Log, truth: Truth) -> tuple[Ints, Array]:
    """The steps (m,) that have a true pose, as the step before, and their true motions (m, 3)."""
    pose = rows_of(truth.t, log.t)
    row = np.flatnonzero((pose[1:] >= 0) & (pose[:-1] >= 0)) + 1
    return row, between(truth.poses[pose[row - 1]], truth.poses[pose[row]])


def named(log: Log, truth: Truth | None) -> Log:
    """The log with the true ids of its UNKNOWN sightings, as far as they are known; itself if there are none."""
    if truth is None or not log.unknown:
        return log
    partial = log.partial
    if partial is not None and truth.assigned_partial is not None:
        partial = replace(partial, ids=_named(partial.ids, truth.assigned_partial))
    ids = log.ids if truth.assigned is None else _named(log.ids, truth.assigned)
    return replace(log, ids=ids, partial=partial)


def _named(ids: Ints, true: Ints) -> Ints:
    found = np.where(ids == UNKNOWN, true, ids)
    found.flags.writeable = False
    return found


def standing(truth: Truth) -> Map | None:
    """The true landmarks that do not move."""
    if truth.map is None or truth.moving is None:
        return truth.map
    stays = ~np.isin(truth.map.ids, truth.moving)
    return Map(truth.map.ids[stays], truth.map.xy[stays], None)


def sighted_from(poses: Array, xy: Array) -> Array:
    """True range (m) and bearing (rad, not wrapped) (s, 2) of the points `xy` (s, 2) from the poses (s, 3)."""
    x, y = (xy - poses[:, :2]).T
    return np.stack((hypot(x, y), arctan2(y, x) - poses[:, 2]), axis=-1)


def difference(found: Array, right: Array) -> Array:
    """`found` minus `right`, sightings (m, 2) or poses or motions (m, 3), the last column, an angle, wrapped."""
    error = found - right
    error[:, -1] = wrap(error[:, -1])
    return error


def rows_of(known: Array | Ints, wanted: Array | Ints) -> Ints:
    """Index of each of `wanted` in `known`, whose entries are distinct; -1 where missing."""
    return _sorted_rows(known, np.argsort(known), wanted)


def _sorted_rows(known: Array | Ints, order: Ints, wanted: Array | Ints) -> Ints:
    """As `rows_of`, of entries that are sorted in `order`."""
    if not len(known):
        return np.full(len(wanted), -1)
    place = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)]
    return np.where(known[place] == wanted, place, -1)


def counted(ids: Ints, wanted: Ints) -> Ints:
    """Counts each of `wanted` (n,) among `ids` (s,)."""
    names, times = np.unique(ids, return_counts=True)
    row = rows_of(names, wanted)
    return np.where(row >= 0, np.append(times, 0)[row], 0)
