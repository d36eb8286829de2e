"""Whether a difference between backends is real: paired by log, with intervals, and failures counted as the worst.

An error that is infinite stands for a failure: it is worse than every other and as bad as another failure.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import stats

from ..frontend.se2 import Array

FEWEST = 6
"""Logs below which no signed-rank test can come out below 5 %, whatever is measured."""

LEVEL = 0.05
"""The share of false claims that is put up with."""


class Estimate(NamedTuple):
    """The median over logs, and its 95 % interval: NaN ends where there are fewer than FEWEST."""

    value: float
    low: float
    high: float
    n: int  # logs


class Comparison(NamedTuple):
    """Two backends on the same logs."""

    first: str
    second: str
    n: int  # logs that both ran on
    closer: int  # logs on which the first one's error is the lower
    ratio: float  # the second's error over the first's; NaN with no log
    low: float  # 95 % interval of the ratio; NaN where there are fewer than FEWEST logs
    high: float
    p: float  # two-sided Wilcoxon signed-rank; NaN where there are fewer than FEWEST logs
    adjusted: float  # the same after Holm's correction over all pairs that were compared
    effect: float  # matched-pairs rank-biserial correlation: 1 where the first is closer on every log, -1 on none

    @property
    def holds(self) -> bool:
        """Whether a difference may be claimed: both the test and the interval say so."""
        return self.adjusted < LEVEL and not self.low <= 1 <= self.high


def estimate(values: Sequence[float]) -> Estimate:
    """The median of a value a log, one or more, with its BCa interval."""
    known = np.asarray(values, float)
    low = high = np.nan
    if len(known) >= FEWEST:
        low, high = stats.bootstrap((known,), np.median, rng=np.random.default_rng(0)).confidence_interval
    return Estimate(float(np.median(known)), float(low), float(high), len(known))


def compare(errors: Mapping[str, Mapping[str, float]]) -> list[Comparison]:
    """Every pair of backends; `errors` are by backend and by log. Each pair is in the order of the mapping."""
    found = [_paired(first, second, errors[first], errors[second]) for first, second in combinations(errors, 2)]
    adjusted = holm([c.p for c in found])
    return [c._replace(adjusted=p) for c, p in zip(found, adjusted, strict=True)]


def holm(p: Sequence[float]) -> Array:
    """Holm's step-down correction (Scandinavian Journal of Statistics 6(2), 1979); NaN stay, and count for nothing."""
    values = np.asarray(p, float)
    known = np.flatnonzero(np.isfinite(values))
    order = known[np.argsort(values[known])]
    adjusted = np.full(len(values), np.nan)
    adjusted[order] = np.minimum(1, np.maximum.accumulate(values[order] * np.arange(len(order), 0, -1)))
    return adjusted


def _paired(first: str, second: str, one: Mapping[str, float], other: Mapping[str, float]) -> Comparison:
    logs = [log for log in one if log in other]
    a, b = (np.array([side[log] for log in logs], float) for side in (one, other))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(a == b, 0.0, np.log(b) - np.log(a))
    n = len(logs)
    comparison = Comparison(first, second, n, int((ratio > 0).sum()), *[np.nan] * 6)
    if n:
        comparison = comparison._replace(ratio=float(np.exp(np.median(ratio))))
    if n >= FEWEST:
        finite = np.clip(ratio, -1e9, 1e9)
        test = stats.wilcoxon(finite)
        low, high = stats.bootstrap((ratio,), np.median, rng=np.random.default_rng(0)).confidence_interval
        ranks = stats.rankdata(abs(finite))
        effect = float((ranks * np.sign(finite)).sum() / ranks.sum())
        comparison = comparison._replace(p=float(test.pvalue), low=float(np.exp(low)), high=float(np.exp(high)))
        comparison = comparison._replace(effect=effect)
    return comparison
