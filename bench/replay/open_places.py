"""The places that ranges or bearings alone leave open for a landmark: arcs, or stretches of a ray.

A backend's map does not say so. It is computed here for every backend alike, along its own path and with the drift of
the odometry, from the first two sightings of a landmark until the backend has placed it.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ...backends.starting._placing import SCALE
from ...backends.starting.drift import wandered
from ...backends.starting.late_places import MORE, thinned
from ...backends.starting.placing import are_apart, placed, places
from ...core.factors import UNKNOWN, Log
from ...core.partial import RANGE, PartialTable
from ...core.se2 import Array, Ints, wrap
from .course import Course, Landmarks

AROUND, ALONG = 90, 60  # points of a ring; along a ray
NEAREST = 0.01  # share of the plane at which the ray's points begin
BESIDE = np.linspace(-3, 3, 13)  # standard deviations of its last sighting by which a place is off the ring or the ray
LIKELY = 5.99  # most by which twice the loss is above the least one: 95 % of two degrees of freedom


class OpenPlaces:
    """Goes through the frames of a course in order; `far` is the plane's extent, m."""

    def __init__(self, log: Log, course: Course, far: float) -> None:
        self._log, self._path, self._constant, self._far = log, course.path, course.constant, far
        given = log.prior.map
        self._settled: set[int] = set() if given is None else set(given.ids.tolist())
        self._count: dict[int, int] = {}  # of a landmark's sightings, when its places were computed last
        self._places: dict[int, Array] = {}

    def at(self, step: int, known: Landmarks) -> tuple[Landmarks, Sequence[Array]]:
        """The lines (k, 2) on which each landmark may be at a step, NaN in gaps; and the map without these landmarks.

        A landmark is placed once it is sighted whole, or is on the backend's map `known`: with a covariance there, or
        where its sightings place it, as the map has the others at a guess.
        """
        log, table = self._log, self._log.partial
        if table is None:
            return known, []
        self._settled.update(known.ids[np.isfinite(known.cov).all(axis=(1, 2))].tolist())
        self._settled.update(log.ids[: log.sighting_first[step + 1]].tolist())
        ids = table.ids[: table.first[step + 1]]
        for landmark in np.unique(ids[ids != UNKNOWN]).tolist():
            if landmark in self._settled:
                continue
            mine = np.flatnonzero(ids == landmark)
            if len(mine) >= MORE * self._count.get(landmark, 0):
                self._count[landmark] = len(mine)
                sure, self._places[landmark] = self._lines(table, mine[thinned(len(mine))])
                if sure and landmark in known.ids:
                    self._settled.add(landmark)
        still = {landmark: xy for landmark, xy in self._places.items() if landmark not in self._settled}
        shown = ~np.isin(known.ids, list(still))
        if not shown.all():
            known = Landmarks(known.ids[shown], known.xy[shown], known.cov[shown])
        return known, [xy for xy in still.values() if len(xy)]

    def _lines(self, table: PartialTable, rows: Ints) -> tuple[bool, Array]:
        """Tells if these sightings place their landmark, and where it may be; nothing of a single one."""
        if len(rows) < 2:
            return False, np.zeros((0, 2))
        step, kind, z, var = table.step[rows], table.kind[rows], table.z[rows], table.var[rows]
        poses, ranges = self._path[step], kind == RANGE
        if self._constant is not None:
            true = np.maximum(z - self._constant.range_offset[0], 0) / (1 + self._constant.range_scale[0])
            z = np.where(ranges, true, z)
        drift = wandered(self._path, self._log.delta_cov, step)
        place = placed(poses, kind, z, var, drift)
        own = np.einsum("iaia->ia", drift.reshape(len(rows), 3, len(rows), 3))
        var = var + np.where(ranges, own[:, :2].mean(axis=1), own[:, 2])
        points = self._points(poses, kind, z, var)
        losses = _losses(points, poses, kind, z, var)
        minima = np.array(places(poses, kind, z, var)).reshape(-1, 2)  # points may pass by precise ones
        at_minima = _losses(minima, poses, kind, z, var)
        likely = min(losses.min(), at_minima.min(initial=np.inf)) + LIKELY
        kept = losses.min(axis=1) <= likely
        line = np.where(kept[:, None], points[np.arange(len(points)), losses.argmin(axis=1)], np.nan)
        dots = [xy for xy in minima[at_minima <= likely] if not kept.any() or _apart(xy, line[kept], poses[-1])]
        if ranges.any():
            line = np.concatenate((line, line[:1]))  # a ring is closed
        pieces = [*_pieces(line), *(piece for xy in dots for piece in _pieces(xy[None]))]
        return place is not None and place.sure, np.concatenate(pieces)

    def _points(self, poses: Array, kind: Ints, z: Array, var: Array) -> Array:
        """Points (m, 13, 2) around the ring of the last range, else along the ray of the last bearing, and beside."""
        if (kind == RANGE).any():
            last = np.flatnonzero(kind == RANGE)[-1]
            turn = np.tile(2 * np.pi * np.arange(AROUND)[:, None] / AROUND, len(BESIDE))
            r = np.tile(np.maximum(z[last] + BESIDE * np.sqrt(var[last]), 0), (AROUND, 1))
        else:
            last = len(z) - 1
            r = np.tile(np.geomspace(NEAREST, 1, ALONG)[:, None] * self._far, len(BESIDE))
            turn = np.tile(poses[last, 2] + z[last] + BESIDE * np.sqrt(var[last]), (ALONG, 1))
        return poses[last, :2] + np.stack((r * np.cos(turn), r * np.sin(turn)), axis=-1)


def _losses(points: Array, poses: Array, kind: Ints, z: Array, var: Array) -> Array:
    """Twice the robust loss of places (..., 2), as in `backends.starting._placing`."""
    away = points[..., None, :] - poses[:, :2]
    bearing = np.arctan2(away[..., 1], away[..., 0]) - poses[:, 2]
    off = np.where(kind == RANGE, np.hypot(away[..., 0], away[..., 1]) - z, wrap(bearing - z))
    return (SCALE**2 * np.log1p(off**2 / (var * SCALE**2))).sum(axis=-1)


def _apart(xy: Array, line: Array, pose: Array) -> bool:
    """True if a place (2,) is on no point of a line (k, 2)."""
    return all(are_apart(xy, one, pose) for one in line)


def _pieces(line: Array) -> Iterator[Array]:
    """Yields the pieces of a line, each with a gap behind it; a single point twice, so that it is a dot."""
    there = np.isfinite(line[:, 0])
    for piece in np.split(np.arange(len(line)), np.flatnonzero(np.diff(there)) + 1):
        if there[piece[0]]:
            xy = line[piece] if len(piece) > 1 else line[[piece[0], piece[0]]]
            yield np.concatenate((xy, np.full((1, 2), np.nan)))
