"""What tells how a robot moved between two camera frames: wheel counters, or odometry that something else computed."""

from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from .encoder import Encoder, Floors, compose
from .errors import InputError
from .factors import Odometry
from .se2 import Array, between


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

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings."""
        return self.ticks.t

    def check(self) -> None:
        """InputError without a reading, and for one that is not later than the one before."""
        _in_order(self.t, "encoder")

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
        way, turn = np.hypot(delta[:, 0], delta[:, 1]), np.abs(delta[:, 2])
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

    def check(self) -> None:
        """InputError without a reading, and for one that is not later than the one before."""
        _in_order(self.t, "odometry")

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion between `start` and `end`, s, as one factor; between two readings it is taken to be even."""
        inside = slice(np.searchsorted(self.t, start, "right"), np.searchsorted(self.t, end, "left"))
        t = np.concatenate(([start], self.t[inside], [end]))
        columns = (*self.poses.T[:2], np.unwrap(self.poses[:, 2]))
        poses = np.stack([np.interp(t, self.t, column) for column in columns], axis=-1)
        delta = between(poses[:-1], poses[1:])
        return compose(delta, self.noise.cov(delta), self.noise.floors)

    @property
    def settings(self) -> dict[str, Any]:
        """The noise."""
        return {"odometry": asdict(self.noise)}


def readings(ticks: Ticks, start: float, end: float) -> tuple[Array, Array]:
    """The count increments (n, 2) from `start` to `end`, s, and how long each took, (n,) s.

    A reading that `start` or `end` falls into is divided as if the wheels had turned evenly meanwhile.
    """
    inside = slice(np.searchsorted(ticks.t, start, "right"), np.searchsorted(ticks.t, end, "left"))
    t = np.concatenate(([start], ticks.t[inside], [end]))
    wheels = [np.interp(t, ticks.t, ticks.counts[:, wheel]) for wheel in (0, 1)]
    return np.diff(np.stack(wheels, axis=-1), axis=0), np.diff(t)


def _in_order(t: Array, what: str) -> None:
    if len(t) == 0:
        raise InputError(f"{what}: found no readings, expected at least one")
    late = np.flatnonzero(~(np.diff(t) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"{what}: reading {row} is at {t[row]} s, expected later than {t[row - 1]} s")
