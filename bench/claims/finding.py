"""The finding on a claim: an estimate with its interval, compared with the claim's bounds."""

from math import inf, isinf, isnan, nan
from typing import Literal, NamedTuple

Verdict = Literal["holds", "fails", "open"]  # open: the interval overlaps a bound, or there are too few data
FIGURES = ("estimate", "low", "high", "n", "p", "medians")  # the numbers of a finding


class Finding(NamedTuple):
    """The finding on one claim, or on one value of its `each`."""

    verdict: Verdict
    estimate: float  # NaN with none
    low: float  # 95 % interval; NaN where there are fewer than FEWEST logs
    high: float
    n: int  # logs
    margin: float  # distance of the interval from the bounds: the worst of several has the least
    words: str  # the figures, for a sentence
    wanted: str  # the bounds, likewise
    p: float | None = None  # of the signed-rank test against the claim's factor, where there is one
    medians: tuple[float, ...] = ()  # of the measure on each side, where there are two
    waiting: int = 0  # cells that have not run
    lost: int = 0  # logs that lack a value
    remarks: tuple[str, ...] = ()  # for the reader
    units: int = 0  # independent ones that the logs are of: as many as logs unless these are in clusters


def judged(low: float, high: float, least: float, most: float) -> Verdict:
    """Compares an interval with bounds; one with NaN ends leaves it open."""
    if least <= low and high <= most:
        return "holds"
    return "fails" if low > most or high < least else "open"


def margin(low: float, high: float, least: float, most: float) -> float:
    """The least distance of the interval's ends inwards from the bounds; -inf without an interval."""
    if isnan(low):
        return -inf
    return min((end - bound for end, bound in ((low, least), (-high, -most)) if not isinf(bound)), default=inf)


def nothing(reason: str) -> Finding:
    """Makes the finding where no cell has an answer, for that reason."""
    return Finding("open", nan, nan, nan, 0, -inf, reason, "")
