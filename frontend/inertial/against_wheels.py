"""A gyro's turns beside those of the robot's odometry: of the same sign and unit, but not of the same readings."""

from dataclasses import replace

import numpy as np

from ...core.se2 import Array
from ..wheels.track import Poses
from .imu import Imu
from .turns import integrated

PIECE = 1.0  # s, of which the turns are compared
FEW, TURNS = 10, 0.01  # pieces, and rad by which their turns have to differ, to tell anything
AGREE = 0.7  # correlation from which on both are of one drive
ALIKE = 0.7, 1.4  # the gyro's turn for one of the wheels that wheels of a wrong size or slip explain
DEGREES = 180 / np.pi
EXACT = 0.05  # share by which the turns' factor may differ from that of a unit which is said to be another

EVENLY, MOST_BIAS = 0.1, 0.15
"""rad in a piece: turns of the wheels from which on a drive that always turns alike tells, and the most by a bias."""

SAME = 0.2
"""Of the gyro's white noise, by which the odometry's turns differ from its own: wheels cannot know it that well."""


def against_wheels(imu: Imu, odometry: Poses, *, said: str | None) -> Imu:
    """The readings with remarks, and a doubt, where their turns are not those of the odometry.

    A gyro in degrees/s is converted, unless a unit was `said`, rad/s or deg/s.
    """
    gyro, wheels = _turns(imu, odometry)
    if len(gyro) < FEW:
        return imu
    slope = _slope(gyro, wheels)
    if slope is None:
        return imu
    low, high = ALIKE
    found = f"{imu.source}: the gyro turns {slope:.3g} rad for each that the odometry turns, expected 1"
    if low < slope < high:
        return imu
    if low < slope / DEGREES < high and not said:
        found += f": taken to be in degrees/s, and converted; {imu.unit_by} says"
        return replace(imu, gyro=imu.gyro / DEGREES, remarks=[*imu.remarks, found])
    turns = True
    if low < -slope < high:
        found += ": its axes are turned, as upside down, or the odometry turns clockwise"
    elif said == "rad/s" and abs(slope / DEGREES - 1) < EXACT:
        found += f": perhaps it is in deg/s, and not in rad/s as {imu.unit_by} says"
        turns = False
    elif said == "deg/s" and abs(slope * DEGREES - 1) < EXACT:
        found += f": perhaps it is in rad/s, and not in deg/s as {imu.unit_by} says, or the odometry is in degrees"
        turns = False
    elif low < slope * DEGREES < high:
        found += ": perhaps the odometry's headings are in degrees"
    else:
        found += ": perhaps its unit is another"
    if not turns:
        found += "; its turns are not in the log"
    doubt = "the gyro's turns are not those of the odometry"
    return replace(imu, doubt=doubt, turns=turns, remarks=[*imu.remarks, found])


def _slope(gyro: Array, wheels: Array) -> float | None:
    """The turns (n,) of the gyro for each of the wheels; None where they cannot be compared.

    Of a robot that always turns alike, their means tell, where no bias explains how they differ.
    """
    off = wheels - wheels.mean()
    if wheels.std() < TURNS:
        differ = abs(float(gyro.mean() - wheels.mean())) > MOST_BIAS
        return float(gyro.mean() / wheels.mean()) if abs(wheels.mean()) > EVENLY and differ else None
    if gyro.std() == 0 or abs(float(np.corrcoef(gyro, wheels)[0, 1])) < AGREE:
        return None
    return float(gyro @ off / (off @ off))


def in_odometry(imu: Imu, odometry: Poses) -> bool:
    """True if the odometry's turns are made of this gyro's readings, so that both would count these."""
    gyro, wheels = _turns(imu, odometry)
    if len(gyro) < FEW or wheels.std() < TURNS:
        return False
    return float((gyro - wheels).std()) < SAME * np.sqrt(imu.noise * PIECE)


def _turns(imu: Imu, odometry: Poses) -> tuple[Array, Array]:
    """(n,) rad, the turns of pieces of the drive by the gyro, and by the odometry."""
    begin, end = max(imu.t[0], odometry.t[0]), min(imu.t[-1], odometry.t[-1])
    at = np.arange(begin, end, PIECE)
    gyro = np.diff(integrated(imu.t, imu.gyro[:, 2], at))
    return gyro, np.diff(np.interp(at, odometry.t, np.unwrap(odometry.poses[:, 2])))
