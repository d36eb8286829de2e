"""Tests differences between backends: paired by log, with intervals, failures counted as the worst.

Nothing is drawn at random, so the same errors always give the same answer. An infinite error stands for a failure:
worse than every other error and as bad as another failure. It has the largest rank; an interval that it reaches into
has an infinite end, or one of 0 as a ratio.

Logs may belong to units that alone are independent of each other (`units.py`). Each unit then counts once, with the
estimate from its own logs, and everything below is over units: a test flips the signs of whole units. A log without
units is one by itself. `python -m slamduel.bench.verdict.simulation` measures how often intervals
and claims are right.
"""

from bisect import bisect_right
from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import combinations
from math import comb, erfc, exp, isfinite, lgamma, log, sqrt
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from .units import INDEPENDENT, Units

FEWEST = 6  # units below which no signed-rank test has p below 5 %, and no interval of a median covers 95 %
LEVEL = 0.05  # accepted share of false claims
SAME = 1e-9  # errors whose logarithms differ by less are the same: rounding always points one way
EXACT = 100  # units up to which distributions are exact; beyond, the signed-rank statistic's is normal


STUDENT = {2: 12.706205, 3: 4.302653, 4: 3.182446, 5: 2.776445}
"""The 97.5 % points of Student's t for so many units, one more than its degrees of freedom."""

OfLogs = Sequence[Hashable] | None  # the unit of each value; None: each is one by itself


class Estimate(NamedTuple):
    """The median over logs, and its 95 % interval: NaN ends where there are fewer than FEWEST units."""

    value: float
    low: float
    high: float
    n: int  # logs
    units: int


class Shift(NamedTuple):
    """The typical difference of paired values."""

    value: float  # NaN with none
    low: float  # 95 % interval; NaN where there are fewer than FEWEST logs, or one unit
    high: float
    p: float  # two-sided Wilcoxon signed-rank, of a difference from `against`; NaN with fewer than FEWEST units
    effect: float  # matched-pairs rank-biserial correlation; likewise
    n: int
    units: int


class Comparison(NamedTuple):
    """Two backends on the same logs."""

    first: str
    second: str
    n: int  # logs that both ran on
    closer: int  # logs on which the first one's error is the lower
    ratio: float  # the second's error over the first's, typically: see compare; NaN with no log
    low: float  # 95 % interval of the ratio, from 0 to infinity; NaN with fewer than FEWEST logs, or one unit
    high: float
    p: float  # two-sided Wilcoxon signed-rank; NaN where there are fewer than FEWEST units
    adjusted: float  # the same after Holm's correction over all pairs that were compared
    effect: float  # matched-pairs rank-biserial correlation: 1 where the first is closer on every unit, -1 on none
    units: int  # independent ones that the logs are of: as many as logs unless these are in clusters

    @property
    def holds(self) -> bool:
        """True where a difference may be claimed: both the test and the interval say so."""
        return self.adjusted < LEVEL and not self.low <= 1 <= self.high


def estimate(values: Sequence[float], units: OfLogs = None) -> Estimate:
    """Estimates the median of one value per log, none NaN, with an interval between order statistics.

    Of logs in units, it is that of the units' medians.

    Hettmansperger and Sheather, Confidence intervals based on interpolated order statistics (Statistics and Probability
    Letters 4, 1986): from the two nested intervals whose coverage, a binomial sum whatever the distribution, is next
    above and below 95 %. Infinite values are taken as they are.
    """
    known = np.asarray(values, float)
    logs = len(known)
    if (groups := _groups(known, units)) is not None:
        known = np.array([_middle(np.sort(group)) for group in groups])
    known = np.sort(known)
    n = len(known)
    low = high = np.nan
    if n >= FEWEST:
        depth, share = _depth(n)
        low = _between(known[depth - 1], known[depth], share)
        high = _between(known[n - depth], known[n - depth - 1], share)
    return Estimate(_middle(known), low, high, logs, n)


