"""What tells how a robot moved between two camera frames: wheel counters, or odometry that something else computed."""

from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..elementary import hypot
from ..errors import InputError
from ..factors import Odometry
from ..se2 import Array, between
from .counters import MAX_SPEED, check_counts
from .encoder import Encoder, Floors, compose


class Motion(Protocol):
    """Readings in the order of time, from which the motion between any two moments among them is one factor."""

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings, strictly increasing."""
        ...

    def check(self) -> None:
        """InputError for readings that cannot be used."""
        ...

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion from `start` to `end`, s, both within the readings' time."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """What a log's notes say of it."""
        ...


class Ticks(NamedTuple):
    """The readings of a differential drive's counters."""

    t: Array  # (m,) s, strictly increasing
    counts: Array  # (m, 2) left and right, cumulative


@dataclass(frozen=True, eq=False)
class Wheels:
    """A differential drive's counters."""

    ticks: Ticks
    encoder: Encoder
    max_speed: float = MAX_SPEED  # m/s; a wheel that rolled faster between two readings did not
    source: str = "encoder"  # where the readings are from, for what is said of them

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings."""
        return self.ticks.t

    def check(self) -> None:
        """InputError without a reading, for one that is not later than the one before, and for counts that jump."""
        _in_order(self.t, self.source)
        metres = np.array([self.encoder.left, self.encoder.right])
        check_counts(self.t, self.ticks.counts, metres, self.max_speed, self.source)

    def odometry(self, start: float, end: float) -> Odometry:
        """The counts between `start` and `end`, s, as one factor."""
        return self.encoder.odometry(*readings(self.ticks, start, end))

    @property
    def settings(self) -> dict[str, Any]:
        """The encoder."""
        return {"encoder": {name: value for name, value in asdict(self.encoder).items() if value is not None}}


@dataclass(frozen=True)
class TrackNoise:
    """How far somebody else's odometry is trusted: white noise along the way, which composes."""

    forward: float = 0.01  # m per root metre driven
    turning: float = 0.02  # rad per root metre driven
    turning_by_turn: float = 0.02  # rad per root radian turned
    floors: Floors = field(default_factory=Floors)

    def cov(self, delta: Array) -> Array:
        """(n, 3, 3) covariances of the motions `delta` (n, 3)."""
        way, turn = hypot(delta[:, 0], delta[:, 1]), np.abs(delta[:, 2])
        heading = self.turning**2 * way + self.turning_by_turn**2 * turn
        return np.stack((self.forward**2 * way, np.zeros_like(way), heading), axis=-1)[:, :, None] * np.eye(3)


@dataclass(frozen=True, eq=False)
class Track:
    """Poses that a robot's own odometry has summed up, as in ROS's nav_msgs/Odometry.

    Its noise is stated here and grows with the way and the turns: the covariance in such messages is of the sum since
    the start, where it is more than a constant.
    """

    t: Array  # (m,) s
    poses: Array  # (m, 3) in the odometry's own world frame
    noise: TrackNoise
    max_speed: float = MAX_SPEED  # m/s; a robot that went faster between two readings did not
    source: str = "odometry"  # where the readings are from, for what is said of them

    def check(self) -> None:
        """InputError without a reading, for one that is not later than the one before, and for poses that jump."""
        _in_order(self.t, self.source)
        _check_poses(self.t, self.poses, self.max_speed, self.source)

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion between `start` and `end`, s, as one factor; between two readings it is taken to be even."""
        first, last = np.searchsorted(self.t, start, "right"), np.searchsorted(self.t, end, "left")
        t = np.concatenate(([start], self.t[first:last], [end]))
        around = slice(max(first - 1, 0), last + 1)  # the readings that `start` and `end` lie between are enough
        columns = (*self.poses[around, :2].T, np.unwrap(self.poses[around, 2]))
        poses = np.stack([np.interp(t, self.t[around], column) for column in columns], axis=-1)
        delta = between(poses[:-1], poses[1:])
        return compose(delta, self.noise.cov(delta), self.noise.floors)

    @property
    def settings(self) -> dict[str, Any]:
        """The noise."""
        return {"odometry": asdict(self.noise)}


@dataclass(frozen=True)
class Drift:
    """Motion that nobody measured: the robot is taken to stand, and less and less sure of it.

    A random walk, white in velocity: a factor's covariance does not depend on how often frames are taken.
    """

    position: float  # m per root second, along both body axes
    turning: float  # rad per root second
    floors: Floors = field(default_factory=Floors)

    @property
    def t(self) -> Array:
        """(2,) all of time."""
        return np.array([-np.inf, np.inf])

    def check(self) -> None:
        """There is nothing that could be wrong."""

    def odometry(self, start: float, end: float) -> Odometry:
        """No motion from `start` to `end`, s."""
        growth = np.array([self.position, self.position, self.turning]) ** 2 * (end - start)
        return Odometry(np.zeros(3), np.diag(growth) + self.floors.cov)

    @property
    def settings(self) -> dict[str, Any]:
        """The growth."""
        return {"drift": asdict(self)}


def readings(ticks: Ticks, start: float, end: float) -> tuple[Array, Array]:
    """The count increments (n, 2) from `start` to `end`, s, and how long each took, (n,) s.

    A reading that `start` or `end` falls into is divided as if the wheels had turned evenly meanwhile.
    """
    inside = slice(np.searchsorted(ticks.t, start, "right"), np.searchsorted(ticks.t, end, "left"))
    t = np.concatenate(([start], ticks.t[inside], [end]))
    wheels = [np.interp(t, ticks.t, ticks.counts[:, wheel]) for wheel in (0, 1)]
    return np.diff(np.stack(wheels, axis=-1), axis=0), np.diff(t)


def _in_order(t: Array, source: str) -> None:
    if len(t) == 0:
        raise InputError(f"{source}: found no readings, expected at least one")
    late = np.flatnonzero(~(np.diff(t) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"{source}: reading {row} is at {t[row]} s, expected later than {t[row - 1]} s")


def _check_poses(t: Array, poses: Array, max_speed: float, source: str) -> None:
    """InputError for the first pose that is not finite, or farther from the one before than `max_speed` allows."""
    for row, column in np.argwhere(~np.isfinite(poses)):
        found = f"{('x', 'y', 'heading')[column]} is {poses[row, column]!s}"
        raise InputError(f"{source}: in reading {row}, at {t[row]} s, {found}, expected a finite number.")
    if len(t) < 2:
        return
    dt, way = np.diff(t), hypot(*np.diff(poses[:, :2], axis=0).T)
    # The messages of a stream come in bursts: the time of a typical reading is given on top.
    for row in np.flatnonzero(way > max_speed * (dt + np.median(dt))):
        raise InputError(
            f"{source}: between readings {row} and {row + 1}, at {t[row]} and {t[row + 1]} s, the pose goes "
            f"{way[row]:.4g} m in {dt[row]:.4g} s, expected at most max_speed = {max_speed:g} "
            "m/s: odometry that was set back, or a wrong reading."
        )
