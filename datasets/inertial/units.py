"""Units of inertial readings: as a header or robot.toml says them, else as the readings show them.

Rates are rad/s, accelerations m/s^2, magnetic fields T. An accelerometer that is not shaken measures gravity, which
tells its unit. A gyro whose robot turns by more than a turn a second is in degrees.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ...frontend.inertial.imu import GRAVITY
from ..robot_limits import LIMITS

UNITS: Mapping[str, Mapping[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "gyro": {"rad/s": 1.0, "deg/s": np.pi / 180, "mdeg/s": np.pi / 180e3},
    "accelerometer": {"m/s^2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "magnetometer": {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7},
}
"""Sensor -> its units, the first of which is ours, and their sizes."""

SPELT: Mapping[str, str] = {
    "rad": "rad/s", "rads": "rad/s", "radpers": "rad/s", "rads-1": "rad/s", "radians/s": "rad/s", "radian/s": "rad/s",
    "deg": "deg/s", "dps": "deg/s", "degs": "deg/s", "degs-1": "deg/s", "degrees/s": "deg/s", "°/s": "deg/s",
    "degpers": "deg/s",     "mdps": "mdeg/s",
    "m/s2": "m/s^2", "ms2": "m/s^2", "ms-2": "m/s^2", "mps2": "m/s^2", "m/s/s": "m/s^2", "m/s²": "m/s^2",
    "gauss": "G", "tesla": "T", "µt": "uT", "μt": "uT", "ut": "uT", "microtesla": "uT", "sec": "s", "seconds": "s",
    "µs": "us", "μs": "us",
}  # fmt: skip
"""Other spellings, without blanks, underscores and carets, in lower case -> the unit."""


class Says(NamedTuple):
    """Names what can say how readings are to be taken, in remarks: each followed by "says", the times' by "moves".

    The `offset` says another, {offset} s or the delay of {delay} s.
    """

    gyro: str = "[imu] gyro in robot.toml"
    accelerometer: str = "[imu] accelerometer in robot.toml"
    magnetometer: str = "[imu] magnetometer in robot.toml"
    mounting: str = "[imu] mounting in robot.toml"
    mounted: str = "robot.toml"  # has said it
    offset: str = "[imu] time_offset = {offset:.3f} in robot.toml"
    times: str = f"[imu] time_offset in robot.toml (up to {LIMITS['imu.time_offset'][0].most:g} s)"


ROBOT_SAYS = Says()


TURN, OFTEN = 2 * np.pi, 0.99
"""rad/s, a turn a second, and the share of the time in which a robot on wheels turns less."""

NEAR, EXACT = 0.2, 0.05  # shares by which the size of gravity may differ to tell a unit, and to be no remark


def unit(sensor: str, given: str) -> str | None:
    """The unit of a sensor that is written like `given`; None for one that is unknown."""
    plain = given.replace(" ", "").replace("_", "").replace("^", "").replace("*", "")
    known = UNITS[sensor]
    for name in known:
        if given == name or plain == name.replace("^", ""):
            return name
    found = SPELT.get(plain.lower(), plain)
    return next((name for name in known if name.lower() == found.lower()), None)


def rates(where: str, gyro: Array, said: str | None, remarks: list[str], says: str = ROBOT_SAYS.gyro) -> Array:
    """`gyro` (n, 3) in rad/s; `remarks` grows where it was not said to be in degrees and is."""
    if said is not None:
        return gyro * UNITS["gyro"][said]
    often = float(np.quantile(np.linalg.norm(gyro - np.median(gyro, axis=0), axis=1), OFTEN))
    if often <= TURN:
        return gyro
    remarks.append(
        f"{where}: the gyro's rates are up to {often:.3g} (in {100 * OFTEN:.0f} % of the time), expected at most "
        f"{TURN:.3g} rad/s of a robot on wheels: taken to be in degrees/s, and converted; {says} says"
    )
    return gyro * UNITS["gyro"]["deg/s"]


def accelerations(
    where: str, accel: Array, said: str | None, remarks: list[str], says: str = ROBOT_SAYS.accelerometer
) -> Array | None:
    """`accel` (n, 3) in m/s^2; None where it is not with gravity. `remarks` grows by what is odd."""
    size = float(np.linalg.norm(np.median(accel, axis=0)))  # of what stays, and so without shaking
    units = UNITS["accelerometer"] if said is None else {said: UNITS["accelerometer"][said]}
    fits = [name for name, of in UNITS["accelerometer"].items() if abs(size * of / GRAVITY - 1) < NEAR]
    found = next((name for name in fits if name in units), None)
    if found is None:
        expected = " or ".join(f"{GRAVITY / of:.4g} in {name}" for name, of in units.items())
        removed = size * next(iter(units.values())) < NEAR * GRAVITY
        cause = "gravity was taken off" if removed else "its unit is another"
        if fits:
            cause = f"it is in {fits[0]}, and not in {said} as {says} says"
        remarks.append(
            f"{where}: the accelerometer measures {size:.4g} on average (median), expected gravity, {expected}: "
            f"perhaps {cause}; it is not used"
        )
        return None
    mean = f"{where}: the accelerometer measures {size:.4g} on average (median), expected {GRAVITY:.3g} m/s^2"
    if said is None and found != "m/s^2":
        remarks.append(f"{mean}: taken to be in {found}, and converted; {says} says")
    off = size * units[found] / GRAVITY - 1
    if abs(off) > EXACT:
        remarks.append(f"{mean}: in {found} its scale is {100 * off:+.0f} % off")
    return accel * units[found]


def fields(where: str, mag: Array, said: str | None, remarks: list[str], says: str = ROBOT_SAYS.magnetometer) -> Array:
    """`mag` (n, 3) in T; `remarks` grows where the unit was found by the size of the Earth's field."""
    if said is not None:
        return mag * UNITS["magnetometer"][said]
    size = float(np.nanmedian(np.linalg.norm(mag, axis=1)))
    near = {name: abs(np.log(size * of / 5e-5)) for name, of in UNITS["magnetometer"].items()} if size > 0 else {}
    name = min(near, key=lambda one: near[one], default="T")
    if name != "T":
        remarks.append(
            f"{where}: the magnetometer measures {size:.3g} (median size), expected some 5e-05 T of the Earth's field: "
            f"taken to be in {name}, and converted; {says} says"
        )
    return mag * UNITS["magnetometer"][name]
