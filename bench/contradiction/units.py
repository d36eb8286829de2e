"""Units and signs of ranges alone, and of positions and headings in the world, that the odometry contradicts.

Where the robot is at p by dead reckoning, and ranges r are f times the distance to a landmark at m,

    r² = f² (|p|² - 2 p'm + |m|²)

which is linear in 1, p and |p|², with f² as the last one's coefficient: a straight line, too, tells it. Positions z are
f times p, turned or mirrored, and shifted: as complex numbers, f is the size of their regression on p, or on its
conjugate. Noise in r² or z leaves both on average where they are, whatever it is stated to be. Each is found in
stretches of several lengths, as short ones have more noise and long ones more drift, and those count that are sure.

On a circle |p|² is linear in p, and a range tells f but for the landmark's place, inside or outside. What holds on any
way is that a range changes by no more than f times what the robot moves by: f is at least the spread of r, as far as it
is linear in p, over that of p. Where the true path and the places are known, f is the range over the distance.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Log, Truth
from ...core.partial import RANGE
from ...core.se2 import Array, wrap
from ..words.numerals import number
from .mistakes import DEGREE, FACTORS
from .ranges import ratios

LENGTHS = (10, 30, 100)
"""Measurements of a stretch."""

SURE = 4.0
"""Standard errors that a stretch's factor has to be from zero to count."""

FEWEST, TWO = 5, 20.0
"""Stretches, and turns of a compass, from which on something is said; two stretches do, if off by such a factor."""

OFF, NEARLY = 2.5, 1.5
"""Factor from which on a unit is wrong, in three quarters of the stretches; and how near it is to a unit's own."""

APART = (1, 4, 16)
"""Headings from one to another that a turn is of."""

STANDS = 1e-6
"""m, or any other unit: a robot that drives no further stands."""

CLEARLY, TELL = 4.0, 30
"""Factor of the squares left from which on a path is told from its mirror image, and positions that tell it."""

ANGULAR = 1e-4
"""Of positions' factor: below, they are in degrees, one of latitude being 111 km."""

MOVES = 0.5
"""m, the spread of a way from which on the turns of a robot, whose sensor sits at its edge, change ranges by less."""

FEW_FIXES = 3
"""Positions from which on a stretch of all of them tells degrees, which need no noise to be known."""

IN_DEGREES = "positions are in degrees of latitude and longitude, which dataset csv converts (lat, lon)"

TURNED = 2.0
"""rad, the largest turn between two headings that is not taken for one the other way round."""

LEAST_TURN = 0.05
"""rad, likewise the least."""


def wrong_units(log: Log, truth: Truth | None = None) -> Iterator[str]:
    """Yields a sentence for each unit or sign that does not fit, without its full stop."""
    if log.partial is None and log.fixes is None:
        return
    path = log.dead_reckoned()
    if len(known := ratios(log, truth)) >= FEWEST:
        if (factor := _typical(known.tolist())) is not None:
            yield (
                f"ranges alone are {number(factor)} times the distances by the true path and known places (median): "
                f"{_unit(factor, 'ranges are', 'the places are')}"
            )
    elif (factor := _typical(list(_of_ranges(log, path)))) is not None:
        yield f"ranges alone are {number(factor)} times what the odometry makes of them: {_unit(factor, 'ranges are')}"
    elif (factor := _at_least(list(_of_changes(log, path)))) is not None:
        cause = _unit(factor, "ranges are")
        yield f"ranges alone change by {number(factor)} times what the odometry moves by: {cause}"
    if _like_degrees(log, path):
        yield f"the positions in the world spread by less than {ANGULAR:g} of what the odometry does: {IN_DEGREES}"
    elif (factor := _typical([fit.factor for fit in _of_positions(log, path)])) is not None:
        cause = _unit(factor, "positions are")
        if factor < ANGULAR:
            cause = IN_DEGREES
        yield f"the way between positions in the world is {number(factor)} times the odometry's: {cause}"
    elif _mirrored(log, path):
        yield (
            "the positions in the world turn to the other side than the odometry: latitude and longitude, or x and y, "
            "are swapped, or one of them, or the odometry's turns, have the other sign"
        )
    yield from _of_headings(log)


