"""Noise models of a marker's range and bearing, and several measurements of one marker."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...core.factors import UNKNOWN, RangeBearing
from ...core.se2 import Array, wrap
from .aruco import Sighting, on_robot, range_bearing


class Noise(Protocol):
    """Turns sightings into measurements with their covariances."""

    @property
    def sway(self) -> float:
        """rad, the standard deviation of the body's pitch and of its roll."""
        ...

    def measure(
        self, sightings: Sequence[Sighting], mounting: Array, leaning: Array | None = None
    ) -> tuple[Array, Array]:
        """z (k, 2), range (m) and bearing (rad) in the robot's plane, and cov (k, 2, 2); `mounting`: T_robot_camera.

        Of a body that was levelled, `mounting` is T_level_camera, and `leaning` (2, 3) rad is what is unknown of that
        level, as `leant` takes it, in place of `sway`.
        """
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The model's entry in a log's notes."""
        ...


@dataclass(frozen=True)
class ProportionalNoise:
    """Standard deviations proportional to the reading: ArUco EKF SLAM, eq. (10), with floors and, added, `rocking`.

    The floors are not in the document: without them a marker straight ahead has a bearing without error.
    """

    k_range: float = 0.05  # of the range
    k_bearing: float = 0.05  # of the bearing
    floor_range: float = 0.02  # m
    floor_bearing: float = 0.01  # rad
    sway: float = 0.0  # rad, standard deviation of the body's pitch and of its roll

    def cov(self, z: Array) -> Array:
        """(k, 2, 2) covariances of the measurements `z` (k, 2) of range (m) and bearing (rad), of a level body."""
        slope = np.array([self.k_range, self.k_bearing])
        floor = np.array([self.floor_range, self.floor_bearing])
        return ((slope * z) ** 2 + floor**2)[:, :, None] * np.eye(2)

    def measure(
        self, sightings: Sequence[Sighting], mounting: Array, leaning: Array | None = None
    ) -> tuple[Array, Array]:
        """The measurements and their covariances."""
        z = range_bearing(sightings, mounting)
        return z, self.cov(z) + leaning_or_sway(leaning, self.sway, z, on_robot(sightings, mounting)[:, 2])

    @property
    def settings(self) -> dict[str, Any]:
        """The slopes, the floors and the sway."""
        return {"model": "proportional", **asdict(self)}


@dataclass(frozen=True)
class PropagatedNoise:
    """Propagates the corners' covariance to range and bearing, through the marker's pose and the camera's mounting.

    `scale` covers errors not seen in the corners, such as an inexact calibration: it multiplies standard deviations.
    The floors and `rocking` are added.
    """

    scale: float = 1.0
    floor_range: float = 0.0  # m
    floor_bearing: float = 0.0  # rad
    sway: float = 0.0  # rad, standard deviation of the body's pitch and of its roll

    def measure(
        self, sightings: Sequence[Sighting], mounting: Array, leaning: Array | None = None
    ) -> tuple[Array, Array]:
        """The measurements and their covariances."""
        z = range_bearing(sightings, mounting)
        cov = np.zeros((len(z), 2, 2))
        for k, sighting in enumerate(sightings):
            r, (c, s) = z[k, 0], (np.cos(z[k, 1]), np.sin(z[k, 1]))
            by_centre = np.array([[c, s], [-s / r, c / r]]) @ mounting[:2, :3]
            cov[k] = self.scale**2 * by_centre @ sighting.centre_cov @ by_centre.T
        cov += np.diag([self.floor_range**2, self.floor_bearing**2])
        return z, cov + leaning_or_sway(leaning, self.sway, z, on_robot(sightings, mounting)[:, 2])

    @property
    def settings(self) -> dict[str, Any]:
        """The scale, the floors and the sway."""
        return {"model": "propagated", **asdict(self)}


def leaning_or_sway(leaning: Array | None, sway: float, z: Array, height: Array) -> Array:
    """(k, 2, 2) covariances of `z` (k, 2) by what is unknown of a body's level, `leaning`, else by its `sway`."""
    return rocking(sway, z[:, 0], height) if leaning is None else leant(leaning, z, height)


