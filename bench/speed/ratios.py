"""Compares the backends' costs with expectations: ratios of timings from one process."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ..words.numerals import number
from .isam2_parts import BY_HAND, PARTS, PYTHON, WHOLE
from .timing import Timing, TimingRow

AGAINST_TEXTBOOK = {10: 10, 30: 20, 100: 80, 300: 400, 1000: 1000}  # landmarks -> expected speedup
COMPRESSED = {1000: 15, 3000: 25}  # landmarks -> expected ratio of the dense to the compressed filter, on average

AGAINST_DSYRK, FROM_LANDMARKS = 1.5, 300
AGAINST_LOOP, LOOP_PARTICLES, LOOP_LANDMARKS = 300, 100, 100
LARGE_MAP, SMALL_MAP, MANY, MAP_GROWTH = 1000, 100, 10_000, 1.2
SECOND_VERSION = 4.0
PYTHON_SHARE = 15.0  # %, of a step of iSAM2 that is not GTSAM's own
AGAINST_HAND = 1.15
SEARCH_LANDMARKS, SEARCH_MS = 300, 100.0
FLAT = 1.5  # growth of the compressed filter's median step with the map that still counts as flat
FITTED = 3  # number of largest sizes through which an exponent is fitted: constant costs rule the small ones


class Ratio(NamedTuple):
    """A comparison with an expectation."""

    what: str
    expected: str
    reached: float
    holds: bool
    unit: str = "times"

    @property
    def found(self) -> str:
        """Writes the value with its unit."""
        return f"{number(self.reached)} {self.unit}"


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Fits the power of size with which cost grows over the largest sizes, by least squares in logarithms."""
    if len(sizes) < 2:
        return math.nan
    largest = np.argsort(sizes)[-FITTED:]
    slope, _ = np.polyfit(np.log(np.array(sizes)[largest]), np.log(np.array(costs)[largest]), 1)
    return float(slope)


def growth(rows: Sequence[TimingRow]) -> dict[str, float]:
    """Fits the exponent of the map's size in every backend's median step, with the most particles."""
    found: dict[str, float] = {}
    timed = [row for row in rows if row.kind == "backend" and row.timing]
    for name in dict.fromkeys(row.name for row in timed):
        mine = [row for row in timed if row.name == name]
        most = max(row.particles or 0 for row in mine)
        at = {row.landmarks: row.timing.p50 for row in mine if row.timing and (row.particles or 0) == most}
        found[name] = exponent(list(at), list(at.values()))
    return {name: power for name, power in found.items() if math.isfinite(power)}


def ratios(rows: Sequence[TimingRow], options: Mapping[str, Any]) -> list[Ratio]:
    """Makes every comparison that `rows` have both sides of; `options` are those of each backend's label."""
    known = _Known(rows, options)
    return [
        *_textbook(known),
        *_dsyrk(known),
        *_compressed(known),
        *_particle_filters(known),
        *_python(rows),
        *_search(known),
    ]


class _Known:
    def __init__(self, rows: Sequence[TimingRow], options: Mapping[str, Any]) -> None:
        self.options = options
        self._timings = {
            (row.name, row.landmarks, row.particles): row.timing for row in rows if row.timing and row.kind != "part"
        }
        self.sizes = sorted({row.landmarks for row in rows})
        self.particles = sorted({row.particles for row in rows if row.particles is not None})

    def of(self, name: str, landmarks: int, particles: int | None = None) -> Timing | None:
        return self._timings.get((name, landmarks, particles))

    def ekf(self, landmarks: int, *, compressed: bool) -> Timing | None:
        """Returns that of the plain filter that is compressed, or is not, on a map of this size."""
        for label, options in self.options.items():
            if label.partition("[")[0] == "ekf" and _changed(options) <= {"compress_above"}:
                above = getattr(options, "compress_above", math.inf)
                found = self.of(label, landmarks)
                if found is not None and (landmarks > above) == compressed:
                    return found
        return None

    def fastslam(self, version: int, landmarks: int, particles: int) -> Timing | None:
        for label, options in self.options.items():
            plain = label.partition("[")[0] == "fastslam" and _changed(options) <= {"version", "particles"}
            if plain and getattr(options, "version", None) == version:
                return self.of(label, landmarks, particles)
        return None


def _changed(options: Any) -> set[str]:
    return {field.name for field in fields(options) if getattr(options, field.name) != field.default}


def _textbook(known: _Known) -> Iterator[Ratio]:
    for landmarks, least in AGAINST_TEXTBOOK.items():
        plain, fast = known.of("textbook", landmarks), known.ekf(landmarks, compressed=False)
        if plain and fast:
            what = f"textbook filter / dense ekf, N={landmarks:,}, median step"
            yield _at_least(what, least, plain.p50 / fast.p50)


