"""Fits the growth of a step's cost: the exponent b of cost = a + s x^b, x being the step's number or the map's size.

Steps are binned with edges in geometric progression, and each bin is represented by its means, which count rare and
expensive steps (iSAM2 relinearising, an EKF folding in postponed updates) as a median would not. The fit weighs each
bin by how well its mean is known, and down-weights outliers as Huber does (Robust Estimation of a Location Parameter,
Annals of Mathematical Statistics 35(1), 1964): a disturbance of the machine is in few bins.

Of a long log there is also the slope of log cost over log k, with no constant part: how much more a step costs, over
the steps that were driven. What grows with the map stops growing with it, so there is one slope once the map is whole,
and another one before. Its points are means of equal shares of the steps, so that least squares have an interval:
shares are long, and what the costs of neighbouring steps have in common ends within one.
"""

from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array, Ints
from .repeats import student

BINS = 24  # at most; their edges are in geometric progression
LEAST_STEPS = 10  # of a bin: one with fewer is joined with the next
LEAST_BINS = 6  # fewer bins do not justify a fit of three numbers
LEAST_SPAN = 4.0  # the last bin's x over the first one's: over less, an exponent cannot be distinguished from an offset
MOST_ERROR = 0.25  # standard errors above it are too large for an exponent to be reported
CONSTANT = 4.5  # F ratio from which on a constant part is fitted: near the 95 % point for 1 and 15 degrees of freedom
NO_GROWTH = 0.15  # exponents below it count as no growth: ten times the steps cost 1.4 times as much
WHOLE = 0.99  # share of the landmarks from which on the map counts as whole: the last one may be sighted by chance
FLOOR = 0.02  # relative standard deviation of a bin's mean, at least: no cost follows a power exactly
LONG = 1_000  # steps from which on a log is long
MAPPED = 0.6  # share of a log by whose end the map has to be whole: then two fifths of the log have all of it
FIRST_STEPS = 0.05  # share of a long log's steps that are left out: k, and the cost, change much within the first ones
SHARES = 10  # equal shares of a long log's steps: with more, costs that stay high for a while are in several of them
NEAR_0 = 1e-4  # an exponent: k to such a power differs from 1 by less than is measured
EXPONENTS = np.linspace(-2.0, 5.0, 701)  # those that are tried
ROUNDS = 4  # times that a fit is repeated with the weights, or the k of shares, by the one before
HUBER = 1.345  # standard deviations beyond which a bin's weight falls


class Growth(NamedTuple):
    """An exponent with its standard error."""

    exponent: float
    error: float


class Slope(NamedTuple):
    """An exponent with the ends of its 95 % interval."""

    exponent: float
    low: float
    high: float


class _Fit(NamedTuple):
    exponent: float
    error: float
    mean: Array  # (m,) the cost that it expects of each bin
    squares: float  # sum of the squared relative residuals, each over its variance
    residuals: Array  # (m,)


def mapped(log: Log) -> Ints:
    """Counts the landmarks known after every step (n,): those sighted so far by id, and those of a given map."""
    first = np.zeros(len(log), np.int64)
    given = np.zeros(0, np.int64) if log.prior.map is None else log.prior.map.ids
    seen, step = log.ids, log.sighting_step
    if log.partial is not None:
        seen, step = np.concatenate((seen, log.partial.ids)), np.concatenate((step, log.partial.step))
        order = np.argsort(step, kind="stable")
        seen, step = seen[order], step[order]
    ids, row = np.unique(seen, return_index=True)
    new = ~np.isin(ids, given) & (ids != UNKNOWN)
    np.add.at(first, step[row[new]], 1)
    return len(given) + np.cumsum(first)


def whole_from(sizes: Ints) -> int | None:
    """The first step after which WHOLE of all landmarks are known, of `sizes` (n,) after each; None without any."""
    return int(np.searchsorted(sizes, WHOLE * sizes[-1])) if sizes[-1] else None


def slope_from(whole: float | None, steps: float) -> int:
    """The first step of those that a slope is fitted to.

    The map is whole from there on, if it is from a step `whole` on and that is within MAPPED of the log. The log's
    first FIRST_STEPS are left out in any case.
    """
    early = int(whole) if whole is not None and whole <= MAPPED * steps else 0
    return max(int(FIRST_STEPS * steps), early)


def slope_mapping(cost: Array | Ints, whole: int | None) -> Slope | None:
    """The slope over the steps before `whole`, in which the map grows, without their first FIRST_STEPS.

    None where these are fewer than LONG, or the map is not whole early enough for a slope afterwards.
    """
    if whole is None or whole > MAPPED * len(cost):
        return None
    return slope(cost[:whole], int(FIRST_STEPS * whole))


def slope(cost: Array | Ints, start: int) -> Slope | None:
    """Fits the exponent b of cost = s k^b to the costs (n,) of a log's steps k, counted from 1, after `start` of them.

    Least squares through the logarithms of the means of SHARES; the k of a share is the one that costs its mean by that
    power. The interval is Student's, and wider where the costs follow no power. None for a log of fewer than LONG
    steps, and where a share's mean is not above 0.
    """
    if len(cost) < LONG:
        return None
    mean = np.array([part.mean() for part in np.array_split(cost[start:], SHARES)])
    if (mean <= 0).any():
        return None
    shares = np.array_split(np.log(np.arange(start + 1, len(cost) + 1)), SHARES)
    exponent, variance = 1.0, 0.0
    for _ in range(ROUNDS):
        (exponent, _), cov = np.polyfit([_representative(one, exponent) for one in shares], np.log(mean), 1, cov=True)
        variance = cov[0, 0]
    reach = student(SHARES - 2) * variance**0.5
    return Slope(float(exponent), float(exponent - reach), float(exponent + reach))