def leant(leaning: Array, z: Array, height: Array) -> Array:
    """(k, 2, 2) covariances of `z` (k, 2), range (m) and bearing (rad), where the body leans by what is not known.

    The rows of `leaning` (2, 3), rad, are turns about the axes of the level robot, independent, each of one standard
    deviation. To second order they are as in `rocking`.
    """
    near, h = z[:, 0] ** 2, height[:, None]
    c, s = np.cos(z[:, 1:]), np.sin(z[:, 1:])
    x, y, about = leaning.T
    mean = float((x**2 + y**2).sum() / 2)
    high = np.sign(h) * np.sqrt(np.maximum(h**2 - mean * near[:, None], 0.0))
    by = np.stack((high * (c * y - s * x), about - high * (s * y + c * x) / z[:, :1]), axis=1)
    return by @ by.transpose(0, 2, 1) + _along_and_across(np.zeros_like(near), mean**2, near)


def rocking(sway: float, reach: Array, height: Array) -> Array:
    """(k, 2, 2) covariances of range (m) and bearing (rad) by the rocking of the body, or a floor that is not level.

    Pitch and roll, of `sway` rad each, move a point at range r = `reach` (k,) and h = `height` (k,) over the robot's
    plane, m, by sway h along and across. To second order they move it by r sway^2, with 3/4 of that squared as the
    variance along and, on average over directions, 1/2 across. The height is measured from the same body: its square
    is too large by (sway r)^2 on average, which is taken off.
    """
    a, near = sway**2, reach**2
    return _along_and_across(a * np.maximum(height**2 - a * near, 0.0), a**2, near)


def rocking_slope(sway: float, reach: Array, height: Array) -> Array:
    """(k, 2, 2) the derivative of `rocking` by the square of `sway`."""
    a, near = sway**2, reach**2
    return _along_and_across(np.where(height**2 > a * near, height**2 - 2 * a * near, 0.0), 2 * a, near)


def _along_and_across(first: Array, second: float, near: Array) -> Array:
    """(k, 2, 2) covariances from the parts of first (k,), m^2, and second order, and the squared ranges `near` (k,)."""
    return np.stack((first + 0.75 * second * near, first / near + 0.5 * second), axis=-1)[:, :, None] * np.eye(2)


class Measured(NamedTuple):
    """Measurements of one time, and the part of their covariances that is the body's, which all its cameras share."""

    sightings: RangeBearing
    rocking: Array  # (k, 2, 2)


def together(one: Measured, other: Measured) -> Measured:
    """The measurements of two cameras at one time: a marker that both see is one, as a step has an id at most once.

    It is the mean of both, weighted by the inverses of the covariances that are each camera's own. Two independent
    sightings in a row would say the same, to first order.
    """
    (ids, z, cov), (more, seen, seen_cov) = one.sightings, other.sightings
    z, cov, rocked = z.copy(), cov.copy(), one.rocking
    new = np.ones(len(more), np.bool_)
    for k in np.flatnonzero(np.isin(more, ids) & (more != UNKNOWN)):
        at, new[k] = np.flatnonzero(ids == more[k])[0], False
        own, others = cov[at] - rocked[at], seen_cov[k] - other.rocking[k]
        gain = np.linalg.solve(own + others, own).T
        away = seen[k] - z[at]
        away[1] = wrap(away[1])
        z[at] += gain @ away
        z[at, 1] = wrap(z[at, 1])
        left = own - gain @ own
        cov[at] = (left + left.T) / 2 + rocked[at]
    pairs = ((z, seen), (cov, seen_cov), (rocked, other.rocking))
    z, cov, rocked = (np.concatenate((here, there[new])) for here, there in pairs)
    return Measured(RangeBearing(np.concatenate((ids, more[new])), z, cov), rocked)
