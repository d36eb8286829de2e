"""The agreement of a gyro's turns with those of a path over time: a delay, a factor, and what is left of each turn.

Both are cut into the same pieces of the drive. The delay is the shift of the gyro under which the turns of these
pieces correlate most, whatever their factor, between two tried ones by a parabola. Wheels that slip are far off in
some of the pieces, a gyro of another drive in most: how far it typically is in the pieces where it turns tells the
two apart, where a correlation does not. Robots on one course turn at the same places.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints
from ..wheels.track import Poses
from .delay import Delay
from .imu import Imu
from .turns import integrated, integrated_steps

PIECE = 1.0  # s at least, of which the turns are compared
FEW, TURNS = 10, 0.01  # pieces, and rad by which their turns have to differ, to tell anything
AGREE = 0.7  # correlation from which on both are of one drive
EVENLY, MOST_BIAS = 0.1, 0.15
"""rad in a piece: turns of the wheels from which on a drive that always turns alike tells, and the most by a bias."""

MOST, GRID = 5.0, 0.05  # s, the largest delay that is looked for, and between those tried
PART = 0.25  # of a drive at most that a delay cuts off at either end, and of a piece between two starts
BENT = 4  # grid points to each side that a parabola goes through
BETTER = 16.0
"""Of the log-likelihood ratio, twice, by which a delay has to explain the turns better than none: four standard
deviations."""

NOTICED, ROW = 0.05, 0.75
"""s, and of the time between the path's poses, that a delay has to be beyond: within a row anything may have been."""

TURNING = 0.1  # rad in a piece (root mean square), from which on both turn so much that they have to agree
TURNED = 0.5  # of the gyro's root mean square, from which on it turns in a piece
CLOSE, APART, ALIKE = 0.3, 0.35, 0.9
"""How far a turn typically is off, of the turn, in pieces where the gyro turns: up to which both are of one drive, from
which on they are not, and the correlation from which on they are all the same. Gyros beside wheels that slip by 20 %
have 0.2, those of other drives on the same course 0.4 to 1."""


class Agreement(NamedTuple):
    """The turns of a gyro beside those of a path."""

    slope: float | None  # the gyro's turn for one of the path, at the delay if there is one; None: not known
    delay: Delay | None  # of the gyro's stamps; None where the turns do not tell it
    late: bool  # the delay is no accident
    other: bool  # they are not of one drive, at any delay
    off: float  # how far the gyro's turn typically is off, of the turn


class _Tried(NamedTuple):
    """Turns (m,) of the pieces, rad, under one shift."""

    gyro: Array
    path: Array

    @property
    def correlation(self) -> float:
        if len(self.gyro) < FEW or not self.gyro.std() or not self.path.std():
            return 0.0
        return float(np.corrcoef(self.gyro, self.path)[0, 1])

    @property
    def slope(self) -> float:
        off = self.path - self.path.mean()
        return float(self.gyro @ off / (off @ off))

    @property
    def off(self) -> float:
        """The part by which a turn typically is off the line through all, of the turn."""
        if not self.correlation:
            return 1.0
        gyro, path = (one - np.median(one) for one in self)
        turns = np.abs(gyro) > TURNED * gyro.std()
        return float(np.median(np.abs(gyro - self.slope * path)[turns]) / np.median(np.abs(gyro[turns])))


