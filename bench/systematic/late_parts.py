"""Finds the delay of ranges alone, or of bearings alone, along a true path, by the known places of landmarks.

Measured at t, they are of the pose at t - delay. Beside the delay, a scale and an offset of ranges, or a constant turn
of bearings, are free, which may look like one: least squares with Cauchy weights, from the best of a row of delays. The
interval is a jackknife's over stretches of time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ...core.arrays import frozen
from ...core.factors import UNKNOWN, Dataset, Log, Truth
from ...core.partial import RANGE
from ...core.se2 import Array, Ints, wrap
from ...core.truth.errors import named, rows_of, sighted_from, standing
from ..measure.stated_noise import typical
from .estimated import Estimated
from .fit import CERTAIN
from .motions_along import ratio, unlike
from .ranges import CAUCHY, STRETCHES, stretches

FEWEST, MOST = 50, 5_000
"""Measurements of a log from which on, and up to which, they are looked at; of more, evenly."""

LONGEST, TRIED, ROUNDS = 10.0, 201, 20
"""s, the longest delay, late or early; how many are tried up to it; rounds of weights, and of Gauss-Newton."""

LEAST = 1e-6
"""s, and standard deviations: of exact logs both are 0."""

NEAREST = 1e-3
"""m, the least range that is left without its delay."""

WITHIN = 0.8
"""Share of the measurements of which a true path has to know the pose at a delay that is tried."""


class Late(NamedTuple):
    """The delay of ranges alone, or of bearings alone."""

    delay: Estimated  # s
    certain: bool
    size: float  # of what it makes of them, over their stated noise, median
    before: float  # typical error over the stated noise, as they are stamped
    after: float  # without the delay, and what else is free
    scale: float  # of ranges, as it is fitted beside the delay; 0 of bearings
    own: float  # log likelihood by which the odometry fits the true path better as it is than so much later


class _Rows(NamedTuple):
    """Ranges or bearings alone of a log, and its true path."""

    t: Array  # (k,) s
    z: Array  # (k,) m or rad
    sd: Array  # (k,)
    xy: Array  # (k, 2) known places
    at: Array  # (n,) s, times of the true path
    path: Array  # (n, 3) headings without jumps

    @classmethod
    def made(cls, log: Log, truth: Truth, row: Ints) -> "_Rows":
        """Those rows of the partial sightings."""
        table, known = named(log, truth).partial, standing(truth)
        assert table is not None
        assert known is not None
        path = truth.poses.copy()
        path[:, 2] = np.unwrap(path[:, 2])
        t, sd = log.t[table.step[row]], np.sqrt(table.var[row])
        return cls(t, table.z[row], sd, known.xy[rows_of(known.ids, table.ids[row])], truth.t, path)

    def expected(self, delay: float) -> Array:
        """(k, 2) true ranges and bearings so late."""
        poses = np.stack([np.interp(self.t - delay, self.at, column) for column in self.path.T], axis=-1)
        return sighted_from(poses, self.xy)

    def known(self, delay: float) -> NDArray[np.bool_]:
        """(k,) those of which the true path has the pose."""
        return (self.t - delay >= self.at[0]) & (self.t - delay <= self.at[-1])


def late(known: Sequence[Dataset], kind: int) -> Late | None:
    """Finds the delay of the ranges or the bearings of logs with a true path; None where too little tells it."""
    rows, logs = list[_Rows](), list[tuple[Log, Truth]]()
    for log, truth in known:
        row = _known_rows(log, truth, kind)
        if truth is not None and len(row) >= FEWEST:
            some = row[np.unique(np.linspace(0, len(row) - 1, min(len(row), MOST)).astype(np.int64))]
            rows.append(_Rows.made(log, truth, some))
            logs.append((log, truth))
    return _Fit(rows, kind).result(logs) if rows else None


@dataclass
class _Fit:
    rows: Sequence[_Rows]
    kind: int

    def __post_init__(self) -> None:
        self.z, self.sd = (np.concatenate([getattr(one, name) for one in self.rows]) for name in ("z", "sd"))
        self.part = np.concatenate([stretches(one.t, STRETCHES) for one in self.rows])
        self.about = float(np.median(np.concatenate([np.diff(one.at) for one in self.rows])))

    def result(self, logs: Sequence[tuple[Log, Truth]]) -> Late | None:
        """The delay by all measurements."""
        delay = self._first()
        for _ in range(ROUNDS):
            change = float(np.clip(self._solved(delay)[0][0], -self.about, self.about))
            delay += change
            if abs(change) < LEAST:
                break
        if abs(delay) > LONGEST:
            return None
        off = np.array([self._solved(delay, without=b)[0][0] for b in range(STRETCHES)])
        size = float(np.sqrt((STRETCHES - 1) / STRETCHES * ((off - off.mean()) ** 2).sum()))
        half = float(student.ppf(0.975, STRETCHES - 1)) * size
        both = self._known(0.0) & self._known(delay)
        moved = (self._difference(self._expected(delay), self._expected(0.0)) / self.sd)[both]
        x, left = self._solved(delay)
        return Late(
            Estimated(delay, delay - half, delay + half),
            abs(delay) > CERTAIN * max(size, LEAST),
            float(np.median(np.abs(moved))),
            typical(self._solved(0.0, free=0)[1]),
            typical(left),
            float(x[1]) if self.kind == RANGE else 0.0,
            sum(_own(log, truth, delay) for log, truth in logs),
        )

    def _first(self) -> float:
        """The best of those tried, all else free."""
        tried = [one for one in np.linspace(-LONGEST, LONGEST, TRIED).tolist() if self._known(one).mean() >= WITHIN]
        return min([0.0, *tried], key=lambda one: typical(self._solved(one, free=3)[1]))

    def _solved(self, delay: float, *, without: int = -1, free: int = 4) -> tuple[Array, Array]:
        """Changes of the delay and values of what else is free, without a stretch; errors that are left, over their sd.

        `free` 3: the delay stays, 0: nothing is free.
        """
        kept = self._known(delay) & (self.part != without)
        e = (self._difference(self.z, self._expected(delay)) / self.sd)[kept]
        A = (self._columns(delay) / self.sd[:, None])[kept]
        at = slice(0, A.shape[1]) if free == 4 else slice(1, A.shape[1] if free else 1)
        x, left = np.zeros(A.shape[1]), e
        for _ in range(ROUNDS if free == 4 else min(free, 3)):
            root = 1 / np.hypot(1, left / (CAUCHY * max(typical(left), LEAST)))
            x[at] = np.linalg.lstsq(root[:, None] * A[:, at], root * e, rcond=1e-10)[0]
            left = e - A @ x
        return x, left

    def _columns(self, delay: float) -> Array:
        """(k, c) derivatives of what is expected: by the delay; scale and offset of ranges, or turn of bearings."""
        by_delay = self._difference(self._expected(delay + self.about), self._expected(delay - self.about))
        by_delay /= 2 * self.about
        one = np.ones_like(by_delay)
        others = [self._expected(delay), one] if self.kind == RANGE else [one]
        return np.stack([by_delay, *others], axis=-1)

    def _expected(self, delay: float) -> Array:
        return np.concatenate([one.expected(delay)[:, int(self.kind != RANGE)] for one in self.rows])

    def _known(self, delay: float) -> NDArray[np.bool_]:
        return np.concatenate([one.known(delay) for one in self.rows])

    def _difference(self, measured: Array, right: Array) -> Array:
        return measured - right if self.kind == RANGE else wrap(measured - right)


def _own(log: Log, truth: Truth, delay: float) -> float:
    """Log likelihood by which the odometry fits the true path better than this later by the delay."""
    at = rows_of(truth.t, log.t)
    driven = np.flatnonzero((at[1:] >= 0) & (at[:-1] >= 0)) + 1
    path = truth.poses[np.maximum(at, 0)]
    columns = *truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])
    then = np.stack([np.interp(log.t - delay, truth.t, column) for column in columns], axis=-1)
    return ratio(unlike(log, path, driven), unlike(log, then, driven))


def in_time(dataset: Dataset, kind: int, found: Late) -> Dataset:
    """The log with the ranges or bearings alone of a known place as they are without the delay, by the true path."""
    delay = found.delay.value
    log, truth = dataset
    table, row = log.partial, _known_rows(log, truth, kind)
    if table is None or truth is None or not len(row):
        return dataset
    rows = _Rows.made(log, truth, row)
    known = rows.known(delay) & rows.known(0.0)
    axis = int(kind != RANGE)
    z = table.z.copy()
    z[row[known]] += (1 + found.scale) * (rows.expected(0.0) - rows.expected(delay))[known, axis]
    z[row] = np.maximum(z[row], NEAREST) if kind == RANGE else wrap(z[row])
    return dataset._replace(log=replace(log, partial=replace(table, z=frozen(z))))


def _known_rows(log: Log, truth: Truth | None, kind: int) -> Ints:
    """The rows of a kind of partial sightings with a known place; none without a true path."""
    if truth is None or truth.kind != "truth" or len(truth.t) < 2:
        return np.zeros(0, np.int64)
    table, known = named(log, truth).partial, standing(truth)
    if table is None or known is None:
        return np.zeros(0, np.int64)
    place = rows_of(known.ids, table.ids)
    return np.flatnonzero((place >= 0) & (table.ids != UNKNOWN) & (table.kind == kind))
