"""Poses along fixes of GPS, which has no heading: it is the course of the fixes, and stays while the robot stands."""

import numpy as np
from numpy.typing import NDArray

from ..core.elementary import arctan2, hypot
from ..core.se2 import Array, Ints, wrap

GAP = 0.5  # s; there are no poses in longer gaps between fixes, which usually are at most 0.2 s apart

COURSE, LEAST_WAY = 1.1, 1.0
"""s before and after a fix that its course is taken over, five fixes each, and the least way in m for that."""


def courses(fixes: Array, t: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (n, 3) at the times `t` (n,) along `fixes` (m, 3) of t, x, y; and a mask (n,) of those in no gap."""
    at, x, y = fixes.T
    moving, course = _courses(fixes)
    heading = np.interp(t, at[moving], np.unwrap(course)) if len(course) else np.zeros(len(t))
    poses = np.stack((np.interp(t, at, x), np.interp(t, at, y), wrap(heading)), axis=-1)
    after = np.clip(np.searchsorted(at, t), 1, max(len(at) - 1, 1))
    near = np.diff(at, append=np.inf)[after - 1] <= GAP
    return poses, (at[0] <= t) & (t <= at[-1]) & (near | np.isin(t, at))


def _courses(fixes: Array) -> tuple[Ints, Array]:
    """The fixes (m,) at which the robot moves, as rows, and its courses (m,) there."""
    at, x, y = fixes.T
    first, last = np.searchsorted(at, at - COURSE), np.searchsorted(at, at + COURSE, side="right") - 1
    dx, dy = x[last] - x[first], y[last] - y[first]
    unbroken = np.concatenate(([0], np.cumsum(np.diff(at) > GAP)))
    moving = np.flatnonzero((hypot(dx, dy) > LEAST_WAY) & (unbroken[first] == unbroken[last]))
    return moving, arctan2(dy[moving], dx[moving])
