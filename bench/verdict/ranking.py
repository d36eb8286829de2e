"""Ranks a dataset's backends on a measure, and compares each pair."""

from collections.abc import Mapping, Sequence
from math import isnan
from typing import NamedTuple

from ..words.styles import BASELINE
from .statistics import FEWEST, LEVEL, Comparison, compare, holm, median_over
from .summary import Line, representative
from .units import Units

ALIKE = 1.01  # errors whose ratio is significantly within this and its inverse are alike, whatever the test says
ROUNDING = 1e-9  # m below which errors are all the same, so that rounding on a log without noise decides nothing
PATHS = {"online": "ate_m", "final": "final_ate_m"}  # compared where the path is known, by purpose
RELATIONS = {"online": "relation_m", "final": "final_relation_m"}  # where only motions between its poses are
MAPS = {"online": "map_rmse_m", "map": "final_map_rmse_m"}  # where only the landmarks are known
MIXED = {"online map": "map_rmse_m", "map": "final_map_rmse_m", **PATHS}  # where the path is known of some logs alone

ESTIMATES = {
    "ate_m": "online path", "final_ate_m": "final path", "map_rmse_m": "online map", "final_map_rmse_m": "final map",
    "relation_m": "online path", "final_relation_m": "final path",
}  # fmt: skip
"""the estimate whose error each of these is"""

ERRORS = {"truth": "ATE", "reference": "distance from reference", "relations": "error of relations", "": "error"}
"""the error of a path, by what is known of the true one"""


def path_errors(truth_kind: str) -> Mapping[str, str]:
    """The columns of a path's error by purpose; distances from a reference are among them."""
    return RELATIONS if truth_kind == "relations" else PATHS


def judged_by(known: Line) -> Mapping[str, str]:
    """The columns that a dataset's backends are ranked by, by purpose; none where nothing true is known."""
    if known.with_path is not None:
        return MIXED
    if known.truth_kind in ("truth", "relations"):
        return path_errors(known.truth_kind)
    return MAPS if known.surveyed else {}


class Ranking(NamedTuple):
    """The backends that have a measure, the best first.

    Those that were given the ground truth are not ranked. Dead reckoning is the baseline: not ranked either, and
    compared as a family of its own, so that it costs the others no power.
    """

    column: str
    lines: Sequence[Line]
    errors: Mapping[str, Mapping[str, float]]  # by backend and by log; infinite where it failed
    comparisons: Sequence[Comparison]  # every pair of `lines`, in their order, Holm-corrected
    baseline: Sequence[Comparison]  # each of `lines` with dead reckoning, if that has the measure; Holm-corrected
    units: Units  # of the dataset's logs that are judged by the measure

    @property
    def compared(self) -> bool:
        """True where there are enough logs, of several units, for intervals."""
        return self.units.logs >= FEWEST and self.units.n > 1

    def between(self, first: Line, second: Line) -> Comparison:
        """The comparison of two of `lines`, the first one before the second."""
        return next(c for c in self.comparisons if (c.first, c.second) == (first.backend, second.backend))

    @property
    def circular(self) -> bool:
        """True where another one is significantly better than the best: then every backend is beaten."""
        return self.lines[0].backend in _beaten(self.comparisons)

    @property
    def level(self) -> list[Line]:
        """The best and those neither beaten nor set apart from it by the interval, tested or not."""
        best, beaten = self.lines[0], _beaten(self.comparisons)
        near = [line for line in self.lines[1:] if standing(self.between(best, line)) in ("alike", "open")]
        return [best, *(line for line in near if line.backend not in beaten)]


def ranking(lines: Sequence[Line], column: str) -> Ranking | None:
    """Ranks the backends that have the column; None without any.

    The best is the one significantly beaten by the fewest, and of these the one with the lowest median. Those with too
    few logs in common with everybody come after those that can be tested.
    """
    having = [line for line in lines if column in line.values and not line.told]
    entered = [line for line in having if line.backend != BASELINE]
    if not entered:
        return None
    errors = {line.backend: line.by_log(column) for line in having}
    of = having[0].over(column)
    medians = {name: median_over(values, of) for name, values in errors.items()}
    entered.sort(key=lambda line: medians[line.backend])
    apart = {name: {log: max(error, ROUNDING) for log, error in of.items()} for name, of in errors.items()}
    found = compare({line.backend: apart[line.backend] for line in entered}, of)
    beaten = _beaten(found)
    tested = {name for c in found if standing(c) != "few" for name in (c.first, c.second)}
    entered.sort(key=lambda line: (line.backend not in tested, beaten.count(line.backend)))
    found = compare({line.backend: apart[line.backend] for line in entered}, of)
    against = (
        [compare({line.backend: apart[line.backend], BASELINE: apart[BASELINE]}, of)[0] for line in entered]
        if BASELINE in apart
        else []
    )
    adjusted = holm([c.p for c in against])
    against = [c._replace(adjusted=float(p)) for c, p in zip(against, adjusted, strict=True)]
    return Ranking(column, entered, errors, found, against, of)


def of_the_map(final: Ranking | None, online: Ranking | None) -> Ranking | None:
    """The ranking that maps go by: of the final ones if several backends have one, else of those while it drove."""
    return final if final is not None and len(final.lines) > 1 else online or final


def by_purpose(lines: Sequence[Line]) -> dict[str, tuple[str, Ranking | None]]:
    """The column and the ranking of each purpose that a dataset's backends are judged by."""
    judged = judged_by(representative(lines))
    found = {column: ranking(lines, column) for column in judged.values()}
    maps = of_the_map(*(found.get(MAPS[purpose]) for purpose in ("map", "online")))
    paths = {p: judged[p] for p in PATHS if judged.get(p) in (PATHS[p], RELATIONS[p])}
    of = paths if maps is None else {**paths, "map": maps.column}
    return {purpose: (column, found[column]) for purpose, column in of.items()}


def _beaten(found: Sequence[Comparison]) -> list[str]:
    """Lists those that another one is significantly better than, once for each."""
    kinds = [(c, standing(c)) for c in found]
    return [c.second if kind == "better" else c.first for c, kind in kinds if kind in ("better", "worse")]


def standing(c: Comparison) -> str:
    """Classifies a comparison of the first with the second.

    "better" or "worse" where interval and test say so; "alike" where they are significantly within 1 %; "open" where
    the interval contains 1; "unproven" where it does not, but the test does not support it; "few" without an interval.
    """
    if isnan(c.low):
        return "few"
    if c.low >= 1 / ALIKE and c.high <= ALIKE:
        return "alike"
    if c.holds:
        return "better" if c.low > 1 else "worse"
    return "open" if c.low <= 1 <= c.high else "unproven"


def needed(pairs: int) -> int:
    """The units that a test of so many pairs needs: with fewer, Holm's correction leaves no p below 5 %."""
    n = 1
    while 2.0 ** (1 - n) * pairs >= LEVEL:
        n += 1
    return n


def ordered(lines: Sequence[Line]) -> list[Line]:
    """Orders a dataset's lines: by accuracy if known, then those that are not ranked, dead reckoning last."""
    place: dict[str, tuple[int, int]] = {}
    for k, column in enumerate(judged_by(representative(lines)).values()):
        found = ranking(lines, column)
        for j, line in enumerate(found.lines if found else ()):
            place.setdefault(line.backend, (k, j))
    return sorted(lines, key=lambda line: (line.backend == BASELINE, place.get(line.backend, (len(ESTIMATES), 0))))
