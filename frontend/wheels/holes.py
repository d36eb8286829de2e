"""Holes in odometry: times without readings, long beside those between all others.

What a robot did in a hole is not known. It is taken to have moved at its usual speed in an unknown direction, so that
over `T` s without readings its position has a standard deviation of up to speed x T, and its heading of turning x T.
Where the sums on both sides of the hole are of the same odometry, its end is known and only the way there is not: the
unknown part of a motion over dt of the T s is then that of a Brownian bridge, speed^2 dt (T - dt), which is 0 for the
whole hole; else it is speed^2 dt T.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array, Ints

LEAST = 0.5
"""s. In a shorter time, a robot at 0.5 m/s that turns by 1 rad/s is at most 2 cm off the straight line."""

MANY = 5.0
"""Medians of the time between readings: four readings in a row are lost, which no jitter explains."""

CHANCE = 0.01
"""Probability with which readings lost one by one, at random, leave a time that counts as a hole."""

MOST_TURN = np.pi
"""rad, by which a robot may usually turn in a hole: beyond, its heading is not known up to whole turns."""


FEW_OUTSIDE = 0.01
"""Share of detections or frames outside the odometry's time that is not worth a remark: devices start one by one."""


NEARLY_ALL = 98.5  # %, from which on two digits may say all

MOST_INSIDE = 0.75
"""Share of times that are inside the odometry's in their own unit, and outside in seconds."""

UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def outside(source: str, lost: int, of: int, noun: str, clock: str, hint: str = "") -> list[str]:
    """The remark on so many `lost` detections or frames `of` all; `clock` says outside which time, `hint` why."""
    if lost <= FEW_OUTSIDE * of:
        return []
    share = 100 * lost / of
    said = "all" if lost == of else f"{share:.2g} %" if share < NEARLY_ALL else f"{min(share, 99.9):.1f} %"
    return [f"{source}: {lost:,} of {of:,} {noun}s ({said}) are {clock}, and left out{hint}"]


def other_unit(t: Array, start: float, end: float) -> str:
    """A hint at the end of a sentence where times `t` (n,) are inside `start` to `end`, s, in another unit alone.

    Times that go on for no longer than from `start` to `end` are in seconds, of another clock: 1.7e9 s are 1.7 ns.
    """
    if ((start <= t) & (t <= end)).mean() >= 1 - MOST_INSIDE:
        return ""
    for factor, unit in UNITS.items():
        scaled = t / factor
        if ((start <= scaled) & (scaled <= end)).mean() > MOST_INSIDE:
            if 0 < np.ptp(t) <= end - start:
                return f": the clocks differ, these times begin {t.min() - start:,.0f} s later"
            return f": perhaps they are in {unit}, {factor:,.0f} to the second"
    return ""


