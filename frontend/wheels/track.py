"""The motion between two camera frames, from poses that a robot's odometry has summed up."""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import Odometry
from ...core.se2 import Array, Ints, between
from ...core.se2 import compose as applied
from .counters import MAX_SPEED
from .diffusion import along, even, spread
from .encoder import Floors, compose
from .holes import Holes, find_holes
from .motion import in_order
from .units import odd_units

ROWS = 100_000  # readings that are composed at once

LARGEST_TURN, FINE_TURN = 0.1, 0.02
"""rad between two readings, beyond which they have poses on an arc between them, and rad between these. A straight line
is off an arc by an eighth of the turn, times its length."""


class Poses(NamedTuple):
    """Odometry integrated by the robot itself."""

    t: Array  # (m,) s, strictly increasing
    poses: Array  # (m, 3) in the odometry's own world frame


@dataclass(frozen=True)
class TrackNoise:
    """Noise of external odometry: white noise along the way, so that it composes."""

    forward: float = 0.01  # m per root metre driven
    turning: float = 0.02  # rad per root metre driven
    turning_by_turn: float = 0.02  # rad per root radian turned
    floors: Floors = field(default_factory=Floors)

    def variances(self, way: Array, turn: Array) -> tuple[Array, Array]:
        """(...,) each, of the way ahead, m^2, and of the turn, rad^2, of motions over `way`, m, and by `turn`, rad."""
        return self.forward**2 * way, self.turning**2 * way + self.turning_by_turn**2 * np.abs(turn)

    def cov(self, delta: Array) -> Array:
        """(..., 3, 3) covariances of the motions `delta` (..., 3), as arcs: the sum of those of any pieces of them."""
        return spread(delta, *self.variances(hypot(*even(delta)), delta[..., 2]))


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
        in_order(self.t, self.source)
        _check_poses(self.t, self.poses, self.max_speed, self.source)
        self.holes.check(self.source)

    @cached_property
    def holes(self) -> Holes:
        """The times without readings."""
        return find_holes(self.t, self._moved)

    @cached_property
    def _way(self) -> Poses:
        """The poses, and more of them along arcs, but in no hole."""
        if len(self.t) < 2:
            return Poses(self.t, self.poses)
        moved = between(self.poses[:-1], self.poses[1:])
        pieces = pieces_of(moved[:, 2]).astype(np.int64)
        pieces[self.holes.between(self.t)] = 1
        if (pieces == 1).all():
            return Poses(self.t, self.poses)
        row = np.repeat(np.arange(len(moved)), pieces)
        share = (np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[row]
        t = self.t[row] + share * np.diff(self.t)[row]
        poses = applied(self.poses[row], along(moved[row], share))
        poses[share == 0] = self.poses[row[share == 0]]
        return Poses(np.append(t, self.t[-1]), np.concatenate((poses, self.poses[-1:])))

    def _moved(self, rows: Ints) -> tuple[Array, Array]:
        heading = np.unwrap(self.poses[:, 2])[rows]
        return hypot(*np.diff(self.poses[rows, :2], axis=0).T), np.diff(heading)

    def odometry(self, start: float, end: float) -> Odometry:
        """The motion between `start` and `end`, s, as one factor; interpolated evenly between readings."""
        found = self.motions(np.array([start, end]))
        return Odometry(found.delta[0], found.cov[0])

    def motions(self, at: Array) -> Odometry:
        """The motions between consecutive times `at` (n,), s, as columns: (n - 1, 3) and (n - 1, 3, 3)."""
        first, last = np.searchsorted(self._way.t, at[:-1], "right"), np.searchsorted(self._way.t, at[1:], "left")
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
        t, path = self._way
        before, after = np.maximum(first - 1, 0), np.minimum(first + count, len(t) - 1)
        rows = np.column_stack((before, first[:, None] + np.arange(count), after))
        heading = np.unwrap(path[rows, 2], axis=1)
        columns = np.stack((path[rows, 0], path[rows, 1], heading), axis=-1)
        poses = columns.copy()
        poses[:, 0] = _at(start, t[before], t[rows[:, 1]], columns[:, 0], columns[:, 1])
        poses[:, -1] = _at(end, t[rows[:, -2]], t[after], columns[:, -2], columns[:, -1])
        return between(poses[:, :-1], poses[:, 1:])

    def _unknown(self, start: float, end: float) -> Array:
        """(3,) variances of what holes leave unknown: where the way through them led, and its own noise."""
        unknown = self.holes.noise(start, end, position=self.bridged, heading=self.bridged)
        inside = np.maximum(np.minimum(self.holes.end, end) - np.maximum(self.holes.start, start), 0.0)
        way, turn = (self.holes.speed * inside).sum(), (self.holes.turning * inside).sum()
        forward, heading = self.noise.variances(way, turn)
        return unknown + np.array([forward, 0.0, heading]) + np.array([1.0, 1.0, 0.0]) * heading * way**2 / 3

    def remarks(self, start: float, end: float) -> list[str]:
        """Says where readings are missing between `start` and `end`, s, and what may be in other units."""
        return [*self.holes.remarks(self.source, start, end), *odd_units(self.source, self.t, self.poses)]

    @property
    def settings(self) -> dict[str, Any]:
        """The noise."""
        return {"odometry": asdict(self.noise)}


def pieces_of(turns: Array) -> Array:
    """(n,) pieces of FINE_TURN at most, of arcs by `turns` (n,), rad; 1 up to LARGEST_TURN, but for rounding."""
    turns = np.abs(turns) * (1 - 1e-9)
    return np.where(turns <= LARGEST_TURN, 1.0, np.ceil(turns / FINE_TURN))


def _at(t: Array, before: Array, after: Array, low: Array, high: Array) -> Array:
    """(m, 3) the columns `low` at `before` and `high` at `after`, interpolated to `t` (m,); the bits of np.interp."""
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = (high - low) / (after - before)[:, None]
        found = slope * (t - before)[:, None] + low
    found = np.where((t >= after)[:, None], high, found)
    return np.where((t <= before)[:, None], low, found)


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
