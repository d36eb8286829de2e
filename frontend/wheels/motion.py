"""The motion between two camera frames, from wheel counters or other odometry."""

from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import Odometry
from ...core.se2 import Array, Ints, between
from .counters import MAX_SPEED, WHEELS, check_counts
from .encoder import Encoder, Floors, compose
from .holes import Holes, find_holes
from .units import odd_units

ROWS = 100_000  # readings that are composed at once


class Motion(Protocol):
    """Readings in order of time, which give the motion between any two times among them as one factor."""

    @property
    def t(self) -> Array:
        """(m,) s, the times of the readings, strictly increasing."""
        ...

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        ...

    def check(self) -> None:
        """Raises InputError for unusable readings."""
        ...

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion from `start` to `end`, s, both within the readings' time."""
        ...

    def remarks(self, start: float, end: float) -> list[str]:
        """Says what is legal yet odd in the readings from `start` to `end`, s, each without its full stop."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The source's entry in a log's notes."""
        ...


class Ticks(NamedTuple):
    """The readings of a differential drive's counters."""

    t: Array  # (m,) s, strictly increasing
    counts: Array  # (m, 2) left and right, cumulative
    own: tuple[Ints, Ints] | None = None  # rows in which left and right were read, the others interpolated; None: all

    @property
    def pairs(self) -> Ints:
        """The first row, and those at which both wheels have been read since the one before."""
        if self.own is None:
            return np.arange(len(self.t))
        left, right = (np.isin(np.arange(len(self.t)), rows) for rows in self.own)
        found, seen = [0], [False, False]
        for row, read in enumerate(zip(left[1:].tolist(), right[1:].tolist(), strict=True), start=1):
            seen = [before or now for before, now in zip(seen, read, strict=True)]
            if all(seen):
                found.append(row)
                seen = [False, False]
        return np.array(found)


class Poses(NamedTuple):
    """Odometry integrated by the robot itself."""

    t: Array  # (m,) s, strictly increasing
    poses: Array  # (m, 3) in the odometry's own world frame


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

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        return "encoder readings"

    def check(self) -> None:
        """Raises InputError for no readings, times that do not increase, counts that jump, and too long a hole."""
        _in_order(self.t, self.source)
        metres = np.array([self.encoder.left, self.encoder.right])
        wheels = [slice(None)] if self.ticks.own is None else [slice(0, 1), slice(1, 2)]
        for wheel, rows in zip(wheels, self.ticks.own or (slice(None),), strict=True):
            counts = self.ticks.counts[rows, wheel]
            check_counts(self.t[rows], counts, metres[wheel], self.max_speed, self.source, WHEELS[wheel])
        self.holes.check(self.source)

    @cached_property
    def holes(self) -> Holes:
        """The times without readings. The counters then tell how far the wheels rolled and turned, but not where to."""
        return find_holes(self.t[self._pairs], lambda rows: self._moved(self._pairs[rows]))

    @cached_property
    def _pairs(self) -> Ints:
        return self.ticks.pairs

    @cached_property
    def stated(self) -> Encoder:
        """The encoder; noise of each reading is that at the usual time between two where wheels are read apart."""
        if self.ticks.own is None or self.encoder.interval is not None or len(self._pairs) < 2:
            return self.encoder
        return replace(self.encoder, interval=float(np.median(np.diff(self.t[self._pairs]))))

    def _moved(self, rows: Ints) -> tuple[Array, Array]:
        left, right = self.encoder.travel(np.diff(self.ticks.counts[rows], axis=0)).T
        return (np.abs(left) + np.abs(right)) / 2, (right - left) / self.encoder.base

    def odometry(self, start: float, end: float) -> Odometry:
        """The counts between `start` and `end`, s, as one factor."""
        found = self.stated.odometry(*readings(self.ticks, start, end))
        if not len(self.holes.start):
            return found
        unknown = self.holes.noise(start, end, position=False, heading=True)
        return found._replace(cov=found.cov + np.diag(unknown))

    def remarks(self, start: float, end: float) -> list[str]:
        """Says where readings are missing between `start` and `end`, s."""
        return self.holes.remarks(self.source, start, end)

    @property
    def settings(self) -> dict[str, Any]:
        """The encoder."""
        return {"encoder": {name: value for name, value in asdict(self.stated).items() if value is not None}}


