"""Finds landmarks whose known place and estimate do not belong together: exchanged ids, and single ones far off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ...core.factors import UNKNOWN, Log, Map
from ...core.se2 import Array, Ints, act, wrap
from ...core.truth.errors import rows_of
from .accuracy import align, own_map_rmse

FEWEST = 5  # landmarks of which most must fit for one to be odd
PAIRS = 1_000  # pairs of landmarks that are laid upon one another; all of them for up to 45 landmarks
RAYLEIGH = 1.1774  # the median of a distance in the plane, in standard deviations of a coordinate
FEW = 5.0  # over the landmarks less two: by how much more their errors are than those left by a fit (Rousseeuw, 1987)
APART = 6.0  # standard deviations from which on a landmark does not fit at its place
OTHER = 3.0  # likewise, of one that fits at another's
NEARER = 0.2  # of the distance from its own place within which one exchanged with others is of theirs
MOST = 0.5  # share of the landmarks below which are exchanged: the others tell where all are
ODD = 0.15  # share, and one more, of those that may not fit elsewhere either
BEYOND = 6.0  # times the largest error of the others from which on one is far off, of many landmarks
ROUNDS = 20  # of least squares over those that fit, the most


class Exchanged(NamedTuple):
    """Landmarks that fit at one another's places."""

    ids: tuple[tuple[int, ...], ...]  # cycles: each is where the next one should be, the last where the first should
    before: float  # m, the map's error as it is, aligned by itself
    after: float  # likewise with the ids exchanged


class Astray(NamedTuple):
    """Landmarks that are far off where the others fit."""

    ids: tuple[int, ...]  # the farthest first
    errors: tuple[float, ...]  # m
    others: int
    typical: float  # m, median of the others
    most: float  # m, largest


class Misplaced(NamedTuple):
    """The landmarks of a map that do not fit."""

    exchanged: Exchanged | None
    astray: Astray | None


def misplaced(found: Map, known: Map, sd: Array | None = None) -> Misplaced:
    """Compares a map with the known one; `sd` (n,), m: how well a single sighting tells each of its landmarks.

    Stated noise counts as it is relative to one another: its size is that of the errors of the others.
    """
    ids, mine, theirs = np.intersect1d(found.ids, known.ids, return_indices=True)
    here, there = found.xy[mine], known.xy[theirs]
    finite = np.isfinite(here).all(axis=1)
    ids, here, there = ids[finite], here[finite], there[finite]
    if len(ids) < FEWEST:
        return Misplaced(None, None)
    own = np.zeros(len(ids)) if sd is None else sd[mine][finite]
    moved = laid(here, there)
    cycles = _cycles(moved, there, own)
    belongs = np.arange(len(ids))
    for cycle in cycles:
        belongs[cycle] = np.roll(cycle, -1)
    exchanged = None
    if cycles:
        moved = laid(here, there[belongs])
    off = np.hypot(*(moved - there[belongs]).T)
    odd = off > APART * _sd(off, own, least=1.0)
    if odd.sum() > ODD * len(ids) + 1:
        return Misplaced(None, None)
    if cycles:
        rmse = [own_map_rmse(Map(ids, here, None), Map(ids, xy, None)) for xy in (there, there[belongs])]
        names = tuple(tuple(ids[cycle].tolist()) for cycle in cycles)
        exchanged = Exchanged(names, rmse[0] or 0.0, rmse[1] or 0.0)
    return Misplaced(exchanged, _astray(ids, off, odd))


def put_right(known: Map, exchanged: Exchanged) -> Map:
    """The known map with the ids exchanged."""
    xy = known.xy.copy()
    for cycle in exchanged.ids:
        row = rows_of(known.ids, np.array(cycle))
        xy[row] = known.xy[np.roll(row, -1)]
    return Map(known.ids, xy, None)


def told(log: Log, ids: Ints) -> Array:
    """The stated standard deviation (n,), m, of the best sighting of each landmark: 0 of those never sighted."""
    known = log.ids != UNKNOWN
    sd = across(log)[known]
    names, of = np.unique(log.ids[known], return_inverse=True)
    least = np.full(len(names), np.inf)
    np.minimum.at(least, of, sd)
    row = rows_of(names, ids)
    return np.where(row >= 0, least[row] if len(names) else 0.0, 0.0)


