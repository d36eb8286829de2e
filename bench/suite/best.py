"""The backend to use on a dataset for a purpose, with the numbers that say why."""

from typing import NamedTuple

from ..verdict.advice import BELIEF, COST, Use
from ..verdict.consistency import belief_word
from ..verdict.ranking import by_purpose
from ..verdict.summary import Line, typical
from ..words.columns import about
from ..words.numerals import number
from ..words.styles import BASELINE
from .standing import Standing

NONE_APART = "None distinguishable: no backend is significantly closer to the truth than dead reckoning."
UNCLEAR = "consistency not clear"


class Best(NamedTuple):
    """The recommendation for a purpose, and its numbers."""

    purpose: str  # online, final or map
    backend: str  # label; "" where none can be recommended
    why: str  # a sentence
    error: str  # with its unit
    ends: str  # of its interval, or of its range
    consistency: str  # consistent, overconfident, cautious, or UNCLEAR; "" without NEES
    cost: str


def bests(standing: Standing) -> list[Best]:
    """The recommendation for each purpose that the verdict has one for."""
    return [_best(standing, use) for use in standing.verdict.uses]


def _best(standing: Standing, use: Use) -> Best:
    line = next((line for line in standing.lines if line.backend == use.backend), None)
    if use.backend == BASELINE:
        return Best(use.purpose, "", NONE_APART, "", "", "", "")
    if line is None:
        return Best(use.purpose, "", use.why, "", "", "", "")
    column, _ = by_purpose(standing.lines).get(use.purpose, ("", None))
    error, ends = _error(line, column)
    nees = BELIEF.get(use.purpose, "")
    consistency = (belief_word(line, nees) or UNCLEAR) if nees in line.values else ""
    return Best(use.purpose, use.backend, use.why, error, ends, consistency, cost(line, use.purpose))


def _error(line: Line, column: str) -> tuple[str, str]:
    """Writes the error in m and its interval."""
    if column not in line.values:
        return "", ""
    found = typical(line, column)
    ends = "" if found.low == found.high else f"{number(found.low)}\N{EN DASH}{number(found.high)}"
    return f"{number(found.value)} m", ends


def cost(line: Line, purpose: str) -> str:
    """Writes the cost that counts for the purpose: of a step, or of the whole log."""
    column = COST[purpose]
    if column not in line.values:
        return ""
    kind = about(column).kind
    value = f"{kind.shown(line.values[column].median)} {kind.unit}{'*' * (not line.alone)}"
    return f"{value} a step" if column == "step_us_p50" else f"{value} a log"
