"""A GPS receiver and a magnetometer on a rendered robot, for a recording: their readings by the options of fixes.

They are drawn as `fixes` draws those of a log: at steps at these times both have the same errors.
"""

from dataclasses import replace

import numpy as np

from ...core.se2 import Array, act
from ...frontend.inertial.imu import Imu
from ...frontend.inertial.tilts import leaned
from .fixes import WorldFixes
from .imu import RATE, Body, Drive

ACROSS, DOWN = 2e-5, 4e-5
"""T, of the Earth's field along the ground and into it."""


def positions_of(options: WorldFixes, drive: Drive, end: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """The times (f,), s, from 0 to `end`, and the places (f, 2), m, of the antenna; none without option gps."""
    t = _due(options.gps, end)
    arm = np.tile((options.gps_x, options.gps_y), (len(t), 1))
    positioning, _ = rng.spawn(2)
    return t, act(drive(t)[0], arm) + options.gps_sd * positioning.standard_normal((len(t), 2))


def with_magnetometer(
    imu: Imu, options: WorldFixes, drive: Drive, rng: np.random.Generator, body: Body | None = None
) -> Imu:
    """The unit with a magnetometer that tells a heading after each period of option compass; itself without.

    Fields nearby turn that of the Earth: its size stays. Between, the readings (n, 3), T, are NaN. The `body` rocks, or
    is level.
    """
    rows = np.rint(_due(options.compass, float(imu.t[-1])) * RATE).astype(np.int64)
    if not len(rows):
        return imu
    _, pointing = rng.spawn(2)
    offset = options.compass_offset * pointing.standard_normal()
    turned = offset + options.compass_sd * pointing.standard_normal(len(rows))
    north = np.pi / 2 - drive(imu.t[rows])[0][:, 2] - turned
    field = np.column_stack((ACROSS * np.cos(north), ACROSS * np.sin(north), np.full(len(rows), -DOWN)))
    if body is not None:
        field = np.einsum("nji,nj->ni", leaned(*body.at(imu.t[rows]).T), field)
    mag = np.full((len(imu.t), 3), np.nan)
    mag[rows] = field
    return replace(imu, mag=mag)


def every(options: WorldFixes) -> float:
    """The time, s, that readings of this magnetometer are apart at least: at the unit's own times."""
    return max(options.compass - 1 / RATE, options.compass / 2)


def _due(period: float, end: float) -> Array:
    """The multiples of the period, s, after 0 and up to `end`; none without a period."""
    return period * np.arange(1, int(end / period * (1 + 1e-12)) + 1, dtype=np.float64) if period else np.zeros(0)
