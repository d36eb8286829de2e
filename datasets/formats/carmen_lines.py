"""Reads the rows of CARMEN's logs that have laser scans and odometry; `carmen` has their format."""

import gzip
import zlib
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array, between, compose
from ...frontend.laser.scanner import Fan

RAW, ODOMETRY = "RAWLASER1", "ODOM"

KINDS = ("FLASER", "ROBOTLASER1", RAW)
"""Of scans; those of RAW, to which the odometry is added, only where there are none of the others."""

MOST_BEAMS = 10_000

GAP = 1.0
"""s between two rows of odometry that a raw scan's is interpolated from, at most."""


class Line(NamedTuple):
    """A scan as logged."""

    number: int
    t: float
    odometry: tuple[float, float, float]
    angles: tuple[float, float] | None  # rad, the first and the step; None: those of FLASER
    ranges: Array  # (b,)

    @property
    def fan(self) -> Fan:
        """Its beams; those of FLASER as in `evenly`."""
        n = len(self.ranges)
        first, step = self.angles or (-np.pi / 2, np.pi / (n - n % 2) if n > 1 else np.pi)
        return Fan(n, first, step)

    def is_repeated(self, other: "Line") -> bool:
        """Tells if the other row has the same scan, with the same odometry."""
        return self.odometry == other.odometry and np.array_equal(self.ranges, other.ranges, equal_nan=True)


def read_lines(path: Path) -> tuple[list[Line], list[str]]:
    """The scans in the order of their rows, and remarks; InputError names the file and line of a fault."""
    scans, others = list[Line](), list[_Row]()
    for row in _rows(path):
        if row.words[0] in (RAW, ODOMETRY):
            if not scans:
                others.append(row)
        else:
            scans.append(_scan(row))
            others.clear()
    if scans:
        return scans, []
    raw = [_scan(row) for row in others if row.words[0] == RAW]
    odometry = [_reading(row) for row in others if row.words[0] == ODOMETRY]
    return _with_odometry(raw, odometry) if odometry else (raw, [])


def _reading(row: "_Row") -> Line:
    """A row of odometry, as a scan without beams."""
    numbers = _Numbers(row.words, row.where)
    x, y, heading = numbers.take(1, 3, "the odometry").tolist()
    (t,) = numbers.take(7, 1, "the time").tolist()
    return Line(row.number, t, (x, y, heading), None, np.zeros(0))


def _with_odometry(raw: Sequence[Line], odometry: Sequence[Line]) -> tuple[list[Line], list[str]]:
    """The scans that have odometry around them, and a remark on the others.

    Where most times of the odometry are alike, that of the row before counts.
    """
    odometry = sorted(odometry, key=lambda one: one.t)
    t, first = np.unique([one.t for one in odometry], return_index=True)
    if 2 * len(t) <= len(odometry):
        rows = np.array([one.number for one in sorted(odometry, key=lambda one: one.number)])
        poses = [one.odometry for one in sorted(odometry, key=lambda one: one.number)]
        before = np.maximum(np.searchsorted(rows, [line.number for line in raw]) - 1, 0)
        return [line._replace(odometry=poses[row]) for line, row in zip(raw, before.tolist(), strict=True)], []
    poses = np.array([odometry[row].odometry for row in first])
    at = np.array([line.t for line in raw])
    after = np.clip(np.searchsorted(t, at), 1, max(len(t) - 1, 1))
    after, before = np.minimum(after, len(t) - 1), np.minimum(after, len(t)) - 1
    apart = t[after] - t[before]
    here = (t[0] <= at) & (at <= t[-1]) & (apart <= GAP)
    share = np.clip((at - t[before]) / np.where(apart > 0, apart, 1.0), 0.0, 1.0)
    found = compose(poses[before], between(poses[before], poses[after]) * share[:, None]).tolist()
    kept = [raw[row]._replace(odometry=tuple(found[row])) for row in np.flatnonzero(here).tolist()]
    lost = len(raw) - len(kept)
    why = f"{lost} of {len(raw)} scans have no odometry within {GAP:g} s around them and are left out"
    return kept, [why] if lost else []


class _Row(NamedTuple):
    """A row of a kind that is used."""

    words: list[str]
    where: str  # in messages
    number: int


def _rows(path: Path) -> Iterator[_Row]:
    opener = gzip.open if path.suffix.lower() == ".gz" else open
    number = 0
    try:
        with opener(path, "rt", encoding="utf-8", errors="replace") as file:
            for number, text in enumerate(file, start=1):
                words = text.split()
                if words and words[0] in (*KINDS, ODOMETRY):
                    yield _Row(words, f"{path}, line {number}", number)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}, expected a laser log.") from None
    except (EOFError, zlib.error) as error:
        raise InputError(f"{path}: after line {number}: {error}, expected a whole gzip file.") from None


def _scan(row: _Row) -> Line:
    """A scan of any kind."""
    words, where, number = row
    kind, at = words[0], 1 if words[0] == "FLASER" else 8
    count = _count(words, at, "beams", where)
    numbers = _Numbers(words, where)
    ranges, after = numbers.take(at + 1, count, "ranges", finite=False), at + 1 + count
    angles = None
    if kind != "FLASER":
        start, _, step = numbers.take(2, 3, "the start, width and step of its angles")
        angles = (float(start), float(step))
        after += 1 + _count(words, after, "remissions", where)
    if kind == RAW:
        (t,) = numbers.take(after, 1, "the time").tolist()
        return Line(number, t, (0.0, 0.0, 0.0), angles, ranges)
    x, y, heading = numbers.take(after + 3, 3, "the odometry").tolist()
    (t,) = numbers.take(after + (6 if kind == "FLASER" else 11), 1, "the time").tolist()
    return Line(number, t, (x, y, heading), angles, ranges)


def _count(words: list[str], at: int, what: str, where: str) -> int:
    word = words[at] if at < len(words) else ""
    if not word.isdigit() or int(word) > MOST_BEAMS:
        raise InputError(f"{where}: found {word!r} as the number of {what}, expected 0 to {MOST_BEAMS}.")
    return int(word)


class _Numbers:
    """The words of a line as numbers."""

    def __init__(self, words: list[str], where: str) -> None:
        self._words, self._where = words, where

    def take(self, at: int, count: int, what: str, *, finite: bool = True) -> Array:
        """Those from word `at` on; InputError where there are too few, or one is no number."""
        words = self._words[at : at + count]
        if len(words) < count:
            raise InputError(
                f"{self._where}: the line ends after {len(self._words)} words, expected {at + count} for {what}."
            )
        try:
            found = np.array(words, dtype=np.float64)
        except ValueError:
            bad = next(word for word in words if not _is_number(word))
            raise InputError(f"{self._where}: found {bad!r} in {what}, expected a number.") from None
        if finite and not np.isfinite(found).all():
            bad = next(word for word in words if not isfinite(float(word)))
            raise InputError(f"{self._where}: found {bad!r} in {what}, expected a finite number.")
        return found


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
