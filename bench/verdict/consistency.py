"""Whether backends know how well they do: a word a backend, from its NEES over independent logs."""

from collections.abc import Sequence
from typing import NamedTuple

from ..words.numerals import listed, number
from ..words.styles import BASELINE
from .statistics import FEWEST, Estimate, estimate
from .summary import Line

OVERCONFIDENT, CAUTIOUS = 1.25, 0.7
"""NEES / 3 that its median over logs has to be above, or below, for sure. Where the errors of a run are all one error,
the NEES of a run that is right is that of a single draw, and its median is 0.79: a word has to begin below that."""

CONSISTENT = (0.5, 2.0)
"""NEES / 3 that its median over logs has to be between, for sure, where neither word holds."""

LOST = 10.0
"""Median of NEES / 3 from which on a belief has nothing to do with its error."""

MOST = 4
"""Backends that a sentence names one by one."""

TOWARDS_CAUTIOUS, TOWARDS_OVERCONFIDENT = "consistent or a little cautious", "consistent or a little overconfident"
UNCLEAR = "it is not clear for"
"""What is said where no word is clear."""

_NOBODY = (
    " None of them has a belief that fits this log: noise stated too small, wrong ids, landmarks that move, or clocks "
    "that differ would do that to all alike; bench show tells more of the log."
)


class Belief(NamedTuple):
    """What a line's NEES / 3 comes to."""

    word: str  # "consistent", "overconfident" or "cautious"; "" where none of them is clear
    nees: Estimate  # its median over the logs that it has a path on


def belief(line: Line, column: str = "nees") -> Belief | None:
    """None without NEES. A word is from an interval over six logs or more, else from a rule of thumb."""
    if column not in line.values:
        return None
    found = estimate(list(line.by_log(column).values()))
    return Belief(_word(found) if found.n >= FEWEST else _thumb(line, column), found)


def belief_word(line: Line, column: str = "nees") -> str:
    """consistent, overconfident or cautious where that is clear, else ""."""
    found = belief(line, column)
    return found.word if found else ""


def _word(nees: Estimate) -> str:
    if nees.low > OVERCONFIDENT:
        return "overconfident"
    if nees.high < CAUTIOUS:
        return "cautious"
    return "consistent" if CONSISTENT[0] <= nees.low and nees.high <= CONSISTENT[1] else ""


def _thumb(line: Line, column: str) -> str:
    """Clear in every run, by how far off and how often outside the 95 % region."""
    nees, inside = line.values[column], line.values.get(f"{column}_inside")
    if inside is None:
        return ""
    if nees.low > 2 and inside.high < 0.9:
        return "overconfident"
    if nees.high < 0.5:
        return "cautious"
    return "consistent" if nees.low >= 0.5 and nees.high <= 2 and inside.low >= 0.85 else ""


def belief_sentences(lines: Sequence[Line]) -> list[str]:
    """How sure of themselves they are, clear or not; [] where nobody says."""
    found = {line.backend: known for line in lines if (known := belief(line))}
    if not found:
        return []
    said: list[str] = []
    told = {name: known.word or _between(known.nees) for name, known in found.items()}
    for word in ("consistent", "overconfident", "cautious", TOWARDS_CAUTIOUS, TOWARDS_OVERCONFIDENT, UNCLEAR):
        names = [name for name, word_of in told.items() if word_of == word]
        if names:
            sized = [f"{name} ({_size(found[name].nees)})" for name in names[:MOST]]
            sized += [f"{len(names) - MOST} more"] if len(names) > MOST else []
            is_are = "is" if len(names) == 1 else "are"
            said.append(f"{word} {listed(sized)}" if word == UNCLEAR else f"{listed(sized)} {is_are} {word}")
    using = [known for name, known in found.items() if name != BASELINE]
    lost = len(using) > 1 and all(known.nees.value > LOST for known in using)
    few = [name for name, known in found.items() if known.nees.n < FEWEST]
    whose = "" if len(few) == len(found) else f"{listed(few)} " if few else ""
    thumb = f" ({whose}by a rule of thumb: an interval takes {FEWEST} logs)" * bool(few)
    return [
        f"By NEES / 3, which is 1 where a belief is as wide as its errors, {'; '.join(said)}{thumb}.{_NOBODY * lost}"
    ]


def _between(nees: Estimate) -> str:
    """Where no word is clear, between which two it lies."""
    if nees.n >= FEWEST and nees.high < 1:
        return TOWARDS_CAUTIOUS
    return TOWARDS_OVERCONFIDENT if nees.n >= FEWEST and nees.low > 1 else UNCLEAR


def _size(nees: Estimate) -> str:
    return number(nees.value) if nees.n < FEWEST else f"{number(nees.low)} to {number(nees.high)}"
