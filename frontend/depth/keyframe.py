"""A frame that is a step of the log: its features, its level and its surfaces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..elementary import arctan2, hypot
from ..se2 import Array, Ints
from ..small_matrices import propagated
from .features import Features
from .level import Level
from .settings import Settings
from .surfaces import Coarse


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame as it is kept."""

    step: int
    t: float  # s
    features: Features  # n of them
    level: Level
    coarse: Coarse
    ids: Ints  # (n,) of the features' landmarks, -1 without one; `Tracks` writes them


def sightings(frame: Keyframe, rows: Ints, settings: Settings) -> tuple[Array, Array]:
    """Ranges (m) and bearings (rad), (k, 2), of the features `rows` from the robot, and their covariances (k, 2, 2).

    The error of the level, which the features of a frame share, is part of each covariance.
    """
    points, (R, t) = frame.features.points.taken(rows), (frame.level.T[:3, :3], frame.level.T[:3, 3])
    x, y, up = (points.xyz @ R.T + t).T
    cov = propagated(R[:2], points.cov)
    by_level = np.zeros((len(rows), 2, 2))  # of x and y by turns about x and y
    by_level[:, 0, 1], by_level[:, 1, 0] = up, -up
    cov += propagated(by_level, frame.level.cov[:2, :2])
    away = hypot(x, y)
    J = np.stack((x / away, y / away, -y / away**2, x / away**2), axis=-1).reshape(-1, 2, 2)
    cov = propagated(J, cov) + np.diag([settings.floor**2, settings.turn_floor**2])
    return np.column_stack((away, arctan2(y, x))), (cov + cov.swapaxes(1, 2)) / 2


def without_ids(features: Features) -> NDArray[np.int64]:
    """(n,) the ids of features that are no landmarks yet."""
    return np.full(len(features), -1, np.int64)