def _representative(log_k: Array, exponent: float) -> float:
    """The logarithm of the k whose power is the mean of all of them; of a power near 0 the limit."""
    if abs(exponent) < NEAR_0:
        return float(log_k.mean())
    return float(np.log(np.exp(exponent * log_k).mean()) / exponent)


def growth(x: Ints, cost: Array | Ints) -> Growth | None:
    """Fits the exponent with which the mean of `cost` (n,) grows with `x` (n,), and its standard error.

    A constant part is fitted where that is significantly better. The standard error is the half-width of the exponents
    whose fit is worse by at most one residual variance. None where x covers too little, or where the error would be
    above MOST_ERROR.
    """
    at, mean, variance = binned(x, cost)
    if len(at) < LEAST_BINS or at[-1] < LEAST_SPAN * at[0] or (mean <= 0).any():
        return None
    sampled = 1 / (FLOOR**2 + variance)
    power = (at / at[-1]) ** EXPONENTS[:, None]  # (e, m)
    found = _fit(power, mean, mean, sampled)
    for _ in range(ROUNDS):
        off = np.abs(found.residuals) * np.sqrt(sampled)
        scale = max(1.4826 * float(np.median(off)), 1.0)
        weights = sampled * np.minimum(1.0, HUBER * scale / np.maximum(off, HUBER))
        found = _fit(power, mean, found.mean, weights)
    return Growth(found.exponent, found.error) if found.error <= MOST_ERROR else None


def binned(x: Ints, cost: Array | Ints) -> tuple[Array, Array, Array]:
    """Each bin's mean x, mean cost and relative variance of that mean cost, by x; x = 0 is left out.

    A step's variance, relative to its bin's mean, is taken to be the same in all bins: a small bin does not know its
    own.
    """
    order = np.argsort(x, kind="stable")
    order = order[x[order] > 0]
    if not len(order):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    sizes, costs = x[order].astype(float), cost[order].astype(float)
    edges = np.searchsorted(sizes, np.geomspace(sizes[0], sizes[-1], BINS + 1)[1:-1], side="right")
    starts = [0]
    for edge in edges.tolist():
        if edge - starts[-1] >= LEAST_STEPS and len(sizes) - edge >= LEAST_STEPS:
            starts.append(edge)
    counts = np.diff([*starts, len(sizes)])
    mean = np.add.reduceat(costs, starts) / counts
    relative = costs / np.repeat(np.maximum(mean, 1e-300), counts) - 1
    return np.add.reduceat(sizes, starts) / counts, mean, float((relative**2).mean()) / counts


def _fit(power: Array, y: Array, unit: Array, weights: Array) -> _Fit:
    """Fits with a constant part where the F ratio demands it, else without; the error accounts for both.

    So an exponent that might be another with a constant part is not reported as well known. Without growth there is
    nothing to distinguish from a constant.
    """
    sums = _sums(power, y, unit, weights)
    plain, full = (_profile(sums, constant=constant) for constant in (False, True))
    if (plain.squares - full.squares) * (len(y) - 3) > CONSTANT * full.squares:
        return full
    if abs(plain.exponent) < max(2 * plain.error, NO_GROWTH):
        return plain
    return plain._replace(error=float(np.hypot(full.error, full.exponent - plain.exponent)))


class _Sums(NamedTuple):
    """The sums of a fit of y by a + s power, each residual in units of `unit`."""

    unit: Array  # (m,)
    weights: Array  # (m,)
    u: Array  # (m,) a residual is a u + s v - z
    v: Array  # (e, m) for each of the exponents
    z: Array  # (m,)
    uu: float
    uv: Array  # (e,)
    vv: Array
    uz: float
    vz: Array


def _sums(power: Array, y: Array, unit: Array, w: Array) -> _Sums:
    u, v, z = 1 / unit, power / unit, y / unit
    uu, uv, vv = (w * u * u).sum(), (w * u * v).sum(axis=1), (w * v * v).sum(axis=1)
    return _Sums(unit, w, u, v, z, uu, uv, vv, (w * u * z).sum(), (w * v * z).sum(axis=1))


def _profile(sums: _Sums, *, constant: bool) -> _Fit:
    """Finds the least-squares exponent, with the best constant and slope for each, neither of them negative."""
    unit, w, u, v, z, uu, uv, vv, uz, vz = sums
    a, s = np.zeros(len(EXPONENTS)), vz / vv
    if constant:
        determinant = uu * vv - uv**2
        proper = determinant > 1e-9 * uu * vv  # an exponent of 0 is a constant itself
        divisor = np.where(proper, determinant, 1.0)
        both_a, both_s = (uz * vv - vz * uv) / divisor, (vz * uu - uz * uv) / divisor
        inside = proper & (both_a > 0) & (both_s > 0)
        a, s = np.where(inside, both_a, a), np.where(inside, both_s, s)
    fitted = a[:, None] * u + s[:, None] * v
    residuals = fitted - z
    squares = (w * residuals**2).sum(axis=1)
    best = int(squares.argmin())
    variance = max(squares[best] / (len(z) - 2 - constant), 1.0)  # 1: what the steps' own scatter makes
    near = EXPONENTS[squares <= squares[best] + variance]
    step = EXPONENTS[1] - EXPONENTS[0]
    error = max((near[-1] - near[0]) / 2, step / 2)
    at_the_end = near[0] == EXPONENTS[0] or near[-1] == EXPONENTS[-1]
    error = float("inf") if at_the_end else float(error)
    return _Fit(float(EXPONENTS[best]), error, fitted[best] * unit, squares[best], residuals[best])