def median(values: Iterable[float]) -> float:
    """The median of values of any size, one at least, none NaN; infinite ones are as `estimate` takes them."""
    ranked = sorted(values)
    low, high = ranked[(len(ranked) - 1) // 2], ranked[len(ranked) // 2]
    return (low + high) / 2 if isfinite(low + high) else _middle(np.array((low, high)))


def median_over(values: Mapping[str, float], units: Units) -> float:
    """The median of values by log, one at least: of logs in clusters, that of the units' medians."""
    by_unit: dict[Hashable, list[float]] = {}
    for name, value in values.items():
        by_unit.setdefault(units.unit(name), []).append(value)
    return median(median(group) for group in by_unit.values())


def compare(errors: Mapping[str, Mapping[str, float]], units: Units = INDEPENDENT) -> list[Comparison]:
    """Compares every pair of backends; `errors`, from 0 to infinity, are by backend and by log.

    Each pair is in the order of the mapping. On each log that both ran on, the logarithm of the ratio of their errors
    is taken. The typical one is the median of the averages of every two of these (Hodges and Lehmann, Annals of
    Mathematical Statistics 34(2), 1963), and its interval holds those that the exact signed-rank test does not reject:
    it keeps its coverage at every number of logs, where a bootstrap's falls short below 20, and without ties it
    excludes 1 exactly where p is below 5 %. Logs on which both have the same error, or both fail, are ranked with the
    others and support neither (Pratt, Journal of the American Statistical Association 54, 1959); leaving them out would
    make nearly identical backends differ. Ties share their ranks, and the test's distribution is that of the ranks as
    they are; the interval then covers more than 95 %.
    """
    found = [_paired(first, second, errors[first], errors[second], units) for first, second in combinations(errors, 2)]
    adjusted = holm([c.p for c in found])
    return [c._replace(adjusted=float(p)) for c, p in zip(found, adjusted, strict=True)]


def holm(p: Sequence[float]) -> Array:
    """Applies Holm's step-down correction (Scandinavian Journal of Statistics 6(2), 1979); NaN stay, uncounted."""
    values = np.asarray(p, float)
    known = np.flatnonzero(np.isfinite(values))
    order = known[np.argsort(values[known], kind="stable")]
    adjusted = np.full(len(values), np.nan)
    adjusted[order] = np.minimum(1, np.maximum.accumulate(values[order] * np.arange(len(order), 0, -1)))
    return adjusted


def shift(differences: Array, against: float = 0.0, units: OfLogs = None) -> Shift:
    """Estimates the shift of paired differences (n,), infinite ones included; less than SAME is rounding.

    Of logs in units, it is that of the units' own shifts. Where there are 2 to 5 of these, no test by their signs can
    reach 5 %, and the interval is Student's t of the units' shifts: it covers at least as often as stated also where
    they are not equally exact (Ibragimov and Mueller, Journal of Business & Economic Statistics 28(4), 2010), as a
    unit of few logs is less exact than one of many.
    """
    d = np.where(abs(differences) < SAME, 0.0, differences)
    logs = len(d)
    if (groups := _groups(d, units)) is not None:
        d = np.array([_typical(group) for group in groups])
        d[abs(d) < SAME] = 0
    n = len(d)
    if not n:
        return Shift(np.nan, np.nan, np.nan, np.nan, np.nan, 0, 0)
    count = n * (n + 1) // 2
    if n < FEWEST:
        ends = _student(d) if logs >= FEWEST and n > 1 else (np.nan, np.nan)
        return Shift(_typical(d), *ends, np.nan, np.nan, logs, n)
    depth = _rejected(n)
    *central, low, high = (
        0.0 if abs(average) < SAME else average for average in ranked(d, (*_central(count), depth - 1, count - depth))
    )
    off = d - against
    off[abs(off) < SAME] = 0
    return Shift(_middle(np.array(central)), low, high, *signed_rank(off), logs, n)


def _groups(values: Array, units: OfLogs) -> list[Array] | None:
    """Splits the values (n,) by their units; None where each is a unit by itself."""
    if units is None or len(set(units)) == len(units):
        return None
    places: dict[Hashable, list[int]] = {}
    for place, unit in enumerate(units):
        places.setdefault(unit, []).append(place)
    return [values[group] for group in places.values()]


def _typical(d: Array) -> float:
    """The median of the Walsh averages of d (n,)."""
    return _middle(np.array(ranked(d, _central(len(d) * (len(d) + 1) // 2))))


def _student(d: Array) -> tuple[float, float]:
    """Returns Student's 95 % interval of the mean of d (n,), 2 to 5 values; of infinite ones, everything."""
    if not np.isfinite(d).all():
        return -np.inf, np.inf
    reach = STUDENT[len(d)] * float(d.std(ddof=1)) / sqrt(len(d))
    low, high = float(d.mean()) - reach, float(d.mean()) + reach
    return (0.0 if abs(low) < SAME else low), (0.0 if abs(high) < SAME else high)


def _central(count: int) -> tuple[int, int]:
    """The ranks, from 0 on, of the one or two in the middle."""
    return (count - 1) // 2, count // 2


def _paired(first: str, second: str, one: Mapping[str, float], other: Mapping[str, float], units: Units) -> Comparison:
    logs = [log for log in one if log in other]
    d = log_ratios(*(np.array([side[log] for log in logs], float) for side in (one, other)))
    found = shift(d, units=[units.unit(log) for log in logs])
    ratio, low, high = exponential(found.value), exponential(found.low), exponential(found.high)
    return Comparison(
        first, second, len(logs), int((d > 0).sum()), ratio, low, high, found.p, np.nan, found.effect, found.units
    )


def log_ratios(first: Array, second: Array) -> Array:
    """Computes the logarithms of second / first, (n,) each; 0 where they differ by rounding, NaN where either is."""
    with np.errstate(divide="ignore", invalid="ignore"):
        d = np.log(second) - np.log(first)
    d[(first == second) | (abs(d) < SAME)] = 0
    return d


def exponential(logarithm: float) -> float:
    """Computes the exponential, infinite where no number is large enough."""
    with np.errstate(over="ignore"):
        return float(np.exp(logarithm))


def signed_rank(differences: Array) -> tuple[float, float]:
    """Computes Wilcoxon's two-sided p of differences (n,) and their matched-pairs rank-biserial correlation.

    Without a difference each sign is as likely as the other, given the sizes: p is the share of the 2^m choices of the
    m signs that are at least as far from balance as the signs found.
    """
    _, size, counts = np.unique(abs(differences), return_inverse=True, return_counts=True)
    ranks = (2 * np.cumsum(counts) - counts + 1)[size]  # twice the mean rank, so that ties have whole numbers
    signs = np.sign(differences)
    balance = int(ranks @ signs)
    lower = (int(ranks[signs != 0].sum()) - abs(balance)) // 2  # twice the lesser rank sum
    return min(1.0, 2 * _below(tuple(np.sort(ranks[signs != 0]).tolist()), lower)), balance / int(ranks.sum())


def _below(ranks: tuple[int, ...], total: int) -> float:
    """The probability that randomly signed ranks have positive ones that add up to `total` or less."""
    if len(ranks) > EXACT:
        sd = sqrt(sum(r * r for r in ranks)) / 2
        return erfc((sum(ranks) / 2 - total) / (sd * sqrt(2))) / 2
    return float(_sums(ranks)[total])


@lru_cache(maxsize=64)
def _sums(ranks: tuple[int, ...]) -> Array:
    """The cumulative distribution of the sum of the positive ones, (sum + 1,)."""
    share = np.zeros(sum(ranks) + 1)
    share[0] = 1
    for r in ranks:
        share[r:] += share[:-r]  # the right side is read before any is written: numpy copies what overlaps
        share /= 2
    return np.cumsum(share)


@lru_cache(maxsize=64)
def _rejected(n: int) -> int:
    """Counts the lesser rank sums 0, 1, 2 ... of n untied differences that the test rejects."""
    ranks = tuple(range(2, 2 * n + 1, 2))
    return bisect_right(range(n * (n + 1) // 4), LEVEL / 2, key=lambda total: _below(ranks, 2 * total))


def _middle(values: Array) -> float:
    """The median of sorted values; 0 for two middle ones that are infinite with opposite signs."""
    low, high = float(values[(len(values) - 1) // 2]), float(values[len(values) // 2])
    return 0.0 if low == -high else low + (high - low) / 2 if np.isfinite(low) else low


@lru_cache(maxsize=64)
def _depth(n: int) -> tuple[int, float]:
    """The order statistic from which a median's interval is interpolated, and the share towards the next."""
    outside, depth = 2 * _heads(n, 0), 1  # the probability outside the order statistics at this depth
    while (further := outside + 2 * _heads(n, depth)) <= LEVEL:
        outside, depth = further, depth + 1
    part = (LEVEL - outside) / (further - outside)
    return depth, (n - depth) * part / (depth + (n - 2 * depth) * part)


def _heads(n: int, k: int) -> float:
    """The probability of k heads of n fair coins."""
    if n <= EXACT:
        return comb(n, k) / 2**n
    return exp(lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) - n * log(2))


def _between(start: float, end: float, share: float) -> float:
    """Interpolates from start towards end; start itself where one of them is infinite."""
    return float(start + share * (end - start) if np.isfinite(start) and np.isfinite(end) else start)


MOST = 2_000  # numbers of which all averages are computed: two million of these


def ranked(d: Array, ranks: Sequence[int]) -> list[float]:
    """The Walsh averages of d (n,) of these ranks from 0 on, of n (n + 1) / 2; InputError beyond MOST.

    Of averages of infinity and minus infinity, half count as either: on no ratio do their ranks differ.
    """
    if len(d) > MOST:
        raise InputError(f"found {len(d):,} logs on which two backends are to be compared, expected at most {MOST:,}.")
    found = _sorted(d)
    return [float(found[rank]) for rank in ranks]


def _sorted(d: Array) -> Array:
    one, other = np.triu_indices(len(d))
    with np.errstate(invalid="ignore"):
        found = np.sort((d[one] + d[other]) / 2)
    opposed = int(np.isnan(found).sum())
    if not opposed:
        return found
    half = np.full(opposed // 2, np.inf)
    return np.concatenate([-half, np.sort(np.append(found[:-opposed], np.zeros(opposed % 2))), half])