def _of_landmarks(log: Log, path: Array) -> Iterator[tuple[Array, Array]]:
    """Yields positions (m, 2) about their mean and ranges (m,) from there, of each stretch of one landmark's ranges."""
    table = log.partial
    if table is None:
        return
    mine = np.flatnonzero((table.kind == RANGE) & (table.ids != UNKNOWN))
    ids, step, z = table.ids[mine], table.step[mine], table.z[mine]
    for landmark in np.unique(ids):
        rows = np.flatnonzero(ids == landmark)
        for stretch in _stretches(len(rows)):
            p = path[step[rows[stretch]], :2]
            yield p - p.mean(axis=0), z[rows[stretch]]


def _of_ranges(log: Log, path: Array) -> Iterator[float]:
    """The factors of stretches of ranges to one landmark."""
    for p, r in _of_landmarks(log, path):
        square = (p**2).sum(axis=1)
        size = float(np.sqrt(square.mean()))
        if not size > STANDS:
            continue
        columns = np.column_stack((np.ones_like(r), p / size, square / size**2))
        # A straight line leaves the direction across it open: the shortest solution has nothing of it.
        U, s, V = np.linalg.svd(columns, full_matrices=False)
        kept = s > 1e-3 * s[0]
        if (V[~kept, 3] ** 2).sum() > 1e-3:  # on a circle it leaves f open, too
            continue
        found = V[kept].T @ ((U[:, kept].T @ r**2) / s[kept])
        left, free = r**2 - columns @ found, len(r) - int(kept.sum())
        error = np.sqrt((left @ left) / free * ((V[kept, 3] / s[kept]) ** 2).sum())
        if found[3] > SURE * error and found[3] > 0:
            yield float(np.sqrt(found[3])) / size


def _of_changes(log: Log, path: Array) -> Iterator[float]:
    """The least factors of stretches of ranges to one landmark, where these change for sure."""
    for p, r in _of_landmarks(log, path):
        change = r - r.mean()
        spread = float((p**2).sum())
        if spread < MOVES**2 * len(r):
            continue
        # Two directions are linear; across a straight line there is none.
        U, s, _ = np.linalg.svd(p, full_matrices=False)
        along = U[:, s > 1e-3 * s[0]].T @ change
        explained, free = float(along @ along), len(r) - len(along) - 1
        noise = (float(change @ change) - explained) / free
        explained -= len(along) * noise
        if explained > SURE**2 * noise:
            yield float(np.sqrt(explained / spread))


def _like_degrees(log: Log, path: Array) -> bool:
    """Tells if few positions, which stretches tell nothing of, are so near to one another as no noise brings them."""
    if log.fixes is None:
        return False
    rows = np.flatnonzero(~np.isnan(log.fixes.z[:, :2]).any(axis=1))
    if not FEW_FIXES <= len(rows) < FEWEST * LENGTHS[0]:
        return False
    p, q = path[log.fixes.step[rows], :2], log.fixes.z[rows, :2]
    driven, found = (float(np.sqrt(((one - one.mean(axis=0)) ** 2).sum(axis=1).mean())) for one in (p, q))
    return driven > MOVES and 0 < found < ANGULAR * driven


class _Fit(NamedTuple):
    """Positions of a stretch as the robot's path by odometry, turned, and as its mirror image."""

    length: int  # positions
    factor: float  # of the better of both
    left: float  # sum of squares that is left of the path
    mirrored: float  # likewise of its mirror image


