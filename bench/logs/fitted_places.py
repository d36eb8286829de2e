"""Places of landmarks by the ranges and bearings alone that are measured of them from the true path.

A scale and an offset of ranges that the log states as unknown are fitted together with them: of each landmark's ranges
that part is left which no other place explains, and all landmarks' parts together tell both (variable projection, Golub
and Pereyra 1973), by Gauss-Newton with Cauchy weights.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...backends.starting.late_places import thinned
from ...backends.starting.placing import placed
from ...core.factors import UNKNOWN, Map, Truth
from ...core.partial import RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.errors import rows_of, sighted_from
from ..measure.landmark_places import LEAST
from ..measure.stated_noise import typical
from ..systematic.ranges import CAUCHY, NAMES

ROUNDS, STARTS = 20, (-2.0, 2.0)
"""Of Gauss-Newton, and where it begins beside 0, in stated standard deviations: as long as ranges are off, a landmark
may be on the wrong side of the path, and the best fit counts."""

NEAREST = 1e-3
"""m, and of a landmark's directions: what is nearer, or more alike, tells no place."""


def fitted_places(table: PartialTable, t: Array, truth: Truth, stated: Mapping[str, float]) -> Map:
    """The landmarks' likeliest places, fitted with the scale and the offset of ranges that have a `stated` sd.

    `t` (p,), s, are the times of the rows.
    """
    starts, free = [np.zeros(2)], list(stated)
    starts += [far * sd * np.array([name == one for one in NAMES]) for name, sd in stated.items() for far in STARTS]
    pose = rows_of(truth.t, t)
    moving = np.zeros(0, np.int64) if truth.moving is None else truth.moving
    row = np.flatnonzero((pose >= 0) & (table.ids != UNKNOWN) & ~np.isin(table.ids, moving))
    poses, found = truth.poses[pose[row]], list[tuple[float, Map]]()
    for constant in starts:
        scale, offset = constant
        is_range = table.kind[row] == RANGE
        z = np.where(is_range, np.maximum((table.z[row] - offset) / (1 + scale), NEAREST), table.z[row])
        places = _placed(table.ids[row], table.kind[row], z, table.var[row], poses)
        some = np.flatnonzero(is_range & np.isin(table.ids[row], places.ids))
        if not free or len(some) <= 2 * len(places.ids) + len(free):
            return places
        of = rows_of(places.ids, table.ids[row[some]])
        xy, left = _refined(poses[some], table.z[row[some]], of, places.xy, constant, free)
        found.append((left, places._replace(xy=xy)))
    return min(found, key=lambda one: one[0])[1]


def _placed(ids: Ints, kind: Ints, z: Array, var: Array, poses: Array) -> Map:
    """The places by columns (k,) of ranges and bearings from `poses` (k, 3), each landmark by itself."""
    found = dict[int, Array]()
    for landmark in np.unique(ids).tolist():
        rows = np.flatnonzero(ids == landmark)
        if len(rows) < LEAST:
            continue
        some = rows[thinned(len(rows))]
        place = placed(poses[some], kind[some], z[some], var[some])
        if place is not None:
            found[landmark] = place.xy
    return Map(np.array(list(found), np.int64), np.array(list(found.values()), np.float64).reshape(-1, 2), None)


def _refined(poses: Array, z: Array, of: Ints, xy: Array, constant: Array, free: Sequence[str]) -> tuple[Array, float]:
    """Places (m, 2), fitted with scale and offset to ranges z (k,) of landmarks `of` (k,) from `poses` (k, 3).

    They begin at `xy` (m, 2) and `constant` (2,). The second is the typical error that is left, m.
    """
    xy, constant = xy.copy(), constant.copy()
    at = [NAMES.index(name) for name in free]
    groups = [np.flatnonzero(of == one) for one in range(len(xy))]
    for _ in range(ROUNDS):
        d = np.maximum(sighted_from(poses, xy[of])[:, 0], NEAREST)
        e = z - (1 + constant[0]) * d - constant[1]
        root = np.sqrt(1 / (1 + (e / (CAUCHY * max(typical(e), NEAREST))) ** 2))
        by_place = ((1 + constant[0]) * root / d)[:, None] * (xy[of] - poses[:, :2])
        by_constant = root[:, None] * np.column_stack((d, np.ones_like(d)))[:, at]
        e = root * e
        left = np.column_stack((by_constant, e))
        for group in groups:
            U, s, _ = np.linalg.svd(by_place[group], full_matrices=False)
            told = U[:, s > NEAREST * s.max(initial=0.0)]
            left[group] -= told @ (told.T @ left[group])
        change = np.linalg.lstsq(left[:, :-1], left[:, -1], rcond=None)[0]
        constant[at] += change
        e = e - by_constant @ change
        for k, group in enumerate(groups):
            xy[k] += np.linalg.lstsq(by_place[group], e[group], rcond=NEAREST)[0]
    d = sighted_from(poses, xy[of])[:, 0]
    return xy, typical(z - (1 + constant[0]) * d - constant[1])
