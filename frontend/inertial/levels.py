"""Pitch and roll of a robot by gravity, with standard deviations that hold while it accelerates.

A filter follows the direction of gravity by the gyro and corrects it by the accelerometer, whose reading is gravity and
the robot's own acceleration. That is a state as well, of first order in time: H. J. Luinge and P. H. Veltink,
"Measuring orientation of human body segments using miniature gyroscopes and accelerometers", Medical and Biological
Engineering and Computing 43, 2005. Its size and time constant are those under which the drive's own readings are the
likeliest, so that a lively robot's levels are stated wider than a quiet one's. The filter looks at no later reading.
Where readings are missing a level becomes the less certain the longer they do, and beyond `LOST_AFTER` it begins anew.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, Ints
from ._gravity import follow_gravity
from .imu import GRAVITY, Imu
from .standing import Standing

PUSHES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)  # m/s^2, standard deviations of the acceleration that are tried
LASTING = (0.1, 0.3, 1.0, 3.0)  # s, time constants of it that are tried
USUAL = 0.3  # s, that with which the sizes are tried first

OFFSET = 0.05
"""m/s^2, of an accelerometer that was not calibrated: 0.3 degrees, which no filter finds as long as the robot drives on
one plane."""

FIRST = 1.0  # s from whose mean the direction begins
BEGIN = 0.15  # rad, standard deviation of it
BIAS, DRIFT = 0.02, 1e-4  # rad/s of a gyro whose robot never stood, and rad/s per root second
LOST = 0.5  # rad/s, by which a robot may turn where the gyro says nothing
LOST_AFTER = BEGIN / LOST  # s without readings after which a level is lost

_Run = Callable[[float, float], float]  # the log likelihood of a size and a time constant


class Levels(NamedTuple):
    """Euler angles in the order yaw, pitch, roll: a positive pitch looks down, a positive roll leans to the right."""

    roll: Array  # (n,) rad, at the readings
    pitch: Array  # (n,) rad
    roll_sd: Array  # (n,) rad
    pitch_sd: Array  # (n,) rad
    push: float  # m/s^2, standard deviation of the robot's acceleration
    lasting: float  # s, its time constant


def levels(imu: Imu, stood: Standing | None = None, speed: Array | None = None) -> Levels:
    """The levels at all readings. The bias of the gyro is that of `stood`, else one of a usual size.

    Forward speeds `speed` (n,), m/s, at the readings take the robot's own acceleration off, that of curves as well.
    InputError without an accelerometer.
    """
    if imu.accel is None:
        raise InputError(f"{imu.source}: has no accelerometer, expected one to tell pitch and roll by gravity.")
    accel = imu.accel - _of_arm(imu) if speed is None else imu.accel - _of_arm(imu) - _driven(imu, speed)
    mean = np.concatenate((imu.gyro[:1], (imu.gyro[1:] + imu.gyro[:-1]) / 2))
    turned = np.full(len(imu), imu.noise if stood is None or stood.noise is None else max(imu.noise, stood.noise))
    dt = np.diff(imu.t, prepend=imu.t[0])
    turned[1:][~imu.sound] += LOST**2 * dt[1:][~imu.sound]
    used = np.ones(len(imu)) if imu.shaken is None else (~imu.shaken).astype(float)
    bias = np.concatenate((np.zeros(3), np.full(3, BIAS)))
    if stood is not None and stood.bias is not None and stood.sd is not None:
        bias = np.concatenate((stood.bias, np.hypot(stood.sd, DRIFT * np.sqrt(abs(stood.bias_at - imu.t[0])))))
    starts = _directions(imu, accel, begins(imu))
    up, cov = np.empty((len(imu), 3)), np.empty((len(imu), 3, 3))
    noise = _white(accel)

    def run(push: float, lasting: float) -> float:
        settings = np.array([noise, push, lasting, DRIFT**2, BEGIN**2])
        return follow_gravity(dt, mean, accel, used, turned, settings, starts, bias, up, cov)

    push, _ = _likeliest(run, PUSHES, (USUAL,))
    near = [one for one in PUSHES if push / 3 < one < 3 * push]
    push, lasting = _likeliest(run, near, LASTING)
    run(push, lasting)
    x, y, z = up.T
    roll, pitch = np.arctan2(y, z), np.arcsin(np.clip(-x, -1, 1))
    across = y**2 + z**2
    by = np.stack((np.zeros_like(x), z / across, -y / across), axis=-1)
    offset = (OFFSET / GRAVITY) ** 2
    roll_sd = np.sqrt(np.einsum("ni,nij,nj->n", by, cov, by) + offset)
    pitch_sd = np.sqrt(cov[:, 0, 0] / np.maximum(across, 1e-6) + offset)
    return Levels(roll, pitch, roll_sd, pitch_sd, push, lasting)


def begins(imu: Imu) -> Ints:
    """(m,) the readings at which the filter begins: the first one, and those after a gap in which a level is lost.

    A level of which nothing is known for `LOST_AFTER` s is no better than the first one.
    """
    lost = imu.missing & (np.diff(imu.t) > LOST_AFTER)
    return np.concatenate(([0], np.flatnonzero(lost) + 1))


def _directions(imu: Imu, accel: Array, anew: Ints) -> Array:
    """(n, 3) at the readings `anew` (m,) the mean direction of `FIRST` s from there to the next of these; else zero."""
    ends = np.minimum(np.searchsorted(imu.t, imu.t[anew] + FIRST, "right"), np.append(anew[1:], len(imu)))
    mean = np.array([accel[a:b].mean(axis=0) for a, b in zip(anew.tolist(), ends.tolist(), strict=True)])
    out = np.zeros((len(imu), 3))
    out[anew] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    return out


def _likeliest(run: _Run, pushes: Sequence[float], lasting: Sequence[float]) -> tuple[float, float]:
    """The size and the time constant with which the readings are the likeliest."""
    return max(product(pushes, lasting), key=lambda pair: run(*pair))


def _white(accel: Array) -> float:
    """(m/s^2)^2, the accelerometer's white noise by its second differences, as their mean: with the wheels' shaking."""
    return max(float((np.diff(accel, n=2, axis=0) ** 2).mean()) / 6, 1e-6) if len(accel) > 2 else 1.0


def _of_arm(imu: Imu) -> Array:
    """(n, 3) m/s^2, the acceleration of the unit about the robot's origin, where the robot turns evenly."""
    return np.cross(imu.gyro, np.cross(imu.gyro, imu.arm))


def _driven(imu: Imu, speed: Array) -> Array:
    """(n, 3) m/s^2, the acceleration of a robot that drives ahead at `speed` (n,), m/s."""
    return np.column_stack((np.gradient(speed, imu.t), speed * imu.gyro[:, 2], -speed * imu.gyro[:, 1]))