def _of_positions(log: Log, path: Array) -> Iterator[_Fit]:
    """Fits the stretches of positions; those whose factor is sure."""
    if log.fixes is None:
        return
    rows = np.flatnonzero(~np.isnan(log.fixes.z[:, :2]).any(axis=1))
    step, z = log.fixes.step[rows], log.fixes.z[rows, :2]
    for stretch in _stretches(len(rows)):
        p, q = path[step[stretch], :2] @ (1, 1j), z[stretch] @ (1, 1j)
        p, q = p - p.mean(), q - q.mean()
        total = float((np.abs(p) ** 2).sum())
        if not total > STANDS**2:
            continue
        fits = [(one.conj() @ q) / total for one in (p, p.conj())]
        lefts = [float((np.abs(q - fit * one) ** 2).sum()) for fit, one in zip(fits, (p, p.conj()), strict=True)]
        best = int(np.argmin(lefts))
        error = np.sqrt(lefts[best] / (2 * (len(p) - 2)) / total)
        if abs(fits[best]) > SURE * error:
            yield _Fit(len(p), float(abs(fits[best])), *lefts)


def _mirrored(log: Log, path: Array) -> bool:
    """Tells if positions are the mirror image of the odometry's path, by the shortest stretches that tell, together."""
    lefts = dict[int, list[tuple[float, float]]]()
    for fit in _of_positions(log, path):
        lefts.setdefault(fit.length, []).append((fit.left, fit.mirrored))
    sums = [np.sum(some, axis=0) for length, some in lefts.items() if length * len(some) >= TELL]
    told = (mirrored < left for left, mirrored in sums if max(left, mirrored) > CLEARLY * min(left, mirrored))
    return bool(next(told, False))


def _of_headings(log: Log) -> Iterator[str]:
    """Says that turns by a compass are the other way round, or those of degrees."""
    if log.fixes is None:
        return
    rows = np.flatnonzero(~np.isnan(log.fixes.z[:, 2]))
    step, z = log.fixes.step[rows], log.fixes.z[rows, 2]
    if len(rows) < 2:
        return
    turns = np.concatenate(([0.0], np.cumsum(log.delta[1:, 2])))
    gaps = [k for k in APART if k < len(z)]
    by_odometry = np.concatenate([turns[step[k:]] - turns[step[:-k]] for k in gaps])
    by_compass = wrap(np.concatenate([z[k:] - z[:-k] for k in gaps]))
    mine = (np.abs(by_odometry) < TURNED) & (np.abs(by_odometry) > LEAST_TURN)
    a, b = by_odometry[mine], by_compass[mine]
    if len(a) < FEWEST:
        return
    slope = float(a @ b / (a @ a))
    left = b - slope * a
    error = float(np.sqrt(left @ left / (len(a) - 1) / (a @ a)))
    if slope < 0 and abs(slope + 1) < 0.5 and SURE * error < 1:
        yield (
            "headings in the world turn the other way round than the odometry: they are clockwise, as a compass's, "
            "which dataset csv takes with headings_from=north"
        )
    elif abs(slope) < OFF * DEGREE and SURE * error < 0.2:
        yield (
            f"headings in the world turn by {number(slope)} times what the odometry turns by: they stand still, or "
            "were converted from degrees twice"
        )


def _stretches(n: int) -> Iterator[slice]:
    for length in LENGTHS:
        for first in range(0, n - length + 1, length):
            yield slice(first, first + length)


def _typical(factors: list[float]) -> float | None:
    """The median of factors that nearly all are far from 1; None of others."""
    if len(factors) < 2 or (len(factors) < FEWEST and max(factors) > 1 / TWO and min(factors) < TWO):
        return None
    low, middle, high = np.quantile(factors, (0.25, 0.5, 0.75)).tolist()
    return middle if low > OFF or high < 1 / OFF else None


def _at_least(factors: list[float]) -> float | None:
    """The size of factors that are at least these, and nearly all far above 1; None of others."""
    if len(factors) < FEWEST:
        return None
    low, high = np.quantile(factors, (0.25, 0.9)).tolist()
    return high if low > OFF else None


def _unit(factor: float, words: str, other: str = "the odometry is") -> str:
    """Names the unit of something that is `factor` times too large, or, below 1, that of the `other`."""
    size = max(factor, 1 / factor)
    near = [name for own, name in FACTORS.items() if name != "km/h" and max(own / size, size / own) < NEARLY]
    if not near:
        return f"the unit of either is wrong, as if {words} not in metres"
    return f"{words} in {near[0]}" if factor > 1 else f"{other} in {near[0]}"
