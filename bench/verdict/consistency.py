"""Judges each backend's consistency in a word, from its NEES over independent logs."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..words.numerals import listed, number
from ..words.styles import BASELINE
from .statistics import FEWEST, Estimate
from .summary import Line, typical

OVERCONFIDENT, CAUTIOUS = 1.25, 0.7
"""NEES / 3 that the interval of the median over logs has to be above, or below. Where the errors of a run are all
one error, the NEES of a consistent run is that of a single draw, with the median 0.79: a word has to begin below
that."""

CONSISTENT = (0.5, 2.0)  # NEES / 3 that the interval has to be within, where neither word holds
LOST = 10.0  # median of NEES / 3 from which on a belief is unrelated to its error
MOST = 4  # backends that a sentence names one by one

TOWARDS_CAUTIOUS, TOWARDS_OVERCONFIDENT = "consistent or a little cautious", "consistent or a little overconfident"
UNCLEAR = "it is not clear for"  # said where no word is clear
NO_COVARIANCE = "not a covariance"  # the word of a line with a covariance that is none at some step

_NOBODY = (
    " No belief fits this log: noise stated too small, wrong ids, moving landmarks or differing clocks would affect "
    "all backends alike; bench show describes the log."
)


class Belief(NamedTuple):
    """The consistency of a line."""

    word: str  # "consistent", "overconfident", "cautious" or NO_COVARIANCE; "" where none of them is clear
    nees: Estimate  # its median over the logs that it has a path on, of a single log over its runs, as tables have it


def belief(line: Line, column: str = "nees") -> Belief | None:
    """Judges a line by an interval over six logs or clusters or more, else by a rule of thumb; None without NEES."""
    if column not in line.values:
        return None
    found = line.estimate(column)._replace(value=typical(line, column).value)
    if void(line, column):
        return Belief(NO_COVARIANCE, found)
    return Belief(_word(found) if found.units >= FEWEST else _thumb(line, column), found)


def void(line: Line, column: str = "nees") -> bool:
    """True if a covariance is none at any step of any of the line's cells."""
    return any(row.columns.get(f"{column}_void") for row in line.rows)


def belief_word(line: Line, column: str = "nees") -> str:
    """Returns consistent, overconfident or cautious where that is clear, or NO_COVARIANCE; else ""."""
    if void(line, column):
        return NO_COVARIANCE
    found = belief(line, column)
    return found.word if found else ""


def _word(nees: Estimate) -> str:
    if nees.low > OVERCONFIDENT:
        return "overconfident"
    if nees.high < CAUTIOUS:
        return "cautious"
    return "consistent" if CONSISTENT[0] <= nees.low and nees.high <= CONSISTENT[1] else ""


def _thumb(line: Line, column: str) -> str:
    """Judges by a rule of thumb: clear in every run, by NEES and the share outside the 95 % region."""
    nees, inside = line.values[column], line.values.get(f"{column}_inside")
    if inside is None:
        return ""
    if nees.low > 2 and inside.high < 0.9:
        return "overconfident"
    if nees.high < 0.5:
        return "cautious"
    return "consistent" if nees.low >= 0.5 and nees.high <= 2 and inside.low >= 0.85 else ""


def belief_sentences(lines: Sequence[Line]) -> list[str]:
    """Describes the backends' consistency in sentences; [] where none reports a covariance."""
    without = [line.backend for line in lines if void(line)]
    last = [f"Not a covariance at some steps, so that NEES does not judge {listed(without)}."] if without else []
    judged = [line for line in lines if line.backend not in without]
    found = {line.backend: known for line in judged if (known := belief(line))}
    if not found:
        return last
    sized = {
        name: f"{name} ({number(nees.value) if nees.units < FEWEST else ends})"
        for name, (_, nees) in found.items()
        for ends in [f"{number(nees.low)} to {number(nees.high)}"]
    }
    said = _said(found, sized)
    using = [known for name, known in found.items() if name != BASELINE]
    lost = len(using) > 1 and all(known.nees.value > LOST for known in using)
    few = [name for name, known in found.items() if known.nees.units < FEWEST]
    whose = "" if len(few) == len(found) else f"{listed(few)} " if few else ""
    sized_lines = [(line, found[line.backend].nees) for line in judged if line.backend in found]
    runs = "; medians of the runs on one log" * any(one.n == 1 < len(line.runs("nees")) for line, one in sized_lines)
    thumb = f" ({whose}by a rule of thumb: an interval takes {FEWEST} {lines[0].units.noun}s{runs})" * bool(few)
    return [
        f"By NEES / 3, which is 1 where covariances match the errors, {'; '.join(said)}{thumb}.{_NOBODY * lost}",
        *last,
    ]


def belief_clauses(lines: Sequence[Line], called: Mapping[str, str]) -> str:
    """Which of the backends in `called`, under these names, have which word of the verdict; "" where none is judged."""
    judged = {line.backend: line for line in lines if line.backend in called and not void(line)}
    found = {name: known for name, line in judged.items() if (known := belief(line))}
    return "; ".join(_said(found, called))


def _said(found: Mapping[str, Belief], called: Mapping[str, str]) -> list[str]:
    """A clause for each word, with the backends that have it, as `called`."""
    said: list[str] = []
    told = {name: known.word or _between(known.nees) for name, known in found.items()}
    for word in ("consistent", "overconfident", "cautious", TOWARDS_CAUTIOUS, TOWARDS_OVERCONFIDENT, UNCLEAR):
        names = [called[name] for name, word_of in told.items() if word_of == word]
        if names:
            who = listed(names, MOST)
            said.append(f"{word} {who}" if word == UNCLEAR else f"{who} {'is' if len(names) == 1 else 'are'} {word}")
    return said


def _between(nees: Estimate) -> str:
    """The two words between which an unclear NEES lies."""
    if nees.units >= FEWEST and nees.high < 1:
        return TOWARDS_CAUTIOUS
    return TOWARDS_OVERCONFIDENT if nees.units >= FEWEST and nees.low > 1 else UNCLEAR
