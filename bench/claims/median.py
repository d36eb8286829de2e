"""Tests claims on a median over logs: of a measure, and of the exponent with which it grows."""

from collections.abc import Hashable, Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ..study.study import Claim
from ..verdict.statistics import Estimate, estimate
from ..words.numerals import plain
from .finding import Finding, judged, margin, nothing
from .side import Side, Untestable
from .words import bounds, exponent, interval, sized

BATCHES = 2.093  # standard errors of the ends of a 95 % interval: Student's t with the freedom of 20 stretches
FEWEST_PLACES = 3  # values of a parameter that an exponent needs


def median(claim: Claim, side: Side) -> Finding:
    """Tests the median of the measure against the bounds.

    An error's failed cell is infinite. A failed cell of another measure, a NEES or a time, might have had any value: it
    counts as the lowest for the one end of the interval, and as the highest for the other. On a single log, of a mean
    over the log that has a standard error, the interval is of that mean.
    """
    found = cautious(side.values[:, 0][there := side.present[:, 0]], _those(side.units, there))
    if not found.n:
        return nothing(f"no cell has {side.measure}")
    if isfinite(side.within) and found.n == 1:
        reach = BATCHES * side.within
        found = found._replace(low=found.value - reach, high=found.value + reach)
        said = f"mean {sized(found.value, side.measure)} ({interval(found.low, found.high, found.n, found.units)})"
        return _judged(claim, found, said, bounds(claim.low, claim.high, side.measure))
    said = f"median {sized(found.value, side.measure)} ({interval(found.low, found.high, found.n, found.units)})"
    return _judged(claim, found, said, bounds(claim.low, claim.high, side.measure))


def exponents(claim: Claim, side: Side) -> Finding:
    """Tests the median exponent b of measure ~ x^b, by least squares on each log, against the bounds.

    A log where an error's cell failed has an infinite exponent where that is at large x, one of minus infinity where it
    is at small ones, and may have any where it is at both, or where the measure is no error; a value of 0 is the
    opposite. Untestable with fewer than FEWEST_PLACES values of the parameter, and for negative values.
    """
    if len(side.along) < FEWEST_PLACES:
        found = ", ".join(f"{x}" for x in side.along)
        raise Untestable(f"too few values of {claim.along} for an exponent: {found}; expected at least {FEWEST_PLACES}")
    if (side.values[side.present] < 0).any():
        raise Untestable(f"{side.measure} has negative values, which are no power of {claim.along}")
    whole = side.complete()
    if len(whole.along) < FEWEST_PLACES or not len(whole.logs):
        return nothing(f"too few cells have {side.measure}")
    x = np.log(np.array(whole.along, float))
    x -= x.mean()
    with np.errstate(invalid="ignore", divide="ignore"):
        found = cautious((np.log(whole.values) * x).sum(axis=1) / (x @ x), whole.units)
    places = f"{claim.along} {plain(whole.along[0])} to {plain(whole.along[-1])}"
    ends = interval(found.low, found.high, found.n, found.units, exponent)
    said = f"exponent {exponent(found.value)} ({ends}, {places})"
    lost = len(side.logs) - len(whole.logs)
    return _judged(claim, found, said, bounds(claim.low, claim.high))._replace(lost=lost)


def cautious(values: Array, units: Sequence[Hashable]) -> Estimate:
    """Estimates the median over logs (n,) of these units with an interval that holds whatever the NaN, unknown, are."""
    unknown = np.isnan(values)
    if not unknown.any():
        return estimate(values.tolist(), units) if len(values) else Estimate(np.nan, np.nan, np.nan, 0, 0)
    known = cautious(values[~unknown], _those(units, ~unknown))
    low, high = (estimate(np.where(unknown, end, values).tolist(), units) for end in (-np.inf, np.inf))
    return Estimate(known.value, low.low, high.high, len(values), low.units)


def _those(units: Sequence[Hashable], there: NDArray[np.bool_]) -> Sequence[Hashable]:
    return [unit for unit, kept in zip(units, there.tolist(), strict=True) if kept]


def _judged(claim: Claim, found: Estimate, words: str, wanted: str) -> Finding:
    ends = found.low, found.high, claim.low, claim.high
    return Finding(judged(*ends), *found[:4], margin(*ends), words, wanted, units=found.units)