class Holes(NamedTuple):
    """The holes of a stream of readings, in order, and how the robot moves elsewhere."""

    start: Array  # (h,) s
    end: Array  # (h,) s
    speed: Array  # (h,) m/s, root mean square of all other times, or that of the hole itself if higher
    turning: Array  # (h,) rad/s, likewise
    usual: float  # s, the median time between readings
    turns: float  # rad/s, root mean square of all other times

    def check(self, source: str) -> None:
        """Raises InputError for a hole in which the robot's heading is lost."""
        for start, end in zip(self.start.tolist(), self.end.tolist(), strict=True):
            if self.turns * (end - start) > MOST_TURN:
                most = MOST_TURN / self.turns
                raise InputError(
                    f"{source}: found no reading from {start:.10g} to {end:.10g} s, {end - start:.3g} s, expected at "
                    f"most {most:.3g} s: the robot turns by {self.turns:.2g} rad/s (root mean square), and after half "
                    "a turn its heading is unknown. Use the log before or after it."
                )

    def between(self, at: Array) -> NDArray[np.bool_]:
        """(n - 1,) which times between consecutive ones of `at` (n,), s, have a part of a hole."""
        return np.searchsorted(self.end, at[:-1], "right") < np.searchsorted(self.start, at[1:], "left")

    def noise(self, start: float, end: float, *, position: bool, heading: bool) -> Array:
        """(3,) variances of what is unknown of the motion from `start` to `end`, s.

        `position` and `heading` are bridged: known again after the hole.
        """
        lasting = self.end - self.start
        inside = np.maximum(np.minimum(self.end, end) - np.maximum(self.start, start), 0.0)
        way = (self.speed**2 * inside * (lasting - inside * position)).sum()
        turn = (self.turning**2 * inside * (lasting - inside * heading)).sum()
        return np.array([way, way, turn])

    def remarks(self, source: str, start: float, end: float) -> list[str]:
        """Says where the holes between `start` and `end`, s, are, and with what noise they are bridged."""
        rows = np.flatnonzero((self.end > start) & (self.start < end))
        if not len(rows):
            return []
        lasting = self.end - self.start
        at = int(rows[np.argmax(lasting[rows])])
        several = f"{len(rows)} times, the longest " if len(rows) > 1 else ""
        unknown, turn = self.speed[at] * lasting[at], self.turning[at] * lasting[at]
        found = f"no reading {several}for {lasting[at]:.3g} s, from {self.start[at]:.10g} to {self.end[at]:.10g} s"
        usual = f"where {self.usual:.3g} s are usual (median)"
        noise = f"with a standard deviation of up to {unknown:.2g} m and {turn:.2g} rad"
        return [f"{source}: {found}, {usual}: the motion meanwhile is interpolated, {noise}"]


def find_holes(t: Array, moved: Callable[[Ints], tuple[Array, Array]]) -> Holes:
    """Finds the holes between readings at `t` (m,), s, increasing.

    `moved` (k,) -> (k - 1,) way in m and turn in rad between the readings of those rows. A robot that has not moved at
    all between two readings stood still: some programs write a row only where there is motion.
    """
    none = np.zeros(0)
    between = np.diff(t)
    usual = float(np.median(between)) if len(between) else 0.0
    rows = np.flatnonzero(between > max(LEAST, _many(between, usual) * usual))
    if not len(rows):
        return Holes(none, none, none, none, usual, 0.0)
    way, turn = (np.abs(across[::2]) for across in moved(np.column_stack((rows, rows + 1)).ravel()))
    kept = (way > 0) | (turn > 0)
    rows, way, turn = rows[kept], way[kept], turn[kept]
    speed, turns = _usual(t, rows, moved)
    lasting = between[rows]
    fastest = np.maximum(speed, way / lasting), np.maximum(turns, turn / lasting)
    return Holes(t[rows], t[rows + 1], *fastest, usual, turns)


def _many(between: Array, usual: float) -> float:
    """Medians beyond which a time between readings is a hole.

    Where a share q of the readings is lost at random, k are lost in a row after a reading with probability q^k, so that
    the longest of n times is beyond 1 + k medians with a probability of at most n q^k. Times beyond 1.5 medians give q.
    """
    lost = float((between > 1.5 * usual).mean()) if len(between) else 0.0
    if not 0 < lost < 1:
        return MANY
    return max(MANY, 1 + float(np.log(CHANCE / len(between)) / np.log(lost)))


def _usual(t: Array, holes: Ints, moved: Callable[[Ints], tuple[Array, Array]]) -> tuple[float, float]:
    """Root mean squares of speed (m/s) and turning (rad/s), over pieces of LEAST s without a hole; 0 without any."""
    piece = np.floor((t - t[0]) / LEAST)
    first = np.concatenate(([0], np.flatnonzero(np.diff(piece)) + 1))
    if len(first) < 2:
        return 0.0, 0.0
    lasting, (way, turn) = np.diff(t[first]), moved(first)
    whole = np.searchsorted(holes, first[1:]) == np.searchsorted(holes, first[:-1])
    seconds = lasting[whole].sum()
    if not seconds:
        return 0.0, 0.0
    squares = [(values[whole] ** 2 / lasting[whole]).sum() / seconds for values in (way, turn)]
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
