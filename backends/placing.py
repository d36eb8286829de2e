"""The late start of landmarks that one sighting does not place: the same choice behind every backend."""

from typing import NamedTuple

import numpy as np

from ..core.se2 import Array, Ints
from ._placing import STARTS, best, fit, starts

CLEAR = 13.8
"""Twice the loss by which the place must be better than any elsewhere: odds of a thousand to one."""

SPREAD = 0.15
"""Most that a place may be off, one standard deviation, in its distances from the poses that saw it.

Beyond, the errors of a linearised range or bearing are no longer small.
"""


APART = 0.1
"""Least distance of one place from another, in that from the last pose."""


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
    return Place(xy, cov, float(clear), bool(clear > CLEAR and spread < SPREAD * near))


def places(poses: Array, kind: Ints, z: Array, var: Array) -> list[Array]:
    """The places (2,) that k sightings leave open, likeliest first: minima of their robust loss that are `APART`."""
    points, J = np.empty((2 * STARTS, 2)), np.empty(5)
    points = points[: starts(poses, kind, z, points)]
    losses = np.array([fit(poses, kind, z, var, at, J) for at in points])
    found = list[Array]()
    for k in np.argsort(losses, kind="stable"):
        if np.isfinite(losses[k]) and all(are_apart(points[k], one, poses[-1]) for one in found):
            found.append(points[k].copy())
    return found


def are_apart(a: Array, b: Array, pose: Array) -> bool:
    """Tells if two places (2,) are different ones, seen from a pose (3,)."""
    return bool(np.hypot(*(a - b)) > APART * np.hypot(*(a - pose[:2])))
