"""The readings of an inertial measurement unit in the robot's frame, and which of them can be relied on."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from .delay import Delay

GRAVITY = 9.80665  # m/s^2

LEAST_GAP, MANY = 0.2, 5.0
"""s, and medians of the time between readings, beyond both of which readings are missing: at 1 rad/s a turn is then not
known to a degree any more, and no jitter explains it."""


SELDOM = 10.0
"""Hz, below which a turn between two readings is mostly a guess, and the rocking of a body is not followed."""


@dataclass(frozen=True, eq=False)
class Imu:
    """Readings in the robot's frame, x forward, y left, z up, all at the times of the gyro's."""

    t: Array  # (n,) s, strictly increasing
    gyro: Array  # (n, 3) rad/s
    accel: Array | None = None  # (n, 3) m/s^2, the specific force: 9.81 upwards where the robot stands; None: unknown
    mag: Array | None = None  # (n, 3) T; NaN in rows without a reading of the magnetometer
    clipped: NDArray[np.bool_] | None = None  # (n,) the gyro was at the end of its range; None: never
    shaken: NDArray[np.bool_] | None = None  # (n,) the accelerometer was; None: never
    arm: Array = field(default_factory=lambda: np.zeros(3))  # (3,) m, the place on the robot
    mounting: str = ""  # what says how it is mounted, in a sentence
    placed: bool = True  # something says so; False: where it looks is a guess
    source: str = "imu"  # name of the readings in messages
    times_by: str = "[imu] time_offset in robot.toml"  # moves its times
    unit_by: str = "[imu] gyro in robot.toml"  # says the gyro's unit, or can
    doubt: str = ""  # what contradicts the gyro, so that nothing is levelled by it, in words; empty: nothing does
    turns: bool = True  # False: they are clearly not those of the robot, and in no log
    offset: float = 0.0  # s, that was added to its times
    offset_by: str = "[imu] time_offset = {offset:.3f} in robot.toml"  # says another, or its negative, {delay:.3f}
    delay: Delay | None = None  # of its stamps, as its turns tell it; None: they do not
    clock: str = ""  # beside whose turns they do
    late: bool = False  # that delay is no accident
    remarks: Sequence[str] = ()  # what is legal yet odd, each without its full stop

    def __len__(self) -> int:
        return len(self.t)

    def with_delay(self, seconds: float) -> str:
        """Words for what takes a delay off its times, beside what was taken off them already."""
        offset = self.offset - seconds
        return self.offset_by.format(offset=offset, delay=-offset)

    @cached_property
    def usual(self) -> float:
        """s, the median time between readings."""
        return float(np.median(np.diff(self.t)))

    @property
    def rate(self) -> float:
        """Hz, of the median time between readings."""
        return 1 / self.usual

    @property
    def seldom(self) -> bool:
        """True below `SELDOM`, to a tenth of a Hz: stamps are rounded."""
        return round(self.rate, 1) < SELDOM

    @cached_property
    def missing(self) -> NDArray[np.bool_]:
        """(n - 1,) between which consecutive readings others are missing."""
        return np.diff(self.t) > max(LEAST_GAP, MANY * self.usual)

    @property
    def gaps(self) -> Array:
        """(k, 2) s, the times between which readings are missing."""
        rows = np.flatnonzero(self.missing)
        return np.column_stack((self.t[rows], self.t[rows + 1]))

    @cached_property
    def sound(self) -> NDArray[np.bool_]:
        """(n - 1,) between which consecutive readings the turn is known: no gap, and neither at the range's end."""
        clipped = np.zeros(len(self), np.bool_) if self.clipped is None else self.clipped
        return ~(self.missing | clipped[1:] | clipped[:-1])

    @cached_property
    def noise(self) -> float:
        """rad^2/s, white noise of the yaw gyro by its fourth differences, in which a turn has hardly a part.

        Those of white noise of variance s^2 have 70 s^2. The median takes no account of single jolts.
        """
        differences = np.diff(self.gyro[:, 2], n=4)
        if not len(differences):
            return 0.0
        sd = float(np.median(np.abs(differences))) / 0.6745 / np.sqrt(70)
        return sd**2 * self.usual


def spanned(t: Array) -> str:
    """Words from when to when the times `t` (n,), s, are."""
    return f"{t[0]:.10g} to {t[-1]:.10g} s"
