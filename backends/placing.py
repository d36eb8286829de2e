"""The late start of landmarks that one sighting does not place: the same choice behind every backend."""

from typing import NamedTuple

import numpy as np

from ..core.se2 import Array, Ints
from ._placing import best

CLEAR = 13.8
"""Twice the loss by which the place must be better than any elsewhere: odds of a thousand to one."""

SPREAD = 0.15
"""Most that a place may be off, one standard deviation, in its distances from the poses that saw it.

Beyond, the errors of a linearised range or bearing are no longer small.
"""


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
