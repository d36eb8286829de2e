"""Remarks on a log's ways: those of its odometry against the ranges of landmarks, which change by no more."""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from ..core.factors import UNKNOWN, Log
from ..core.se2 import Array, Ints, wrap
from ..core.truth.doubts import MOVING, UNTURNED

FAR = 1000.0  # m; a median range or stride beyond it may be in millimetres
FEW = 10  # rows below which nothing is odd
OTHER_UNIT = 3.0  # way between two sightings of a landmark over the most that their ranges allow, or the reverse: the
# median is at most 1 where both are in one unit, 1000 in m and mm, 57 in rad and degrees
RATE = "a frame rate, a clock or a speed is wrong"
NEAR_CAUSES = (
    (100.0, "the ranges are in millimetres, or the odometry in kilometres"),
    (12.0, "the ranges are in centimetres"),
    (6.0, f"the ranges are in inches or centimetres, or {RATE}"),
    (0.0, f"{RATE}, or the ranges are in feet"),
)
"""By the change of a range over the way. It is a bound: 1,000 times too large, ranges change by 180 to 400 ways."""
FAR_CAUSES = (
    (12.0, "it is in millimetres or centimetres, or the ranges in kilometres"),
    (0.0, f"{RATE}, or it is in centimetres or inches"),
)
"""By the way over what ranges allow: 1,000 times too long, it is 16 to 200 times that."""
CHANGED = 0.1  # share of a range that noise which is stated too small does not change it by
STRAIGHT = 0.7  # share of the pairs of sightings between which a robot may go straight, or be alone with false ids
GROWN = 2.0  # times the change from one sighting to the next, which that of noise is not, however far apart they are


def of_ways(log: Log) -> Iterator[str]:
    """Compares the way between two sightings of a landmark with their ranges, a and b: from |a - b| to a + b."""
    stride = np.hypot(*log.delta[1:, :2].T)
    if not len(stride) or max(np.median(stride), np.median(log.z[:, 0])) > FAR:  # which has a remark already
        return
    path = log.dead_reckoned()[:, :2]
    size = float(np.hypot(*np.ptp(path, axis=0)))
    stands = list(_stands(log, path, size)) if size < MOVING else [*_repeats(log, path), *_unturned(log, path)]
    yield from stands or _units(log, path)


class _Sequence:
    """The sightings of known landmarks, landmark by landmark, each one's in the order of the log.

    Columns (s,) are made once they are asked for: all of them together are as large as the log.
    """

    def __init__(self, log: Log, path: Array) -> None:
        """`path` (n, 2) is the odometry's."""
        order = np.argsort(log.ids, kind="stable")
        self._log, self._path, self._order = log, path, order[log.ids[order] != UNKNOWN]
        self.ids = log.ids[self._order]

    @cached_property
    def range(self) -> Array:
        """m."""
        return self._log.z[self._order, 0]

    @cached_property
    def bearing(self) -> Array:
        """rad."""
        return self._log.z[self._order, 1]

    @cached_property
    def range_var(self) -> Array:
        """Stated."""
        return self._log.z_cov[self._order, 0, 0]

    @cached_property
    def bearing_var(self) -> Array:
        """Stated."""
        return self._log.z_cov[self._order, 1, 1]

    @cached_property
    def x(self) -> Array:
        """m, of the robot."""
        return self._path[self._step, 0]

    @cached_property
    def y(self) -> Array:
        """m, likewise."""
        return self._path[self._step, 1]

    @cached_property
    def gone(self) -> Array:
        """m, way of the robot so far, by odometry."""
        return np.concatenate(([0.0], np.cumsum(np.hypot(*self._log.delta[1:, :2].T))))[self._step]

    @property
    def _step(self) -> Ints:
        return self._log.sighting_step[self._order]

    def pairs(self, apart: int) -> "_Pairs":
        """Every sighting with the one of its landmark that is so many sightings later."""
        return _Pairs(self, apart)


class _Pairs:
    """Two sightings each of a landmark; columns (p,) are computed when they are asked for."""

    def __init__(self, of: _Sequence, apart: int) -> None:
        self._of, self._one, self._other = of, slice(-apart), slice(apart, None)
        self._same = of.ids[self._one] == of.ids[self._other]

    def __len__(self) -> int:
        return int(np.count_nonzero(self._same))

    @property
    def a(self) -> Array:
        """m, the range of the one."""
        return self._of.range[self._one][self._same]

    @property
    def b(self) -> Array:
        """m, the range of the other."""
        return self._of.range[self._other][self._same]

    @property
    def noise(self) -> Array:
        """m, stated, of a - b."""
        return np.sqrt(self._of.range_var[self._one] + self._of.range_var[self._other])[self._same]

    @property
    def way(self) -> Array:
        """m, by odometry from one to the other."""
        return (self._of.gone[self._other] - self._of.gone[self._one])[self._same]

    @property
    def straight(self) -> Array:
        """m, likewise, between their places."""
        x, y = (column[self._other] - column[self._one] for column in (self._of.x, self._of.y))
        return np.hypot(x, y)[self._same]

    @property
    def turned(self) -> Array:
        """rad, by how much the bearing changes."""
        return np.abs(wrap(self._of.bearing[self._other] - self._of.bearing[self._one]))[self._same]

    @property
    def turn_noise(self) -> Array:
        """rad, stated, of that."""
        return np.sqrt(self._of.bearing_var[self._one] + self._of.bearing_var[self._other])[self._same]


