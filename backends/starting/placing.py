"""The late start of landmarks that one sighting does not place: the same choice behind every backend."""

from typing import NamedTuple

import numpy as np

from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ._placing import STARTS, best, minima

CLEAR = 13.8
"""Twice the loss by which the place must be better than any elsewhere: odds of a thousand to one."""

SPREAD = 0.15
"""Most that a place may be off, one standard deviation, in its distances from the poses that saw it.

Beyond, the errors of a linearised range or bearing are no longer small.
"""


FLAT = 0.1
"""Most that a ring may bend away from its tangent within one standard deviation of a place, in those of a range.

At the distance r that is spread² / 2 r. A linear correction takes it for an error of the range, of all ranges of a
landmark alike. Of 0.03, 0.1, 0.25 and any, 20 simulated drives each with ranges to 0.05, 0.2 and 0.5 m, on a circle of
3 m, have the least error of an EKF with 0.1, by up to 4 %.
"""

APART = 0.1
"""Least distance of one place from another, in that from the last pose."""

FLATTEST = 1e-9
"""Least determinant of a minimum's information, in its squared trace: between two mirrored places there is none."""


class Place(NamedTuple):
    """The place of a landmark from its partial sightings."""

    xy: Array  # (2,) m
    cov: Array  # (2, 2), of the sightings' noise alone
    clear: float  # twice the loss by which it is better than any other place
    sure: bool  # False while there may be another place, or it is not precise enough to linearise at


def placed(poses: Array, kind: Ints, z: Array, var: Array) -> Place | None:
    """Places a landmark by k sightings, each of a range or a bearing: poses (k, 3), z (k,) and variances (k,).

    None where they determine no place at all.
    """
    xy, cov = np.empty(2), np.empty((2, 2))
    found, clear = best(poses, kind, z, var, xy, cov)
    if not found:
        return None
    near = np.hypot(*(poses[:, :2] - xy).T).min()
    spread = np.sqrt(np.linalg.eigvalsh(cov)[-1])
    most = min(SPREAD * near, np.sqrt(2 * near * FLAT * _least_sd(kind, var)))
    return Place(xy, cov, float(clear), bool(clear > CLEAR and spread < most))


def _least_sd(kind: Ints, var: Array) -> float:
    """The least standard deviation of a range, m; infinite without one."""
    return float(np.sqrt(var[kind == RANGE].min(initial=np.inf)))


def places(poses: Array, kind: Ints, z: Array, var: Array) -> list[Array]:
    """The places (2,) that k sightings leave open, likeliest first: minima of their robust loss that are `APART`."""
    points, losses, J = np.empty((2 * STARTS, 2)), np.empty(2 * STARTS), np.empty((2 * STARTS, 5))
    n = minima(poses, kind, z, var, points, losses, J)
    curved = J[:n, 0] * J[:n, 2] - J[:n, 1] ** 2 > FLATTEST * (J[:n, 0] + J[:n, 2]) ** 2
    found = list[Array]()
    for k in np.argsort(losses[:n], kind="stable"):
        if curved[k] and all(are_apart(points[k], one, poses[-1]) for one in found):
            found.append(points[k].copy())
    return found


def are_apart(a: Array, b: Array, pose: Array) -> bool:
    """Tells if two places (2,) are different ones, seen from a pose (3,)."""
    return bool(np.hypot(*(a - b)) > APART * np.hypot(*(a - pose[:2])))
