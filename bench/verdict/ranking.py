"""Who competes on a measure of a dataset, in which order, and how each stands to each."""

from collections.abc import Mapping, Sequence
from math import isnan
from typing import NamedTuple

import numpy as np

from ..words.styles import BASELINE
from .statistics import LEVEL, Comparison, compare, holm
from .summary import Line, logs, representative

ALIKE = 1.01
"""Errors whose ratio lies between this and its inverse for sure are alike, whatever a test makes of so little."""

ROUNDING = 1e-9
"""Metres below which errors are all the same, and none is a failure's opposite: rounding, of a log without noise."""

PATHS = {"online": "ate_m", "final": "final_ate_m"}
"""What is compared where the path is known, by purpose: the path given step by step, and that smoothed at the end."""

MAPS = {"online": "map_rmse_m", "map": "final_map_rmse_m"}
"""What is compared where the landmarks' places are known and the path is not."""

ESTIMATES = {
    "ate_m": "online path", "final_ate_m": "final path", "map_rmse_m": "online map", "final_map_rmse_m": "final map",
}  # fmt: skip
"""Which estimate each of these is the error of."""


class Ranking(NamedTuple):
    """The backends that have a measure, the best first.

    Those that were told the truth do not compete. Dead reckoning is what everybody has to beat: it is no competitor,
    and the comparisons with it are a family of their own, so that they cost the others no power.
    """

    column: str
    lines: Sequence[Line]
    errors: Mapping[str, Mapping[str, float]]  # by backend and by log; infinite where it failed
    comparisons: Sequence[Comparison]  # every pair of `lines`, in their order, after Holm
    baseline: Sequence[Comparison]  # each of `lines` with dead reckoning, where that has the measure; after Holm
    logs: int  # of the dataset

    def between(self, first: Line, second: Line) -> Comparison:
        """Of two of `lines`, the first one before the second."""
        return next(c for c in self.comparisons if (c.first, c.second) == (first.backend, second.backend))

    @property
    def circular(self) -> bool:
        """Whether somebody is better than the best for sure: then all are beaten, and none is the best of all."""
        return self.lines[0].backend in _beaten(self.comparisons)

    @property
    def level(self) -> list[Line]:
        """The best, and all whose interval leaves it open which of the two is, and that nobody is better than for sure:
        what is wider apart is not among them, even where no test can bear it out, and neither is what has too few logs
        to say."""
        best, beaten = self.lines[0], _beaten(self.comparisons)
        near = [line for line in self.lines[1:] if standing(self.between(best, line)) in ("alike", "open")]
        return [best, *(line for line in near if line.backend not in beaten)]


def ranking(lines: Sequence[Line], column: str) -> Ranking | None:
    """None where no competitor has the column.

    The best is the one that nobody, or the fewest, are better than for sure; of these the one with the lowest median.
    Those with too few logs in common with everybody come after those that can be tested.
    """
    having = [line for line in lines if column in line.values and not line.told]
    entered = [line for line in having if line.backend != BASELINE]
    if not entered:
        return None
    errors = {line.backend: line.by_log(column) for line in having}
    medians = {name: float(np.median(list(values.values()))) for name, values in errors.items()}
    entered.sort(key=lambda line: medians[line.backend])
    apart = {name: {log: max(error, ROUNDING) for log, error in of.items()} for name, of in errors.items()}
    found = compare({line.backend: apart[line.backend] for line in entered})
    beaten = _beaten(found)
    tested = {name for c in found if standing(c) != "few" for name in (c.first, c.second)}
    entered.sort(key=lambda line: (line.backend not in tested, beaten.count(line.backend)))
    found = compare({line.backend: apart[line.backend] for line in entered})
    against = (
        [compare({line.backend: apart[line.backend], BASELINE: apart[BASELINE]})[0] for line in entered]
        if BASELINE in apart
        else []
    )
    adjusted = holm([c.p for c in against])
    against = [c._replace(adjusted=float(p)) for c, p in zip(against, adjusted, strict=True)]
    return Ranking(column, entered, errors, found, against, logs(lines))


def _beaten(found: Sequence[Comparison]) -> list[str]:
    """Those that another one is better than for sure, once for each."""
    kinds = [(c, standing(c)) for c in found]
    return [c.second if kind == "better" else c.first for c, kind in kinds if kind in ("better", "worse")]


def standing(c: Comparison) -> str:
    """How the first stands to the second.

    "better" or "worse" where interval and test say so; "alike" where they are within 1 % for sure; "open" where the
    interval has a place for either; "unproven" where it has not, but the test does not bear it out; "few" without one.
    """
    if isnan(c.low):
        return "few"
    if c.low >= 1 / ALIKE and c.high <= ALIKE:
        return "alike"
    if c.holds:
        return "better" if c.low > 1 else "worse"
    return "open" if c.low <= 1 <= c.high else "unproven"


def needed(pairs: int) -> int:
    """Logs from which on a test of so many pairs can come out: with fewer, Holm's correction leaves no p below 5 %."""
    n = 1
    while 2.0 ** (1 - n) * pairs >= LEVEL:
        n += 1
    return n


def ordered(lines: Sequence[Line]) -> list[Line]:
    """The order in every table of a dataset: by accuracy where there is a known path or map, dead reckoning last.

    Before it those that do not compete: they were told the truth, or have nothing that could be measured.
    """
    place: dict[str, tuple[int, int]] = {}
    known = representative(lines)
    if known.truth_kind == "truth" or known.surveyed:
        for k, column in enumerate((PATHS if known.truth_kind == "truth" else MAPS).values()):
            found = ranking(lines, column)
            for j, line in enumerate(found.lines if found else ()):
                place.setdefault(line.backend, (k, j))
    return sorted(lines, key=lambda line: (line.backend == BASELINE, place.get(line.backend, (len(ESTIMATES), 0))))
