"""Headings by a magnetometer: the horizontal part of the Earth's field, on the robot's own axes.

Iron on the robot adds a field that turns with it, so that readings lie on a circle around that field and not around
zero: where the robot has turned far enough, the circle is fitted and its middle taken off. Iron in the building changes
the field's size from place to place: such readings are left out. What is left, of a field that has a new direction but
not a new size, is the stated standard deviation, and a constant offset that may be a state.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, wrap
from ..inertial.imu import Imu
from ..inertial.levels import Levels
from ..inertial.tilts import leaned
from .measured import Measured, headings

EARTH = 5e-6, 4.5e-5
"""T, of the horizontal field anywhere but near the poles."""

ROUND = np.deg2rad(120)  # the widest gap between directions of readings that lie around a circle
THIN = 0.15  # share of the radius, root mean square, that readings on a circle are off it
FAR, NEAR, AGAIN = 3.0, 0.02, 8
"""Medians of the distances from a circle beyond which readings do not count when it is fitted again, the share of its
radius up to which they do, and how often that is done."""

IRON = 0.05  # share of the radius, from which on its middle is a remark
VARYING = 0.2  # share by which the horizontal field of a reading may differ from the usual one
MOST = 0.5  # share of readings that may be left out


@dataclass(frozen=True)
class Compass:
    """Numbers that nobody can read from a magnetometer."""

    declination: float = 0.0  # rad, by which magnetic north is east of north
    sd: float = 0.1  # rad, of a heading
    offset_sd: float = 0.0  # rad, of a constant error
    every: float = 1.0  # s at least between two headings: errors of nearer ones are alike


class _Circle(NamedTuple):
    middle: Array  # (2,) T
    radius: float  # T
    off: float  # T, root mean square


def directions(imu: Imu, compass: Compass, levels: Levels | None, remarks: list[str]) -> Measured | None:
    """The headings that a magnetometer tells; None, with a remark, for none."""
    assert imu.mag is not None
    rows = np.flatnonzero(np.isfinite(imu.mag).all(axis=1))
    field, where = imu.mag[rows], f"{imu.source}: the magnetometer"
    if len(rows) < 2:
        remarks.append(f"{where} has {len(rows)} readings, expected at least 2: its headings are not in the log")
        return None
    if not np.ptp(field, axis=0).any():
        remarks.append(
            f"{where} repeats one reading, {field[0].tolist()} T, at all {len(rows)} times, expected a field that "
            "turns with the robot: its headings are not in the log"
        )
        return None
    if levels is not None:
        field = np.einsum("nij,nj->ni", leaned(levels.pitch[rows], levels.roll[rows]), field)
    flat = _without_iron(where, field[:, :2], remarks)
    size = np.hypot(*flat.T)
    usual = float(np.median(size))
    if not EARTH[0] <= usual <= EARTH[1]:
        remarks.append(
            f"{where} measures {usual:.3g} T across (median), expected {EARTH[0]:g} to {EARTH[1]:g} T of the Earth's "
            "field: perhaps there is iron on the robot, or the unit is another; its headings are not in the log"
        )
        return None
    odd = np.abs(size / usual - 1) > VARYING
    if odd.mean() > MOST:
        remarks.append(
            f"{where}'s field varies from {size.min():.3g} to {size.max():.3g} T across, by more than "
            f"{100 * VARYING:g} % in {100 * odd.mean():.0f} % of the readings, expected that of the Earth alone: it is "
            "near iron or motors, and its headings are not in the log"
        )
        return None
    if odd.any():
        remarks.append(
            f"{where}'s field differs by more than {100 * VARYING:g} % from the usual {usual:.3g} T across in "
            f"{int(odd.sum())} of {len(odd)} readings, the first at {imu.t[rows][odd][0]:.10g} s: near iron, which are "
            "left out"
        )
    t, flat = imu.t[rows][~odd], flat[~odd]
    kept = _apart(t, compass.every)
    north = np.arctan2(flat[kept, 1], flat[kept, 0])
    return headings(t[kept], wrap(np.pi / 2 - compass.declination - north), compass.sd)


def _apart(t: Array, every: float) -> list[int]:
    """The rows of `t` (n,) at least `every` s after the one before."""
    kept = [0]
    for row in range(1, len(t)):
        if t[row] - t[kept[-1]] >= every * (1 - 1e-9):
            kept.append(row)
    return kept


def _without_iron(where: str, flat: Array, remarks: list[str]) -> Array:
    """The horizontal field (n, 2) without that of iron on the robot, where the readings show it."""
    circle = _circle(flat)
    for _ in range(AGAIN):  # without the readings far from it, which iron in the building moves
        if circle is not None:
            off = np.abs(np.hypot(*(flat - circle.middle).T) - circle.radius)
            circle = _circle(flat[off <= max(FAR * float(np.median(off)), NEAR * circle.radius)])
    if circle is None or circle.off > THIN * circle.radius:
        return flat
    around = np.sort(np.arctan2(*(flat - circle.middle).T[::-1]))
    gap = float(np.diff(np.append(around, around[0] + 2 * np.pi)).max())
    if gap > ROUND:
        return flat
    share = float(np.hypot(*circle.middle)) / circle.radius
    if share > IRON:
        remarks.append(
            f"{where}'s readings lie on a circle around {circle.middle[0]:.3g}, {circle.middle[1]:.3g} T, "
            f"{100 * share:.0f} % of its radius from zero: a field of iron on the robot, which is taken off"
        )
    return flat - circle.middle


def _circle(flat: Array) -> _Circle | None:
    """The circle nearest to points (n, 2), by linear least squares; None where they are of one line."""
    scale = float(np.abs(flat).max())
    if len(flat) < 3 or scale == 0:
        return None
    points = flat / scale
    A = np.column_stack((2 * points, np.ones(len(points))))
    found, _, rank, _ = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)
    if rank < 3:
        return None
    radius = float(np.sqrt(max(found[2] + found[0] ** 2 + found[1] ** 2, 0.0)))
    off = np.hypot(*(points - found[:2]).T) - radius
    return _Circle(scale * found[:2], scale * radius, scale * float(np.sqrt((off**2).mean())))
