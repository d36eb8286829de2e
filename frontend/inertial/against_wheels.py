"""A gyro's turns beside those of the robot's odometry: in time, of one sign and unit, but not of the same readings.

What clearly contradicts the odometry is in no log, unless a ground truth agrees with the gyro: of three that tell turns
the one that disagrees with the other two is wrong.
"""

from dataclasses import replace
from typing import TypeGuard

import numpy as np

from ...core.se2 import Array
from ..wheels.track import Poses
from .agreement import FEW, MOST, PIECE, TURNS, Agreement, agreement
from .imu import Imu
from .turns import integrated

ALIKE = 0.7, 1.4  # the gyro's turn for one of the wheels that wheels of a wrong size or slip explain
DEGREES = 180 / np.pi
ODOMETRY, TRUTH = "odometry", "ground truth"
SAME_TIME = 0.2  # s, up to which two delays are one
EXACT = 0.05  # share by which the turns' factor may differ from that of a unit which is said to be another

SAME = 0.2
"""Of the gyro's white noise, by which the odometry's turns differ from its own: wheels cannot know it that well."""


def against_wheels(imu: Imu, odometry: Poses, *, said: str | None, truth: Poses | None = None) -> Imu:
    """The readings with remarks, and a doubt, where their turns are not those of the odometry.

    A gyro in degrees/s is converted, unless a unit was `said`, rad/s or deg/s. The ground truth, if there is one, tells
    if the odometry is wrong, and is compared where the odometry does not tell turns.
    """
    wheels = agreement(imu, odometry)
    right = None if truth is None else agreement(imu, truth)
    found, by = (right, TRUTH) if _tells(right) and (not _tells(wheels) or _wrong(wheels)) else (wheels, ODOMETRY)
    if found is None:
        return imu
    low, high = ALIKE
    if found.slope is not None and not said and low < found.slope / DEGREES < high:
        words = (
            f"{imu.source}: the gyro turns {found.slope:.3g} rad for each that the {by} turns, expected 1: taken to be "
            f"in degrees/s, and converted; {imu.unit_by} says"
        )
        converted = replace(imu, gyro=imu.gyro / DEGREES, remarks=[*imu.remarks, words])
        return against_wheels(converted, odometry, said="found", truth=truth)
    imu = replace(imu, delay=found.delay, clock=by if found.delay is not None else "", late=found.late)
    if _wrong(found):
        words = _words(imu, found, by, said)
        if by == TRUTH and _tells(wheels) and _alike(found, wheels):
            words += ", which the odometry's turns say, too"
        doubt = f"the gyro's turns are not those of the {by}"
        return replace(imu, doubt=doubt, turns=False, remarks=[*imu.remarks, f"{words}; its turns are not in the log"])
    if by == TRUTH and _tells(wheels) and _wrong(wheels):
        words = _words(imu, wheels, ODOMETRY, said)
        words += ". But it turns as the ground truth does: the odometry is wrong, and the gyro's turns are in the log"
        return replace(imu, remarks=[*imu.remarks, words])
    return imu


def _tells(found: Agreement | None) -> TypeGuard[Agreement]:
    """True if a path's turns say that they are the gyro's, or that they are not."""
    return found is not None and (found.slope is not None or found.other)


def _wrong(found: Agreement) -> bool:
    low, high = ALIKE
    return found.late or found.other or not (found.slope is None or low < found.slope < high)


def _alike(found: Agreement, other: Agreement) -> bool:
    """True if two paths tell the same delay of the gyro."""
    return (
        found.late
        and other.late
        and found.delay is not None
        and other.delay is not None
        and abs(found.delay.seconds - other.delay.seconds) < SAME_TIME
    )


def _words(imu: Imu, found: Agreement, by: str, said: str | None) -> str:
    """Says what is wrong with the gyro beside a path."""
    low, high = ALIKE
    if found.other or found.slope is None:
        return (
            f"{imu.source}: the gyro does not turn as the {by} does, at no delay of up to {MOST:g} s: it is typically "
            f"off by {100 * found.off:.0f} % of a turn: perhaps it is of another drive, or its axes are others"
        )
    slope, beside = found.slope, ""
    if found.late and found.delay is not None:
        late = found.delay
        beside = (
            f"by the turns of the {by} the gyro is {abs(late.seconds):.3f} ± {late.sd:.3f} s {late.word}: "
            f"{imu.with_delay(late.seconds)} takes that off{'' if by == TRUTH else ', if the odometry is in time'}"
        )
    if low < slope < high:
        return f"{imu.source}: {beside}"
    words = f"{imu.source}: the gyro turns {slope:.3g} rad for each that the {by} turns, expected 1"
    if low < -slope < high:
        words += f": its axes are turned, as upside down, or the {by} turns clockwise"
    elif said == "rad/s" and abs(slope / DEGREES - 1) < EXACT:
        words += f": perhaps it is in deg/s, and not in rad/s as {imu.unit_by} says"
    elif said == "deg/s" and abs(slope * DEGREES - 1) < EXACT:
        words += f": perhaps it is in rad/s, and not in deg/s as {imu.unit_by} says, or the {by} is in degrees"
    elif low < slope * DEGREES < high:
        words += f": perhaps the {by}'s headings are in degrees"
    else:
        words += f": perhaps its unit is another, or the {by} turns by another factor"
    return f"{words}; and {beside}" if beside else words


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
