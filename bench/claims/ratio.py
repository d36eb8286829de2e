"""Tests claims on the ratio of two sides, paired by log: that one is smaller, or that they are alike."""

from collections.abc import Hashable
from math import log
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ..study.study import Claim
from ..verdict.statistics import LEVEL, MOST, Shift, exponential, log_ratios, shift
from ..words.numerals import factor, larger
from .finding import Finding, judged, margin, nothing
from .median import cautious
from .side import Side, Untestable, pairs
from .words import ratio, sized, tested


def less(claim: Claim, first: Side, second: Side) -> Finding:
    """Tests that the second's measure is more than `claim.low` times the first's: by interval and by test.

    The interval is that of Hodges and Lehmann, the test Wilcoxon's signed-rank test, both two-sided at 5 %: where the
    true ratio equals the bound, the claim is wrongly found to hold in one case in 40. An error's failed cell is
    infinite, and as bad as another one. For another measure the ratio on a log with a failed cell might be any: it
    counts against the verdict.
    """
    found = _paired(first, second)
    if found is None:
        return nothing("no log has both sides")
    bound = log(claim.low)
    cautious_one, bold_one = found.shifts(bound)
    low, high = cautious_one.low, bold_one.high
    verdict = judged(low, high, bound, np.inf)
    p = bold_one.p if verdict == "fails" else cautious_one.p
    remarks: tuple[str, ...] = ()
    if verdict != "open" and not (p < LEVEL and low != bound):
        verdict, remarks = "open", ("the signed-rank test does not support it",)
    wanted = f"at most {larger(1 / claim.low)} more" if claim.low < 1 else f"at least {factor(claim.low)} times"
    if claim.low == 1:
        wanted = "" if verdict == "holds" else "less"
    return found.told(low, high, p, fine=claim.low != 1)._replace(
        verdict=verdict, margin=margin(low, high, bound, np.inf), p=p, wanted=wanted, remarks=remarks
    )


def alike(claim: Claim, first: Side, second: Side) -> Finding:
    """Tests that the ratio's whole interval is within the bounds.

    Those are two one-sided tests (Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15(6), 1987), each at
    2.5 %. A log on which both sides failed is no evidence: its ratio might be any.
    """
    found = _paired(first, second)
    if found is None:
        return nothing("no log has both sides")
    found.d[np.isinf(found.first) & np.isinf(found.second)] = np.nan
    one, other = found.shifts(0.0)
    ends = one.low, other.high, log(claim.low), log(claim.high)
    wanted = "the same" if claim.low == claim.high else f"within {larger(claim.high)}"
    return found.told(one.low, other.high, None, fine=False)._replace(
        verdict=judged(*ends), margin=margin(*ends), wanted=wanted
    )


class _Ratios(NamedTuple):
    measures: tuple[str, str]
    first: Array  # (n,)
    second: Array
    d: Array  # (n,) log of second / first; NaN where it is unknown
    units: tuple[Hashable, ...]  # (n,)
    lost: int

    def shifts(self, against: float) -> tuple[Shift, Shift]:
        """Estimates the shift with unknown values at the low end, and at the high one."""
        unknown = np.isnan(self.d)
        if not unknown.any():
            found = shift(self.d, against, self.units)
            return found, found
        low, high = (shift(np.where(unknown, end, self.d), against, self.units) for end in (-np.inf, np.inf))
        return low, high

    def told(self, low: float, high: float, p: float | None, *, fine: bool) -> Finding:
        """Makes the finding's figures from the interval of d; verdict and bounds are still missing."""
        medians = tuple(cautious(values, self.units).value for values in (self.first, self.second))
        one, other = (sized(value, measure) for value, measure in zip(medians, self.measures, strict=True))
        known = ~np.isnan(self.d)
        of = [unit for unit, there in zip(self.units, known.tolist(), strict=True) if there]
        at, start, end = (exponential(value) for value in (shift(self.d[known], units=of).value, low, high))
        n, units = len(self.d), len(set(self.units))
        said = f"{one} against {other}"
        if not np.isnan(low):
            said += f", {ratio(start, end, fine=fine)}"
        return Finding(
            "open",
            at,
            start,
            end,
            n,
            0.0,
            f"{said} ({tested(n, units, low, p)})",
            "",
            medians=medians,
            lost=self.lost,
            units=units,
        )


def _paired(first: Side, second: Side) -> _Ratios | None:
    """Pairs the sides; None without a log that both ran on, Untestable with more than MOST."""
    both = pairs(first, second)
    if not both.first.size:
        return None
    if len(both.first) > MOST:
        raise Untestable(f"there are {len(both.first):,} logs of both sides, and at most {MOST:,} can be compared")
    a, b = both.first[:, 0], both.second[:, 0]
    return _Ratios((first.measure, second.measure), a, b, log_ratios(a, b), both.units, both.lost)
