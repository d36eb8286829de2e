"""The motion between two camera frames, from wheel counters or other odometry."""

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
    """Readings in order of time, which give the motion between any two times among them as one factor."""

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings, strictly increasing."""
        ...

    def check(self) -> None:
        """Raises InputError for unusable readings."""
        ...

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion from `start` to `end`, s, both within the readings' time."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The source's entry in a log's notes."""
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
    max_speed: float = MAX_SPEED  # m/s; a faster wheel is a misreading
    source: str = "encoder"  # name of the readings in messages

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings."""
        return self.ticks.t

    def check(self) -> None:
        """Raises InputError for no readings, times that do not increase, and counts that jump."""
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
    """Noise of external odometry: white noise along the way, so that it composes."""

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
    """Poses integrated by a robot's own odometry, as in ROS's nav_msgs/Odometry.

    Its noise is set here and grows with distance and turns: the covariance in such messages is of the sum since the
    start, if it is more than a constant.
    """

    t: Array  # (m,) s
    poses: Array  # (m, 3) in the odometry's own world frame
    noise: TrackNoise
    max_speed: float = MAX_SPEED  # m/s; a faster robot is a misreading
    source: str = "odometry"  # name of the readings in messages

    def check(self) -> None:
        """Raises InputError for no readings, times that do not increase, and poses that jump."""
        _in_order(self.t, self.source)
        _check_poses(self.t, self.poses, self.max_speed, self.source)

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion between `start` and `end`, s, as one factor; interpolated evenly between readings."""
        first, last = np.searchsorted(self.t, start, "right"), np.searchsorted(self.t, end, "left")
        t = np.concatenate(([start], self.t[first:last], [end]))
        around = slice(max(first - 1, 0), last + 1)  # the readings that enclose `start` and `end`
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
    """Unmeasured motion: the robot is assumed to stand, with growing uncertainty.

    A random walk, white in velocity: the covariance does not depend on the frame rate.
    """

    position: float  # m per root second, along both body axes
    turning: float  # rad per root second
    floors: Floors = field(default_factory=Floors)

    @property
    def t(self) -> Array:
        """(2,) all of time."""
        return np.array([-np.inf, np.inf])

    def check(self) -> None:
        """Does nothing: no readings can be wrong."""

    def odometry(self, start: float, end: float) -> Odometry:
        """No motion from `start` to `end`, s."""
        growth = np.array([self.position, self.position, self.turning]) ** 2 * (end - start)
        return Odometry(np.zeros(3), np.diag(growth) + self.floors.cov)

    @property
    def settings(self) -> dict[str, Any]:
        """The growth."""
        return {"drift": asdict(self)}


def readings(ticks: Ticks, start: float, end: float) -> tuple[Array, Array]:
    """The count increments (n, 2) from `start` to `end`, s, and their durations, (n,) s.

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
    """Raises InputError for the first pose that is not finite, or reached faster than `max_speed`."""
    for row, column in np.argwhere(~np.isfinite(poses)):
        found = f"{('x', 'y', 'heading')[column]} is {poses[row, column]!s}"
        raise InputError(f"{source}: in reading {row}, at {t[row]} s, {found}, expected a finite number.")
    if len(t) < 2:
        return
    dt, way = np.diff(t), hypot(*np.diff(poses[:, :2], axis=0).T)
    # A stream's messages come in bursts: allow the time of a typical reading more.
    for row in np.flatnonzero(way > max_speed * (dt + np.median(dt))):
        raise InputError(
            f"{source}: between readings {row} and {row + 1}, at {t[row]} and {t[row + 1]} s, the pose goes "
            f"{way[row]:.4g} m in {dt[row]:.4g} s, expected at most max_speed = {max_speed:g} "
            "m/s: an odometry reset, or a wrong reading."
        )
