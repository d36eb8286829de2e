"""Sums up the repeats of a cell's timing, its rounds: medians, and means with 95 % intervals.

A mean's values have two sources of chance, units and rounds. Rounds of one run share what their processes and the
machine did, units what their logs are: neither all values nor the means of one side alone are independent of each
other. The variance of the mean is that of the two-way analysis of variance without replication, in which units, rounds
and what is left are random (Scheffe, The Analysis of Variance, 1959, chapter 7), with Satterthwaite's degrees of
freedom (Biometrics Bulletin 2(6), 1946). A side whose variance is no larger than that of what is left adds nothing: the
interval is then Student's over the other side.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from math import sqrt
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ...core.se2 import Array

ROUNDS = 5  # in which small cells are timed where no number is given
SMALL_S = 0.15
"""CPU time in s up to which a cell is small. Starting, loading and warming up cost another 0.06 s in each round. The
demo's longest small cells take half of it and its shortest others thrice: most machines repeat the same ones."""

MOST_CELLS = 100
"""Small cells of a backend on a dataset up to which they are repeated: with more it would take minutes."""

FEWEST_ROUNDS = 3  # for an interval: with two, what rounds have in common is hardly known
COMPARED = ("step_us_p50", "cpu_s")  # the costs that backends are compared by
ENDS = {"step_us_p50": ("step_us_p50_low", "step_us_p50_high"), "cpu_s": ("cpu_low_s", "cpu_high_s")}
"""The columns of a cell's interval of each."""

UPPER = 0.975  # of a 95 % interval, the probability below its upper end


def over_rounds(found: Sequence[Mapping[str, Any]], timed: Iterable[str]) -> dict[str, Any]:
    """Sums up the rounds of a cell by column: medians of those that are `timed`, and intervals of COMPARED.

    Rounds in which other cells ran beside it count only where it ran alone in none.
    """
    ended = [one for one in found if one["status"] == "done"]
    alone = [one for one in ended if one["timing_alone"]]
    done = alone or ended
    row: dict[str, Any] = {"repeats": len(done), "timing_alone": int(bool(alone))}
    for name in timed:
        values = [one[name] for one in done if one[name] is not None]
        row[name] = median(values) if values else None
    for name in COMPARED:
        values = [one[name] for one in done if one[name]]
        if len(values) == len(done) >= FEWEST_ROUNDS:
            mean = two_way(np.log(np.array([values])))
            row |= dict(zip(ENDS[name], (float(np.exp(mean.low)), float(np.exp(mean.high))), strict=True))
    return row


class Mean(NamedTuple):
    """A mean with the ends of its 95 % interval, NaN with one round."""

    value: float
    low: float
    high: float


def two_way(values: Array) -> Mean:
    """Estimates the mean of `values` (units, rounds); of one unit, Student's interval over the rounds."""
    mean, (units, rounds) = float(values.mean()), values.shape
    if rounds < 2:
        return Mean(mean, np.nan, np.nan)
    by_unit, by_round = values.mean(axis=1), values.mean(axis=0)
    of_rounds = units * float(by_round.var(ddof=1))
    if units < 2:
        return _around(mean, of_rounds, rounds - 1, values.size)
    of_units = rounds * float(by_unit.var(ddof=1))
    rest = values - by_unit[:, None] - by_round + mean
    free = (units - 1) * (rounds - 1)
    left = float((rest**2).sum()) / free
    if of_rounds <= left or of_units <= left:
        larger, dof = max((of_units, units - 1), (of_rounds, rounds - 1))
        return _around(mean, larger, dof, values.size)
    together = of_units + of_rounds - left
    spread = of_units**2 / (units - 1) + of_rounds**2 / (rounds - 1) + left**2 / free
    return _around(mean, together, together**2 / spread, values.size)


def _around(mean: float, square: float, dof: float, count: int) -> Mean:
    """Returns Student's interval of a mean of so many values, whose mean square is `square`."""
    reach = student(max(1.0, dof)) * sqrt(square / count)
    return Mean(mean, mean - reach, mean + reach)


@lru_cache(maxsize=1024)
def student(dof: float) -> float:
    """The 97.5 % point of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(dof, UPPER))
