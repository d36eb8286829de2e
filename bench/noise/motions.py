"""Errors of the odometry by the true path: factors on the stated standard deviations, over several horizons."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Dataset, Log, Truth
from ...core.se2 import Array, Ints
from ...core.truth.errors import odometry_errors
from ..systematic.estimated import Estimated
from .likelihood import maximum

AXES = ("forward", "sideways", "turn")

HORIZONS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""s over which errors are accumulated, beside single steps."""

FEWEST = 20  # fewest stretches of a horizon for its factors

TOLD = 2.0
"""A factor is told by a horizon where the ends of its interval differ by less than this many times."""

_PAIRS = [(i, j) for i in range(3) for j in range(i + 1)]


class Horizon(NamedTuple):
    """Factors on the stated standard deviations that the errors accumulated over a time ask for."""

    seconds: float  # the stretches' median duration
    stretches: int
    scales: Sequence[Estimated]  # (3,) forward, sideways, turn


class Motions(NamedTuple):
    """The noise of odometry."""

    horizons: Sequence[Horizon]  # single steps first
    scales: Sequence[Estimated]  # (3,) those to state: of the longest horizon that matters and tells them
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


def _told(horizons: Sequence[Horizon], axis: int, matters: float) -> Estimated:
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
    """Stretches of `horizon` s, or of single steps for 0, along which the true path is known, none overlapping.

    Errors are added axis by axis, in the body's frame of their step: a turn's error is no error of what is driven
    later, and sums are exact where composed motions would be so to first order alone.
    """
    row, values = odometry_errors(log, truth)
    errors, known = np.zeros((len(log), 3)), np.zeros(len(log))
    errors[row], known[row] = values, 1.0
    split = np.zeros((len(_PAIRS), 3, 3))
    for k, (i, j) in enumerate(_PAIRS):
        split[k, i, j] = split[k, j, i] = 1.0
    parts = np.concatenate((np.zeros((1, 3, 3)), log.delta_cov[1:]))[:, None] * split
    first, last = _ends(log, horizon)
    errors, known, parts = (np.cumsum(column, axis=0) for column in (errors, known, parts))
    whole = known[last] - known[first] == last - first
    first, last = first[whole], last[whole]
    return _Stretches(errors[last] - errors[first], parts[last] - parts[first], log.t[last] - log.t[first])


def _ends(log: Log, horizon: float) -> tuple[Ints, Ints]:
    """First and last step of every stretch; those of up to twice the horizon where steps are long."""
    if horizon == 0.0:
        return np.arange(len(log) - 1), np.arange(1, len(log))
    found = [0]
    while (end := max(int(np.searchsorted(log.t, log.t[found[-1]] + horizon - 1e-9)), found[-1] + 1)) < len(log):
        found.append(end)
    ends = np.array(found)
    fair = np.diff(log.t[ends]) <= 2 * horizon
    return ends[:-1][fair], ends[1:][fair]


def _joined(several: Sequence[_Stretches]) -> _Stretches:
    return _Stretches(*(np.concatenate(columns) for columns in zip(*several, strict=True)))
