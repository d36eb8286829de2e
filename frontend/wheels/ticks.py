"""The motion between two camera frames, from wheel counters."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Odometry
from ...core.se2 import Array, Ints
from .counters import MAX_SPEED, WHEELS, check_counts
from .encoder import Encoder
from .holes import Holes, find_holes
from .motion import in_order


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
        in_order(self.t, self.source)
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


def readings(ticks: Ticks, start: float, end: float) -> tuple[Array, Array]:
    """The count increments (n, 2) from `start` to `end`, s, and their durations, (n,) s.

    A reading that `start` or `end` falls into is divided as if the wheels had turned evenly meanwhile.
    """
    inside = slice(np.searchsorted(ticks.t, start, "right"), np.searchsorted(ticks.t, end, "left"))
    t = np.concatenate(([start], ticks.t[inside], [end]))
    wheels = [np.interp(t, ticks.t, ticks.counts[:, wheel]) for wheel in (0, 1)]
    return np.diff(np.stack(wheels, axis=-1), axis=0), np.diff(t)