def across(log: Log) -> Array:
    """The stated standard deviation (s,), m, of each sighting's point, along or across, the larger."""
    return np.sqrt(np.maximum(log.z_cov[:, 0, 0], log.z[:, 0] ** 2 * log.z_cov[:, 1, 1]))


def laid(here: Array, there: Array) -> Array:
    """Lays points (n, 2) on others where most of them fit, and returns them: least median, then least squares."""
    n = len(here)
    first, second = np.triu_indices(n, 1)
    if len(first) > PAIRS:
        chosen = np.random.default_rng(0).choice(len(first), PAIRS, replace=False)
        first, second = first[chosen], second[chosen]
    one, other = here[second] - here[first], there[second] - there[first]
    turn = np.arctan2(other[:, 1], other[:, 0]) - np.arctan2(one[:, 1], one[:, 0])
    middles = [(points[first] + points[second]) / 2 for points in (here, there)]
    motions = np.column_stack((np.zeros((len(turn), 2)), wrap(turn)))
    motions[:, :2] = middles[1] - act(motions, middles[0])
    half = n // 2
    off = [float(np.partition(np.hypot(*(_moved(motion, here) - there).T), half)[half]) for motion in motions]
    moved = _moved(motions[int(np.argmin(off))], here)
    fits = np.zeros(n, bool)
    for _ in range(ROUNDS):
        distance = np.hypot(*(moved - there).T)
        now = distance <= 3 * np.median(distance) / RAYLEIGH
        if (now == fits).all():
            break
        fits = now
        moved = _moved(align(here[fits], there[fits]).motion, here)
    return moved


def _moved(motion: Array, xy: Array) -> Array:
    return act(np.broadcast_to(motion, (len(xy), 3)), xy)


def _sd(off: Array, own: Array, least: float = 0.0) -> Array:
    """The standard deviation (n,), m, of a coordinate of errors of sizes `off` (n,), by those of most.

    Sightings of `own` (n,) standard deviations are taken to be as much better or worse, but not better than `least`
    times that: a landmark may have been sighted once.
    """
    few = _few(len(off)) / RAYLEIGH
    known = own > 0
    scale = few * float(np.median(off[known] / own[known])) if known.any() else 0.0
    return np.maximum(few * float(np.median(off)), max(scale, least) * own)


def _few(n: int) -> float:
    """By how much larger than what a fit leaves the errors of `n` landmarks are: it takes some of those of few."""
    return 1 + FEW / (n - 2)


def _cycles(moved: Array, there: Array, own: Array) -> list[Ints]:
    """The rows of landmarks that are exchanged, each group of them in the order of its cycle."""
    off = np.hypot(*(moved - there).T)
    odd = np.flatnonzero(off > OTHER * _sd(off, own))
    if len(odd) < 2:
        return []
    apart = np.hypot(*(moved[odd][:, None] - there[odd][None]).transpose(2, 0, 1))
    _, place = linear_sum_assignment(apart)
    near = apart[np.arange(len(odd)), place]
    good: NDArray[np.bool_] = near < NEARER * off[odd]
    found: list[Ints] = []
    left = set(np.flatnonzero(good & (place != np.arange(len(odd)))).tolist())
    while left:
        cycle = [min(left)]
        while int(place[cycle[-1]]) in left - {*cycle}:
            cycle.append(int(place[cycle[-1]]))
        if int(place[cycle[-1]]) == cycle[0] and len(cycle) > 1:
            found.append(odd[cycle])
        left -= {*cycle}
    return found if sum(map(len, found)) < MOST * len(off) else []


def _astray(ids: Ints, off: Array, odd: NDArray[np.bool_]) -> Astray | None:
    rest = off[~odd]
    far = np.flatnonzero(odd & (off > BEYOND * _few(len(off)) * rest.max()))
    if not len(far):
        return None
    far = far[np.argsort(-off[far], kind="stable")]
    others = np.delete(off, far)
    return Astray(
        tuple(ids[far].tolist()), tuple(off[far].tolist()), len(others), float(np.median(others)), float(others.max())
    )