def _dsyrk(known: _Known) -> Iterator[Ratio]:
    for landmarks in known.sizes:
        floor, fast = known.of("dsyrk", landmarks), known.ekf(landmarks, compressed=False)
        if floor and fast and landmarks >= FROM_LANDMARKS:
            what = f"dense ekf / bare dsyrk, N={landmarks:,}, median step"
            yield _at_most(what, AGAINST_DSYRK, fast.p50 / floor.p50)


def _compressed(known: _Known) -> Iterator[Ratio]:
    for landmarks, least in COMPRESSED.items():
        dense, owing = known.ekf(landmarks, compressed=False), known.ekf(landmarks, compressed=True)
        if dense and owing:
            what = f"dense ekf / compressed ekf, N={landmarks:,}, mean step"
            yield _at_least(what, least, dense.mean / owing.mean)
    medians = {n: found.p50 for n in known.sizes if (found := known.ekf(n, compressed=True))}
    if len(medians) > 1:
        low, high = min(medians), max(medians)
        what = f"compressed ekf, N={high:,} / N={low:,}, median step"
        yield _at_most(what, FLAT, medians[high] / medians[low])


def _particle_filters(known: _Known) -> Iterator[Ratio]:
    loop = known.of("particle loop", LOOP_LANDMARKS, LOOP_PARTICLES)
    fast = known.fastslam(1, LOOP_LANDMARKS, LOOP_PARTICLES)
    if loop and fast:
        what = f"particle loop / fastslam 1.0, M={LOOP_PARTICLES} N={LOOP_LANDMARKS}, median step"
        yield _at_least(what, AGAINST_LOOP, loop.p50 / fast.p50)
    small, large = (known.fastslam(1, n, MANY) for n in (SMALL_MAP, LARGE_MAP))
    if small and large:
        what = f"fastslam 1.0, N={LARGE_MAP:,} / N={SMALL_MAP}, M={MANY:,}, median step"
        yield _at_most(what, MAP_GROWTH, large.p50 / small.p50)
    for particles in known.particles:
        pairs = [(known.fastslam(2, n, particles), known.fastslam(1, n, particles)) for n in known.sizes]
        both = [second.p50 / first.p50 for second, first in pairs if second and first]
        if both:
            what = f"fastslam 2.0 / 1.0, M={particles:,}, median step, worst N"
            yield _at_most(what, SECOND_VERSION, max(both))


def _python(rows: Sequence[TimingRow]) -> Iterator[Ratio]:
    mine = {(row.name, row.beside, row.landmarks): row.timing for row in rows if row.kind == "part" and row.timing}
    steps = [row for row in rows if row.kind == "backend" and row.timing]
    for row in steps:
        python = mine.get((PYTHON, row.name, row.landmarks))
        whole = step_of_parts(rows, row.name, row.landmarks)
        if python and whole:
            what = f"Python's own share of {row.name}'s step, N={row.landmarks:,}"
            share = 100 * python.mean / whole
            yield Ratio(what, f"under {PYTHON_SHARE:g} %", share, share < PYTHON_SHARE, "%")
        ours, by_hand = (mine.get((name, row.name, row.landmarks)) for name in (WHOLE, BY_HAND))
        if ours and by_hand:
            what = f"{row.name} / GTSAM by hand, N={row.landmarks:,}, median step"
            yield _at_most(what, AGAINST_HAND, ours.p50 / by_hand.p50)


def _search(known: _Known) -> Iterator[Ratio]:
    found = known.of("locate", SEARCH_LANDMARKS)
    if found:
        ms = found.p99 / 1e3
        what = f"a search for the robot on the whole map, N={SEARCH_LANDMARKS:,}, p99"
        yield Ratio(what, f"within {SEARCH_MS:g} ms", ms, ms <= SEARCH_MS, "ms")


def step_of_parts(rows: Sequence[TimingRow], beside: str, landmarks: int) -> float:
    """The mean step, in µs, of which the parts beside that backend are parts."""
    mine = [row for row in rows if row.kind == "part" and (row.beside, row.landmarks) == (beside, landmarks)]
    return sum(row.timing.mean for row in mine if row.name in PARTS and row.timing)


def _at_least(what: str, least: float, reached: float) -> Ratio:
    return Ratio(what, f"at least {least:,g} times", reached, reached >= least)


def _at_most(what: str, most: float, reached: float) -> Ratio:
    return Ratio(what, f"within {most:g} times", reached, reached <= most)
