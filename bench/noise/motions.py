"""Errors of the odometry by the true path: factors on the stated standard deviations, over several horizons."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...frontend.dead_reckoning import dead_reckoned
from ...frontend.factors import Dataset, Log, Truth
from ...frontend.se2 import Array, Ints, between
from ...frontend.truth_errors import difference, rows_of
from ...frontend.wheels.encoder import Floors, compose
from .likelihood import Estimate, maximum

AXES = ("forward", "sideways", "turn")

HORIZONS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""s over which errors are accumulated, beside single steps."""

FEWEST = 20
"""Fewest stretches of a horizon for its factors."""

TOLD = 2.0
"""A factor is told by a horizon where the ends of its interval differ by less than this many times."""

_PAIRS = [(i, j) for i in range(3) for j in range(i + 1)]


class Horizon(NamedTuple):
    """Factors on the stated standard deviations that the errors accumulated over a time ask for."""

    seconds: float  # the stretches' median duration
    stretches: int
    scales: Sequence[Estimate]  # (3,) forward, sideways, turn


class Motions(NamedTuple):
    """The noise of odometry."""

    horizons: Sequence[Horizon]  # single steps first
    scales: Sequence[Estimate]  # (3,) those to state: of the longest horizon that matters and tells them
    matters: float  # s over which the odometry has to bear the pose between independent looks at landmarks
    errors: Array  # (n, 3) of single steps, over their stated standard deviations
    t: Array  # (n,) s, of the first log's start, log after log


class _Stretches(NamedTuple):
    """Accumulated errors (m, 3) and the parts (m, 6, 3, 3) of their stated covariance, one per pair of axes."""

    errors: Array
    parts: Array
    seconds: Array  # (m,)


def fitted_motions(datasets: Sequence[Dataset], matters: float) -> Motions | None:
    """Fits the factors by the true paths of `datasets`; None for too few errors.

    The factors to state are those of the horizon nearest to `matters` seconds: errors that are independent from step to
    step ask for the same at every horizon, and of others no factor holds at all of them.
    """
    known = [(log, truth) for log, truth in datasets if truth is not None]
    single = _joined([_stretches(log, truth, 0.0) for log, truth in known])
    if len(single.errors) < FEWEST:
        return None
    horizons = [_horizon(single)]
    for seconds in HORIZONS:
        if seconds > 1.5 * horizons[-1].seconds:
            more = _joined([_stretches(log, truth, seconds) for log, truth in known])
            if len(more.errors) >= FEWEST:
                horizons.append(_horizon(more))
    stated = np.sqrt(np.einsum("mpii->mi", single.parts))
    scales = [_told(horizons, axis, matters) for axis in range(3)]
    return Motions(horizons, scales, matters, single.errors / stated, np.cumsum(single.seconds))


def scaled(cov: Array, scales: Array) -> Array:
    """Covariances (n, 3, 3) with the standard deviations of their axes times `scales` (3,)."""
    return cov * np.outer(scales, scales)


def _told(horizons: Sequence[Horizon], axis: int, matters: float) -> Estimate:
    """The factor of the longest horizon that tells it, up to about `matters` s."""
    best = horizons[0].scales[axis]
    for one in horizons[1:]:
        found = one.scales[axis]
        if one.seconds <= 1.5 * matters and found.high < TOLD * found.low:
            best = found
    return best


def _horizon(stretches: _Stretches) -> Horizon:
    errors, parts = stretches.errors, stretches.parts
    whole = parts.sum(axis=1)
    units = np.sqrt(np.einsum("mii->mi", whole))
    pairs = np.array(_PAIRS)

    def log_likelihood(p: Array) -> float:
        cov = np.einsum("k,mkij->mij", np.exp(p[pairs].sum(axis=1)), parts)
        squares = np.einsum("mi,mi->m", errors, np.linalg.solve(cov, errors[..., None])[..., 0])
        return -0.5 * float(squares.sum() + np.linalg.slogdet(cov)[1].sum())

    start = np.log(np.sqrt(np.mean((errors / units) ** 2, axis=0)) + 1e-6)
    best = maximum(log_likelihood, start, start - 7, start + 7)
    scales = [best.estimate(axis, lambda p: float(np.exp(p))) for axis in range(3)]
    return Horizon(float(np.median(stretches.seconds)), len(errors), scales)


def _stretches(log: Log, truth: Truth, horizon: float) -> _Stretches:
    """Stretches of `horizon` s, or of single steps for 0, whose ends both have a true pose, none overlapping."""
    at = rows_of(truth.t, log.t)
    first, last = _ends(log, at, horizon)
    driven = dead_reckoned(log)
    errors = difference(between(driven[first], driven[last]), between(truth.poses[at[first]], truth.poses[at[last]]))
    split = np.zeros((len(_PAIRS), 3, 3))
    for k, (i, j) in enumerate(_PAIRS):
        split[k, i, j] = split[k, j, i] = 1.0
    pieces = log.delta_cov[:, None] * split
    if horizon == 0.0:
        return _Stretches(errors, pieces[last], log.t[last] - log.t[first])
    parts = np.empty((len(first), len(_PAIRS), 3, 3))
    for k, (a, b) in enumerate(zip((first + 1).tolist(), (last + 1).tolist(), strict=True)):
        motions = np.broadcast_to(log.delta[a:b], (len(_PAIRS), b - a, 3))
        parts[k] = compose(motions, pieces[a:b].swapaxes(0, 1), Floors(0.0, 0.0)).cov
    return _Stretches(errors, parts, log.t[last] - log.t[first])


def _ends(log: Log, at: Ints, horizon: float) -> tuple[Ints, Ints]:
    """First and last step of every stretch."""
    if horizon == 0.0:
        first = np.arange(len(log) - 1)
    else:
        first = np.unique(np.searchsorted(log.t, np.arange(log.t[0], log.t[-1] - horizon, horizon)))
    last = np.minimum(np.searchsorted(log.t, log.t[first] + horizon - 1e-9), len(log) - 1)
    last = np.maximum(last, np.minimum(first + 1, len(log) - 1))
    right = (at[first] >= 0) & (at[last] >= 0) & (last > first)
    if horizon > 0:
        right &= log.t[last] - log.t[first] <= 2 * horizon
    first, last = first[right], last[right]
    apart = np.ones(len(first), bool)
    end = -1
    for k in range(len(first)):
        apart[k] = first[k] >= end
        end = last[k] if apart[k] else end
    return first[apart], last[apart]


def _joined(several: Sequence[_Stretches]) -> _Stretches:
    return _Stretches(*(np.concatenate(columns) for columns in zip(*several, strict=True)))
