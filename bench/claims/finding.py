"""What was found for a claim: an estimate with its interval, and how that stands to the claim's bounds."""

from math import inf, isinf, isnan, nan
from typing import Literal, NamedTuple

Verdict = Literal["holds", "fails", "open"]
"""open: the interval is on both sides of a bound, or there is too little to tell."""

FIGURES = ("estimate", "low", "high", "n", "p", "medians")
"""The numbers of what was found."""


class Finding(NamedTuple):
    """Of one claim, or of one value of its `each`."""

    verdict: Verdict
    estimate: float  # NaN with none
    low: float  # 95 % interval; NaN where there are fewer than FEWEST logs
    high: float
    n: int  # logs
    margin: float  # by how much the interval keeps to the bounds: of several, the worst is the one with the least
    words: str  # the figures, for a sentence
    wanted: str  # the bounds, likewise
    p: float | None = None  # of the signed-rank test against the claim's factor, where there is one
    medians: tuple[float, ...] = ()  # of the measure on each side, where there are two
    waiting: int = 0  # cells that have not run
    lost: int = 0  # logs that lack a value
    remarks: tuple[str, ...] = ()  # what else a reader must know


def held(low: float, high: float, least: float, most: float) -> Verdict:
    """How an interval stands to bounds; one with NaN ends leaves it open."""
    if least <= low and high <= most:
        return "holds"
    return "fails" if low > most or high < least else "open"


def margin(low: float, high: float, least: float, most: float) -> float:
    """From the interval's ends inwards to the bounds, the lesser; minus infinity where there is no interval."""
    if isnan(low):
        return -inf
    return min((end - bound for end, bound in ((low, least), (-high, -most)) if not isinf(bound)), default=inf)


def nothing(reason: str) -> Finding:
    """Where no cell has an answer, for that reason."""
    return Finding("open", nan, nan, nan, 0, -inf, reason, "")
