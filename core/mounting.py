"""Sightings of a sensor that does not sit at the body's origin, or whose clock is late, as the body's own."""

from typing import NamedTuple

import numpy as np

from .elementary import arctan2, hypot, sincos
from .se2 import Array, Ints, act, act_jacobians, between, compose, inverse, summed

NEAREST = 1e-6
"""m, of a landmark from the body's origin: it has no bearing there."""


class Mounting(NamedTuple):
    """The place of a sensor in the body's frame, and how late its clock is."""

    x: float = 0.0  # m, ahead of the origin
    y: float = 0.0  # m, to the left of it
    yaw: float = 0.0  # rad, counter-clockwise
    delay: float = 0.0  # s, by which its times are later than the odometry's

    @property
    def place(self) -> Array:
        """(3,) its pose in the body's frame."""
        return np.array([self.x, self.y, self.yaw])


NONE = Mounting()


def from_body(z: Array, cov: Array, at: Array) -> tuple[Array, Array]:
    """Sightings z (s, 2) with covariances (s, 2, 2) from sensors at poses `at`, (3,) or (s, 3), as from the body.

    Covariances are propagated to first order. A landmark at the body's origin is put NEAREST away.
    """
    at = np.broadcast_to(at, (len(z), 3))
    s, c = sincos(z[:, 1])
    point = act(at, np.stack((z[:, 0] * c, z[:, 0] * s), axis=-1))
    r = np.maximum(hypot(point[:, 0], point[:, 1]), NEAREST)
    by_point = act_jacobians(at, point)[1]
    by_z = np.stack((c, -z[:, 0] * s, s, z[:, 0] * c), axis=-1).reshape(-1, 2, 2)
    x, y = point[:, 0], point[:, 1]
    by_xy = np.stack((x / r, y / r, -y / r**2, x / r**2), axis=-1).reshape(-1, 2, 2)
    J = by_xy @ by_point @ by_z
    found = J @ cov @ J.swapaxes(1, 2)
    return np.stack((r, arctan2(y, x)), axis=-1), (found + found.swapaxes(1, 2)) / 2


def mounted(mounting: Mounting, t: Array, delta: Array, step: Ints, z: Array, cov: Array) -> tuple[Array, Array]:
    """Sightings of a sensor so mounted, as the body sees them at the times t (n,) of its steps.

    Sighting i is taken `delay` s before step[i] (s,); how far the body drives after it, the motions (n, 3) tell, of
    which the first is ignored. Before the first step it stands.
    """
    at = mounting.place
    if mounting.delay:
        at = compose(before(t, delta, mounting.delay)[step], at)
    return from_body(z, cov, at)


def before(t: Array, delta: Array, seconds: float) -> Array:
    """(n, 3) poses of the body `seconds` before each step, in its frame at the step, by its motions (n, 3).

    Between steps its speed changes as from one to the next, without swinging over (Fritsch and Butland, SIAM Journal on
    Scientific and Statistical Computing 5(2), 1984): with an even one, pictures five a second, 50 ms late, are 1 mm off
    where the robot sets off. Before the first step it stands, and after the last one.
    """
    from scipy.interpolate import PchipInterpolator  # a tenth of a second

    if len(t) < 2:
        return np.zeros((len(t), 3))
    path = summed(np.zeros(3), delta[1:])
    path[:, 2] = np.concatenate(([0.0], np.cumsum(delta[1:, 2])))
    then = PchipInterpolator(t, path)(np.clip(t - seconds, t[0], t[-1]))
    return between(path, np.asarray(then, np.float64))


def seen_from(mounting: Mounting, z: Array) -> Array:
    """Sightings z (s, 2) of the body as a sensor at that place has them; the inverse of `from_body`."""
    s, c = sincos(z[:, 1])
    at = np.broadcast_to(inverse(mounting.place), (len(z), 3))
    point = act(at, np.stack((z[:, 0] * c, z[:, 0] * s), axis=-1))
    return np.stack((hypot(point[:, 0], point[:, 1]), arctan2(point[:, 1], point[:, 0])), axis=-1)