@dataclass(frozen=True)
class TrackNoise:
    """Noise of external odometry: white noise along the way, so that it composes."""

    forward: float = 0.01  # m per root metre driven
    turning: float = 0.02  # rad per root metre driven
    turning_by_turn: float = 0.02  # rad per root radian turned
    floors: Floors = field(default_factory=Floors)

    def cov(self, delta: Array) -> Array:
        """(..., 3, 3) covariances of the motions `delta` (..., 3)."""
        way, turn = hypot(delta[..., 0], delta[..., 1]), np.abs(delta[..., 2])
        heading = self.turning**2 * way + self.turning_by_turn**2 * turn
        return np.stack((self.forward**2 * way, np.zeros_like(way), heading), axis=-1)[..., None] * np.eye(3)


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
    bridged: bool = True  # the sum goes on in a hole; else, what was not read is lost

    @property
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        return "odometry"

    def check(self) -> None:
        """Raises InputError for no readings, times that do not increase, poses that jump, and too long a hole."""
        _in_order(self.t, self.source)
        _check_poses(self.t, self.poses, self.max_speed, self.source)
        self.holes.check(self.source)

    @cached_property
    def holes(self) -> Holes:
        """The times without readings."""
        return find_holes(self.t, self._moved)

    def _moved(self, rows: Ints) -> tuple[Array, Array]:
        heading = np.unwrap(self.poses[:, 2])[rows]
        return hypot(*np.diff(self.poses[rows, :2], axis=0).T), np.diff(heading)

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion between `start` and `end`, s, as one factor; interpolated evenly between readings."""
        found = self.motions(np.array([start, end]))
        return Odometry(found.delta[0], found.cov[0])

    def motions(self, at: Array) -> Odometry:
        """The motions between consecutive times `at` (n,), s, as columns: (n - 1, 3) and (n - 1, 3, 3)."""
        first, last = np.searchsorted(self.t, at[:-1], "right"), np.searchsorted(self.t, at[1:], "left")
        delta, cov = np.empty((len(first), 3)), np.empty((len(first), 3, 3))
        inside = np.maximum(last - first, 0)
        for count in np.unique(inside):
            rows = np.flatnonzero(inside == count)
            for some in np.array_split(rows, len(rows) * (count + 1) // ROWS + 1):
                moved = self._between(at[some], at[some + 1], first[some], int(count))
                delta[some], cov[some] = compose(moved, self.noise.cov(moved), self.noise.floors)
        for row in np.flatnonzero(self.holes.between(at)):
            cov[row] += np.diag(self._unknown(at[row], at[row + 1]))
        return Odometry(delta, cov)

    def _between(self, start: Array, end: Array, first: Ints, count: int) -> Array:
        """(m, count + 1, 3) the motions from `start` to `end` (m,) over the `count` readings from `first` (m,) on."""
        before, after = np.maximum(first - 1, 0), np.minimum(first + count, len(self.t) - 1)
        rows = np.column_stack((before, first[:, None] + np.arange(count), after))
        heading = np.unwrap(self.poses[rows, 2], axis=1)
        columns = np.stack((self.poses[rows, 0], self.poses[rows, 1], heading), axis=-1)
        poses = columns.copy()
        poses[:, 0] = _at(start, self.t[before], self.t[rows[:, 1]], columns[:, 0], columns[:, 1])
        poses[:, -1] = _at(end, self.t[rows[:, -2]], self.t[after], columns[:, -2], columns[:, -1])
        return between(poses[:, :-1], poses[:, 1:])

    def _unknown(self, start: float, end: float) -> Array:
        """(3,) variances of what holes leave unknown: where the way through them led, and its own noise."""
        unknown = self.holes.noise(start, end, position=self.bridged, heading=self.bridged)
        inside = np.maximum(np.minimum(self.holes.end, end) - np.maximum(self.holes.start, start), 0.0)
        way, turn = (self.holes.speed * inside).sum(), (self.holes.turning * inside).sum()
        forward, _, heading = np.diag(self.noise.cov(np.array([[way, 0.0, turn]]))[0])
        return unknown + np.array([forward, 0.0, heading]) + np.array([1.0, 1.0, 0.0]) * heading * way**2 / 3

    def remarks(self, start: float, end: float) -> list[str]:
        """Says where readings are missing between `start` and `end`, s, and what may be in other units."""
        return [*self.holes.remarks(self.source, start, end), *odd_units(self.source, self.t, self.poses)]

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
    def readings(self) -> str:
        """The name of the readings in a sentence."""
        return "odometry"

    @property
    def t(self) -> Array:
        """(2,) all of time."""
        return np.array([-np.inf, np.inf])

    def check(self) -> None:
        """Does nothing: no readings can be wrong."""

    def remarks(self, start: float, end: float) -> list[str]:
        """Says nothing: there are no readings."""
        del start, end
        return []

    def odometry(self, start: float, end: float) -> Odometry:
        """Stands still from `start` to `end`, s."""
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


def _at(t: Array, before: Array, after: Array, low: Array, high: Array) -> Array:
    """(m, 3) the columns `low` at `before` and `high` at `after`, interpolated to `t` (m,); the bits of np.interp."""
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = (high - low) / (after - before)[:, None]
        found = slope * (t - before)[:, None] + low
    found = np.where((t >= after)[:, None], high, found)
    return np.where((t <= before)[:, None], low, found)


def _in_order(t: Array, source: str) -> None:
    if len(t) == 0:
        raise InputError(f"{source}: found no readings, expected at least one.")
    late = np.flatnonzero(~(np.diff(t) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"{source}: reading {row} is at {t[row]} s, expected later than {t[row - 1]} s.")


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