def _stands(log: Log, path: Array, size: float) -> Iterator[str]:
    """Finds ranges that change though the odometry stays within `size`, m, as those to a robot that drives do.

    Between neighbouring sightings they may change by too little, and after a lap not at all: several distances are
    tried.
    """
    apart, nearest, most, sightings = 1, 0.0, (0.0, 0.0), _Sequence(log, path)
    while len(pairs := sightings.pairs(apart)) >= FEW:
        a, b = pairs.a, pairs.b
        change = np.abs(a - b)
        typical = float(np.median(change))
        nearest = nearest or typical
        surely = 1.0 if typical > GROWN * nearest else 3.0
        excess = float(np.median(change / (pairs.straight + surely * pairs.noise)))
        if np.median(change / np.maximum(a, b)) > CHANGED:
            most = max(most, (excess, typical))
        apart *= 2
    if most[0] > OTHER_UNIT:
        moves = f"stays within {size:.2g} m" if size else "never moves"
        yield (
            f"the odometry {moves}, but between two sightings of a landmark its range changes by {most[1]:.2g} m "
            "(median): perhaps its poses or its speed are not filled in, or it is in kilometres"
        )


def _repeats(log: Log, path: Array) -> Iterator[str]:
    """Finds ranges that change while the odometry repeats a reading, as where it is stuck for a part of the log."""
    apart, nearest, most, sightings = 1, 0.0, (0.0, 0.0), _Sequence(log, path)
    while len(pairs := sightings.pairs(apart)) >= FEW:
        same = pairs.way == 0
        apart *= 2
        if same.sum() < FEW:
            continue
        a, b = pairs.a[same], pairs.b[same]
        change = np.abs(a - b)
        typical = float(np.median(change))
        nearest = nearest or typical
        surely = 1.0 if typical > GROWN * nearest else 3.0
        if np.median(change / np.maximum(a, b)) > CHANGED:
            most = max(most, (float(np.median(change / (surely * pairs.noise[same]))), typical))
    if most[0] > OTHER_UNIT:
        moves = np.flatnonzero(np.append(log.delta[1:, :2].any(axis=1), True))
        longest = float(np.diff(log.t[np.append(0, moves)]).max())
        yield (
            f"the odometry repeats a place for up to {longest:.3g} s, but between two sightings meanwhile a landmark's "
            f"range changes by {most[1]:.2g} m (median): perhaps it is stuck"
        )


def _unturned(log: Log, path: Array) -> Iterator[str]:
    """Finds bearings that change by more than ways do it, though the odometry never turns."""
    if np.ptp(np.cumsum(log.delta[1:, 2])) > UNTURNED:
        return
    apart, first, sightings = 1, 0.0, _Sequence(log, path)
    while len(pairs := sightings.pairs(apart)) >= FEW:
        nearest, way, turned = np.minimum(pairs.a, pairs.b), pairs.way, pairs.turned
        small = way < nearest / 2
        typical = float(np.median(turned))
        first = first or typical
        surely = 1.0 if typical > GROWN * first else 3.0
        excess = turned / (way / nearest + surely * pairs.turn_noise)
        if small.sum() >= FEW and np.quantile(excess[small], STRAIGHT) > OTHER_UNIT:
            yield (
                "the odometry never turns, but between two sightings of a landmark its bearing changes by "
                f"{np.median(turned[small]):.2g} rad (median), by the way alone it would by "
                f"{np.median((way / nearest)[small]):.2g} rad: perhaps headings or turning rates are not given"
            )
            return
        apart *= 2


def _units(log: Log, path: Array) -> Iterator[str]:
    """Finds ranges and ways that differ as by a unit."""
    pairs = _Sequence(log, path).pairs(1)
    if len(pairs) < FEW:
        return
    way, a, b = pairs.way, pairs.a, pairs.b
    moving = way > np.median(way) / 10
    if moving.sum() < FEW or not np.median(way) > 0:
        return
    far = float(np.median((pairs.straight / (a + b))[moving]))
    if far > OTHER_UNIT:
        yield (
            f"between two sightings of a landmark the odometry goes {far:.3g} times as far as their ranges allow "
            f"(median): perhaps {_cause(far, FAR_CAUSES)}"
        )
    near = float(np.median((np.abs(a - b) / (way + 3 * pairs.noise))[moving]))
    if near > OTHER_UNIT:
        yield (
            f"between two sightings of a landmark its range changes by {near:.3g} times the way of the odometry "
            f"(median): perhaps {_cause(near, NEAR_CAUSES)}"
        )


def _cause(factor: float, causes: Sequence[tuple[float, str]]) -> str:
    return next(words for least, words in causes if factor > least)
