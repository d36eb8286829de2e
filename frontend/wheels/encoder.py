"""Wheel encoders as odometry.

A robot that rolls s metres while it turns by a (rad) moves, in its body frame before the motion, by

    (c cos(a/2), c sin(a/2), a)

where the chord c is s itself in the midpoint model of ArUco EKF SLAM, eq. (1), and s sin(a/2) / (a/2) on the exact arc:
the arc of the Matlab report, eq. (3-1) - whose x has the wrong sign for headings counted counter-clockwise - and of the
survey's v / omega model, written without a special case for driving straight.

The readings between two keyframes become one factor. Its covariance is that of the readings, propagated to first order
through all motions that follow, plus the floors, once: the models' own covariance has rank 2 and is zero at rest.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...core.elementary import sinc, sincos
from ...core.factors import Odometry
from ...core.se2 import Array, wrap
from ...core.small_matrices import product, propagated

Curve = Literal["midpoint", "arc"]


@dataclass(frozen=True)
class Floors:
    """Standard deviations whose squares are added to the diagonal of every composed factor's covariance."""

    position: float = 5e-4  # m, along both body axes
    heading: float = 5e-4  # rad

    @property
    def cov(self) -> Array:
        """(3, 3) the diagonal covariance of the floors."""
        return np.diag([self.position**2, self.position**2, self.heading**2])


@dataclass(frozen=True)
class Encoder:
    """A differential drive's two wheel counters and their noise.

    `noise` determines the meaning of `k`:

    - "proportional": eq. (1), a reading of d metres has standard deviation k |d|. The noise over a metre then depends
      on the number of readings, so k belongs to readings `interval` seconds apart; a reading over another time dt has
      variance (k d)^2 interval / dt, the sum of readings at the stated interval. With `interval` None every reading
      has k |d|, exactly as stated.
    - "distance": a wheel that rolled d metres has variance k^2 |d| (1 m), however many readings that took.
    """

    left: float  # m per count
    right: float  # m per count
    base: float  # m between the wheels
    k: float
    noise: Literal["proportional", "distance"] = "proportional"
    interval: float | None = None  # s
    curve: Curve = "midpoint"
    floors: Floors = Floors()

    def travel(self, counts: Array) -> Array:
        """Converts (..., 2) counts of the left and right wheel to metres."""
        return counts * np.array([self.left, self.right])

    def variance(self, rolled: Array, dt: Array) -> Array:
        """(n, 2) variance, in m^2, of readings (n, 2) of `rolled` metres that took `dt` (n,) seconds."""
        if self.noise == "distance":
            return self.k**2 * np.abs(rolled)
        readings = np.ones_like(dt) if self.interval is None else dt / self.interval
        return (self.k * rolled) ** 2 / readings[:, None]

    def odometry(self, counts: Array, dt: Array) -> Odometry:
        """One factor from n consecutive readings: count increments (n, 2), left and right, over `dt` (n,) seconds."""
        rolled = self.travel(counts)
        to_rolling = np.array([[0.5, 0.5], [-1 / self.base, 1 / self.base]])
        delta, by_rolling = roll(product(rolled, to_rolling.T), self.curve)
        by_wheels = product(by_rolling, to_rolling)
        cov = product(by_wheels * self.variance(rolled, dt)[:, None, :], by_wheels.swapaxes(1, 2))
        return compose(delta, cov, self.floors)


def roll(rolling: Array, curve: Curve) -> tuple[Array, Array]:
    """The motions (n, 3) from `rolling` (n, 2), distance (m) and turn (rad), and d motion / d rolling, (n, 3, 2).

    ArUco EKF SLAM, eqs (1) and (4) at heading zero; the turn is not wrapped.
    """
    s, half = rolling[:, 0], rolling[:, 1] / 2
    sn, c = sincos(half)
    ratio, slope = (np.ones_like(half), np.zeros_like(half)) if curve == "midpoint" else _sinc(half)
    delta = np.stack((s * ratio * c, s * ratio * sn, rolling[:, 1]), axis=-1)
    jacobian = np.zeros((len(rolling), 3, 2))
    jacobian[:, 0, 0] = ratio * c
    jacobian[:, 1, 0] = ratio * sn
    jacobian[:, 0, 1] = s / 2 * (slope * c - ratio * sn)
    jacobian[:, 1, 1] = s / 2 * (slope * sn + ratio * c)
    jacobian[:, 2, 1] = 1.0
    return delta, jacobian


def compose(delta: Array, cov: Array, floors: Floors) -> Odometry:
    """Composes n >= 1 motions, (..., n, 3) with covariances (..., n, 3, 3), into one factor; the floors are added once.

    Equals pairwise composition to first order. Each motion's error is propagated to the end at once: rotated by its
    heading, and its turn acts on the whole remaining path.
    """
    heading = np.cumsum(delta[..., 2], axis=-1)
    s, c = sincos(heading - delta[..., 2])
    x = np.cumsum(c * delta[..., 0] - s * delta[..., 1], axis=-1)
    y = np.cumsum(s * delta[..., 0] + c * delta[..., 1], axis=-1)
    to_end = np.zeros((*delta.shape, 3))
    to_end[..., 0, 0] = to_end[..., 1, 1] = c
    to_end[..., 0, 1] = -s
    to_end[..., 1, 0] = s
    to_end[..., 0, 2] = y - y[..., -1:]
    to_end[..., 1, 2] = x[..., -1:] - x
    to_end[..., 2, 2] = 1.0
    total = propagated(to_end, cov).sum(axis=-3) + floors.cov
    motion = np.stack((x[..., -1], y[..., -1], wrap(heading[..., -1])), axis=-1)
    return Odometry(motion, (total + total.swapaxes(-1, -2)) / 2)


def _sinc(half: Array) -> tuple[Array, Array]:
    """sin(x) / x and its derivative; by a series where the quotient would cancel, exact there to rounding."""
    small = np.abs(half) < 1e-2
    x = np.where(small, 1.0, half)
    s, c = sincos(x)
    slope = np.where(small, half * (-1 / 3 + half**2 * (1 / 30 - half**2 / 840)), (c - s / x) / x)
    return sinc(half), slope
