"""A backend's input at one step, and the measurements in it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..fixes import NO_FIXES, Fixes
from ..gyro import Bias, Gyro, Turn
from ..partial import NO_PARTIAL, Partial
from ..se2 import Array, Ints
from ..signatures import NO_SIGNATURES, Signatures


class Odometry(NamedTuple):
    """The motion since the last step, in the body frame before it."""

    delta: Array  # (3,) dx, dy (m), dtheta (rad)
    cov: Array  # (3, 3) in the coordinates of delta, positive definite


class RangeBearing(NamedTuple):
    """The k landmarks sighted at one step."""

    ids: Ints  # (k,) UNKNOWN, or a landmark's id, at most once per step
    z: Array  # (k, 2) range (m), bearing (rad)
    cov: Array  # (k, 2, 2) of (range, bearing), positive definite


class RelativePoses(NamedTuple):
    """The m loop closures found at one step: its pose relative to earlier steps."""

    to: Ints  # (m,) the earlier step
    delta: Array  # (m, 3) the pose of this step in the body frame of step `to`
    cov: Array  # (m, 3, 3) in the coordinates of delta, positive definite


class Step(NamedTuple):
    """A backend's input at one keyframe. Step 0 has no odometry: the prior is the belief there."""

    t: float  # s
    odometry: Odometry | None
    sightings: RangeBearing
    loops: RelativePoses
    partial: Partial = NO_PARTIAL
    fixes: Fixes = NO_FIXES
    signatures: Signatures = NO_SIGNATURES  # of all its whole sightings, or none
    gyro: Turn | None = None  # the turn since the step before


def turns_of(bias: Bias | None, steps: Sequence[Step]) -> Gyro | None:
    """The turns of steps; None without any."""
    rows = [(k, *s.gyro) for k, s in enumerate(steps) if s.gyro is not None]
    if not rows:
        return None
    step, turn, var, dt, walk = np.array(rows, np.float64).T
    return Gyro.from_arrays(step.astype(np.int64), turn, var, dt, walk, bias)
