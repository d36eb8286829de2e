"""Scale and offset of ranges alone, with intervals: by true paths and places, or around the batch optimum.

Of a range z to a landmark at the distance d, z - d = scale d + offset. Along a true path that is a line; outliers weigh
less, as with a Cauchy loss in robust standard deviations. Without a path both are variables of the batch, next to
unknown, and it is the wheels' way that tells how long a range should be. Intervals are a jackknife's over stretches of
time, as errors of ranges stay for seconds.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from ...backends.api import Diverged, Solution
from ...backends.graphs.graph_options import Options
from ...backends.graphs.own_batch import optimum
from ...core.factors import Dataset, Log, Truth
from ...core.factors import Systematic as Stated
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ...core.truth.errors import named, partial_errors
from ...datasets.noise.systematic import Systematic
from .estimated import Estimated
from .fit import CERTAIN, FEWEST, LEAST, SystematicFit

STRETCHES, RESOLVED = 20, 8
"""Of time that are left out in turn: along a true path, and where each is a batch of its own."""

VAGUE = (0.3, 3.0)  # standard deviations of scale and offset, m, that the batch begins with
NAMES = ("range_scale", "range_offset")
ROUNDS, CAUCHY, ROBUST = 20, 2.3849, 1.4826
"""Rounds of weights; their scale, of 95 % efficiency; a normal standard deviation over the median absolute value."""

Solve = Callable[[Sequence[str], int], Array]
"""(2,) scale and offset, those that are free, without one of the stretches; -1: with all."""


def of_ranges(known: Sequence[Dataset]) -> SystematicFit | None:
    """By the true paths and places of logs; None for less than FEWEST ranges alone."""
    found = [_along(log, truth) for log, truth in known if truth is not None]
    found = [one for one in found if one is not None]
    if not found:
        return None
    d, off, ids, part = (np.concatenate(column) for column in zip(*found, strict=True))
    if len(d) < FEWEST:
        return None
    fit = _sure(_line(d, off, part), STRETCHES, CERTAIN)
    free = [name for name in NAMES if name in fit.certain or name == "range_scale"]
    each = dict[int, Mapping[str, Estimated]]()
    for landmark in np.unique(ids).tolist():
        mine = ids == landmark
        if mine.sum() >= FEWEST and len(np.unique(part[mine])) > 2:
            each[landmark] = _estimates(_line(d[mine], off[mine], part[mine]), free, STRETCHES)
    return fit._replace(each=each)


def along_line(d: Array, off: Array, free: Sequence[str]) -> Array:
    """(2,) scale and offset, m, of ranges longer by `off` (k,), m, at distances `d` (k,); 0 of what is not `free`."""
    return _line(d, off, np.zeros(len(d), np.int64))(free, -1)


def _along(log: Log, truth: Truth) -> tuple[Array, Array, Ints, Ints] | None:
    """Distances, what ranges are longer by, landmarks and stretches (k,) of the ranges alone of a log."""
    log = named(log, truth)
    row, error = partial_errors(log, truth)
    if log.partial is None or not len(row):
        return None
    mine = np.flatnonzero(log.partial.kind[row] == RANGE)
    row, error = row[mine], error[mine]
    t = log.t[log.partial.step[row]]
    return log.partial.z[row] - error, error, log.partial.ids[row], stretches(t, STRETCHES)


def stretches(t: Array, number: int) -> Ints:
    """(k,) the stretch of each time."""
    if not len(t):
        return np.zeros(0, np.int64)
    span = max(float(np.ptp(t)), 1e-9)
    return np.minimum(((t - t.min()) / span * number).astype(np.int64), number - 1)


def _line(d: Array, off: Array, part: Ints) -> Solve:
    """A robust line through (d, off), without one of the stretches."""

    def solve(free: Sequence[str], without: int) -> Array:
        kept = part != without
        columns = np.column_stack((d, np.ones_like(d)))[kept]
        at = [NAMES.index(name) for name in free]
        out, weight = np.zeros(2), np.ones(kept.sum())
        for _ in range(ROUNDS if at else 0):
            A = columns[:, at] * weight[:, None]
            out[at] = np.linalg.lstsq(A.T @ columns[:, at], A.T @ off[kept], rcond=None)[0]
            e = off[kept] - columns @ out
            sd = max(ROBUST * float(np.median(np.abs(e))), LEAST)
            weight = 1 / (1 + (e / (CAUCHY * sd)) ** 2)
        return out

    return solve


def _estimates(solve: Solve, free: Sequence[str], stretches: int) -> dict[str, Estimated]:
    found, size = _with_errors(solve, free, stretches)
    half = float(student.ppf(0.975, stretches - 1)) * size
    at = {name: NAMES.index(name) for name in free}
    return {
        name: Estimated(float(found[k]), float(found[k] - half[k]), float(found[k] + half[k])) for name, k in at.items()
    }


def _with_errors(solve: Solve, free: Sequence[str], stretches: int) -> tuple[Array, Array]:
    """Scale and offset (2,) and their standard errors."""
    off = np.array([solve(free, b) for b in range(stretches)])
    return solve(free, -1), np.sqrt((stretches - 1) / stretches * ((off - off.mean(axis=0)) ** 2).sum(axis=0))


def _sure(solve: Solve, stretches: int, least_ratio: float, *, by_truth: bool = True) -> SystematicFit:
    """Those that are so many standard errors from 0; the least one is left out first, and estimated with the other."""
    free, every = list(NAMES), dict[str, Estimated]()
    while free:
        estimates = _estimates(solve, free, stretches)
        every = estimates | every
        found, size = _with_errors(solve, free, stretches)
        ratio = {name: abs(found[k]) / max(size[k], LEAST) for name in free for k in [NAMES.index(name)]}
        least = min(free, key=ratio.__getitem__)
        if ratio[least] >= least_ratio:
            every |= estimates
            break
        free.remove(least)
    errors = Systematic(**{name: every[name].value for name in free})
    return SystematicFit(errors, every, by_truth, True)


def around_optimum(log: Log) -> SystematicFit | None:
    """By the log alone, as variables of its batch; None where that has no optimum or ranges alone are too few."""
    table = log.partial
    if table is None or (table.kind == RANGE).sum() < FEWEST:
        return None
    part = stretches(log.t[table.step], RESOLVED)
    seen = dict[tuple[tuple[str, ...], int], Array]()

    def solve(free: Sequence[str], without: int) -> Array:
        key = tuple(free), without
        if key not in seen:
            seen[key] = _solved(replace(log, partial=table.rows(part != without)), free)
        return seen[key]

    try:
        return _sure(solve, RESOLVED, CERTAIN, by_truth=False)
    except Diverged:
        return None


def _solved(log: Log, free: Sequence[str]) -> Array:
    """Scale and offset (2,) at the optimum; 0 of what is not free."""
    scale, offset = (sd if name in free else 0.0 for name, sd in zip(NAMES, VAGUE, strict=True))
    unknown = Stated(range_scale=scale, range_offset=offset)
    found = best(replace(log, prior=log.prior._replace(systematic=unknown))).constant
    return np.zeros(2) if found is None else np.array((found.range_scale[0], found.range_offset[0]))


def best(log: Log) -> Solution:
    """The batch optimum with a Cauchy loss."""
    return optimum(log.prior, Options(loss="cauchy", joint_up_to=0), list(log))
