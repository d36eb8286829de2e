"""Faults of odometry that no stated noise covers, as robots have them: repeated readings, late headings, stuck wheels.

They are made on what both wheels have rolled, so that counters and integrated poses have the same faults.
"""

from dataclasses import dataclass, fields

import numpy as np

from ..core.options import option
from ..core.se2 import Array, between, compose

TRACK = 0.5
"""m between the wheels of a robot whose odometry is known as poses only."""

MINUTE = 60.0
"""s."""

ODD_WHEEL = 1.0
"""s for which a wheel is stuck or spins."""

TOO_MUCH = 0.6
"""m/s that a spinning wheel reads beyond what it rolls."""

STILL = 1e-4
"""s between the stamps of readings while the clock stands still."""


@dataclass(frozen=True)
class WheelFaults:
    """Faults of a robot's odometry, by default none; a simulated world's options inherit it."""

    stalls: float = option(
        0.0, "times a minute that the wheels' readings repeat, and then catch up at once", minimum=0.0, maximum=30.0
    )
    stall_time: float = option(0.8, "for how long they repeat, s", minimum=0.01, maximum=30.0, beside="stalls")
    late_heading: float = option(
        0.0, "how late the odometry's heading is behind its position, s", minimum=0.0, maximum=5.0
    )
    stuck: float = option(
        0.0, "times a minute that a wheel's counter reads nothing for a second", minimum=0.0, maximum=30.0
    )
    spins: float = option(
        0.0, "times a minute that a wheel spins for a second, 0.6 m/s too fast", minimum=0.0, maximum=30.0
    )
    clock_stalls: float = option(
        0.0, "times a minute that the odometry's clock stands still for a second", minimum=0.0, maximum=30.0
    )

    @property
    def has_wheel_faults(self) -> bool:
        """Tells if there is any."""
        return any(getattr(self, field.name) != field.default for field in fields(WheelFaults))


def faulty_wheels(rolled: Array, t: Array, faults: WheelFaults, rng: np.random.Generator) -> Array:
    """The way of the left and the right wheel by the readings, (n, 2) m, at `t` (n,) s, from the true sums.

    Each kind of fault draws from a generator of its own.
    """
    stalls, stuck, spins = rng.spawn(3)
    rolled = rolled.copy()
    if faults.late_heading:
        late = t - faults.late_heading
        turned = np.interp(late, t, (rolled[:, 1] - rolled[:, 0]) / 2)
        way = rolled.sum(axis=1) / 2
        rolled = np.stack((way - turned, way + turned), axis=-1)
    for rate, kind, draws in ((faults.stuck, "stuck", stuck), (faults.spins, "spins", spins)):
        for start in _moments(t, rate, draws):
            wheel = int(draws.integers(2))
            inside = (t[1:] > start) & (t[1:] <= start + ODD_WHEEL)
            read = np.diff(rolled[:, wheel])
            read[inside] = 0.0 if kind == "stuck" else read[inside] + TOO_MUCH * np.diff(t)[inside]
            rolled[1:, wheel] = rolled[0, wheel] + np.cumsum(read)
    for start in _moments(t, faults.stalls, stalls):
        first, last = np.searchsorted(t, (start, start + faults.stall_time))
        rolled[first:last] = rolled[max(first - 1, 0)]
    return rolled


def faulty_poses(poses: Array, t: Array, faults: WheelFaults, rng: np.random.Generator) -> Array:
    """Odometry's poses (n, 3) at `t` (n,) s, with the faults of a robot that is TRACK wide."""
    if not faults.has_wheel_faults:
        return poses
    motion = between(poses[:-1], poses[1:])
    turned = TRACK / 2 * motion[:, 2]
    rolled = np.zeros((len(poses), 2))
    rolled[1:] = np.cumsum(np.stack((motion[:, 0] - turned, motion[:, 0] + turned), axis=-1), axis=0)
    read = np.diff(faulty_wheels(rolled, t, faults, rng), axis=0)
    stands = (read == 0).all(axis=1)
    motion = np.stack(
        (read.sum(axis=1) / 2, np.where(stands, 0.0, motion[:, 1]), (read[:, 1] - read[:, 0]) / TRACK), -1
    )
    out = [poses[0]]
    for one in motion:
        out.append(out[-1] if not one.any() else compose(out[-1], one))
    return np.array(out)


def faulty_clock(t: Array, faults: WheelFaults, rng: np.random.Generator) -> Array:
    """The stamps (n,), s, of readings at `t` (n,) by a clock that stands still now and then, and catches up."""
    stamps = t.copy()
    for start in _moments(t, faults.clock_stalls, rng):
        first, last = np.searchsorted(t, (start, start + ODD_WHEEL))
        first = max(int(first), 1)
        stamps[first:last] = t[first - 1] + STILL * np.arange(1, max(last - first, 0) + 1)
    return stamps


def _moments(t: Array, rate: float, rng: np.random.Generator) -> list[float]:
    """Times of a Poisson process, `rate` a minute."""
    seconds = float(t[-1] - t[0])
    return sorted((t[0] + rng.uniform(0, seconds, rng.poisson(rate * seconds / MINUTE))).tolist())
