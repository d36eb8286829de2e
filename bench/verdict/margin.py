"""Margins of a recommendation: by how much a backend may be worse than another, and how many logs would tell.

A backend that is not significantly different from the best may still be many times worse: with few logs the interval of
the ratio of their errors is wide. One that is recommended in its place has to be non-inferior: the interval's upper end
is below a margin, stated beforehand (Piaggio et al., Reporting of noninferiority and equivalence randomized trials,
JAMA 308(24), 2012).
"""

from bisect import bisect_left
from collections.abc import Iterable
from math import inf, isnan, log
from typing import NamedTuple

import numpy as np

from ..words.numerals import counted, larger
from .ranking import ROUNDING, Ranking
from .statistics import log_ratios, shift
from .summary import Line

NEAR = 1.25  # a cheaper backend is recommended where its error is at most this times that of the best
FAR = 2.0  # none is recommended where another one may be closer by more than this
MANY = 1000  # logs of which it is tried if they would tell


class Limit(NamedTuple):
    """The largest ratio of a backend's error to another's that the data do not rule out."""

    rival: str  # the other's label
    most: float  # the upper end of the 95 % interval; NaN with too few logs

    @property
    def is_ruled_out(self) -> str:
        """Writes "more than 20 % worse than ekf is ruled out"."""
        return f"more than {larger(max(self.most, 1.0))} worse than {self.rival} is ruled out"


def limit(found: Ranking, one: Line, other: Line) -> Limit:
    """Finds how much worse `one` may be than `other`, both ranked."""
    if found.lines.index(one) < found.lines.index(other):
        c = found.between(one, other)
        return Limit(other.backend, 1 / c.low if c.low else inf)
    return Limit(other.backend, found.between(other, one).high)


def widest(found: Ranking, one: Line, others: Iterable[Line]) -> Limit | None:
    """Finds whom `one` may be the most worse than; None where nothing can be said of any."""
    limits = [limit(found, one, other) for other in others if other is not one]
    return max((each for each in limits if not isnan(each.most)), key=lambda each: each.most, default=None)


def undecided(found: Ranking, one: Line, worst: Limit) -> str:
    """Says why not even `one` is recommended, and what would tell."""
    return (
        f"None can be named: {one.backend} comes first, but may be more than {FAR:g} times as far off as {worst.rival} "
        f"(up to {larger(worst.most)} is not ruled out){would_tell(found, one.backend, worst.rival, FAR)}."
    )


def would_tell(found: Ranking, one: str, other: str, margin: float) -> str:
    """Writes "; some 40 logs like these would tell", or that not even many would."""
    number, noun = needed(found, one, other, margin), found.units.noun
    if number is None:
        return f"; not even {MANY:,} {noun}s like these would tell"
    return f"; some {counted(number, noun)} like these would tell"


def needed(found: Ranking, one: str, other: str, margin: float) -> int | None:
    """Counts the units that would tell if `one` is worse than `other` by more than the margin: or not, or that it is.

    Those at hand are taken several times, as if further ones were like them. None where no number up to MANY is enough.
    """
    mine, theirs = found.errors[one], found.errors[other]
    logs = [log for log in mine if log in theirs]
    d = log_ratios(*(np.maximum([side[log] for log in logs], ROUNDING) for side in (theirs, mine)))
    units = [found.units.unit(log) for log in logs]

    def tells(copies: int) -> bool:
        of = shift(np.tile(d, copies), units=[(copy, unit) for copy in range(copies) for unit in units])
        return of.high <= log(margin) or of.low > 0

    most = MANY // max(len(logs), 1)
    copies = bisect_left(range(2, most + 1), True, key=tells) + 2
    return copies * len(set(units)) if copies <= most else None