class _Pieces:
    """The turns of a drive's pieces by both, at any shift of the gyro by steps of the grid."""

    def __init__(self, imu: Imu, path: Poses) -> None:
        begin, end = max(imu.t[0], path.t[0]), min(imu.t[-1], path.t[-1])
        at = np.arange(begin, end, GRID)
        row = float(np.median(np.diff(path.t)))
        self.seconds = max(PIECE, row)
        self.noticed = max(NOTICED, ROW * row)
        self._long = round(self.seconds / GRID)
        self.most = int(min(MOST, PART * max(end - begin, 0.0)) / GRID)
        every = max(int(PART * self._long), 1)
        self._all = np.arange(0, len(at) - self._long, every)
        self._start = np.arange(self.most, len(at) - self.most - self._long, every)
        if len(self._all):
            self._gyro = integrated(imu.t, imu.gyro[:, 2], at)
            self._unknown = integrated_steps(imu.t, np.where(imu.sound, 0.0, np.diff(imu.t)), at)
            self._path = np.interp(at, path.t, np.unwrap(path.poses[:, 2]))

    def __len__(self) -> int:
        """The number of pieces that both tell at any shift, those that overlap counted once."""
        return int(len(self._start) * PART)

    @property
    def whole(self) -> int:
        """The number of all pieces."""
        return int(len(self._all) * PART)

    def at(self, shift: int) -> _Tried:
        """The turns if the gyro is `shift` steps of the grid late, where both are known."""
        return self._between(self._start, self._start + shift)

    def unshifted(self) -> _Tried:
        """The turns of all pieces."""
        return self._between(self._all, self._all)

    def _between(self, start: Ints, shifted: Ints) -> _Tried:
        known = self._unknown[shifted + self._long] == self._unknown[shifted]
        start, shifted = start[known], shifted[known]
        return _Tried(
            self._gyro[shifted + self._long] - self._gyro[shifted], self._path[start + self._long] - self._path[start]
        )


def agreement(imu: Imu, path: Poses) -> Agreement | None:
    """The agreement of the gyro's turns with those of a path; None where too little of the drive is known by both."""
    if len(path.t) < 2 or not np.isfinite(path.poses[:, 2]).all():
        return None
    pieces = _Pieces(imu, path)
    if pieces.whole < FEW:
        return None
    none = pieces.unshifted()
    if len(none.path) < FEW or none.path.std() < TURNS:
        return Agreement(_evenly(none), None, late=False, other=False, off=0.0)
    if len(pieces) < FEW:
        return Agreement(_slope(none), None, late=False, other=False, off=0.0)
    shifts = np.arange(-pieces.most, pieces.most + 1)
    squares = np.array([pieces.at(int(shift)).correlation ** 2 for shift in shifts])
    best = int(squares.argmax())
    tried = pieces.at(int(shifts[best]))
    square = min(float(squares[best]), 1 - 1e-9)
    if abs(tried.correlation) < AGREE or tried.off > APART:
        turning = min(none.gyro.std(), none.path.std()) > TURNING
        other = turning and abs(tried.correlation) < ALIKE and tried.off > APART
        return Agreement(_slope(none), None, late=False, other=bool(other), off=tried.off)
    delay = _delay(GRID * shifts.astype(np.float64), squares, best, len(pieces))
    gain = len(pieces) * np.log((1 - squares[pieces.most]) / (1 - square))
    if delay is None or not (
        delay.odd and abs(delay.seconds) > pieces.noticed and gain > BETTER and tried.off <= CLOSE
    ):
        return Agreement(_slope(none), delay, late=False, other=False, off=tried.off)
    return Agreement(tried.slope, delay, late=True, other=False, off=tried.off)


def _delay(tried: Array, squares: Array, best: int, pieces: int) -> Delay | None:
    """The delay by the squared correlations (n,) at those `tried` (n,), s; None where the search does not include it.

    The rest's share of the variance is its weighted sum of squares but for a factor, whose bend tells the sd.
    """
    if not BENT <= best < len(tried) - BENT:
        return None
    near = slice(best - BENT, best + BENT + 1)
    bend, slope, _ = np.polyfit(tried[near] - tried[best], 1 - squares[near], 2)
    if bend <= 0:
        return None
    rest = max(1 - float(squares[best]), 1e-9)
    return Delay(float(tried[best] - slope / (2 * bend)), float(np.sqrt(rest / (bend * pieces))))


def _slope(turns: _Tried) -> float | None:
    return turns.slope if abs(turns.correlation) >= AGREE else None


def _evenly(turns: _Tried) -> float | None:
    """Of a robot that always turns alike the means tell, where no bias explains how they differ."""
    if not len(turns.path):
        return None
    gyro, path = float(turns.gyro.mean()), float(turns.path.mean())
    return gyro / path if abs(path) > EVENLY and abs(gyro - path) > MOST_BIAS else None
