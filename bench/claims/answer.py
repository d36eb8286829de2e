"""Tests claims on a study's cells: a verdict, an interval, and a sentence for each.

A claim holds where the 95 % interval is within the bounds, fails where it is outside, and is open where it overlaps a
bound, where there are fewer than six logs, and as long as cells are waiting. So at a bound itself a claim holds wrongly
once in 40 times. One with `each` holds where it does so for every value: an intersection-union test, which needs no
correction (Berger, Technometrics 24(4), 1982), as the worst value alone decides. That it fails for some value is more
easily found, the more there are.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from ..record.cell_table import CellTable
from ..study.study import Claim
from ..verdict.statistics import FEWEST
from ..words.columns import about
from ..words.numerals import counted, listed
from .crossing import crossing
from .finding import FIGURES, Finding, Verdict, nothing
from .median import exponents, median
from .ratio import alike, less
from .side import Untestable, numbered, parameters, selected, side, standard_error, units_of
from .words import remarks

HEADS: Mapping[Verdict, str] = {"fails": "Fails", "open": "Not decided", "holds": "Holds"}  # what an answer begins with

KINDS: Mapping[str, Callable[..., Finding]] = {
    "value": median, "less": less, "alike": alike, "grows": exponents, "crosses": crossing,
}  # fmt: skip
"""the tests by kind of claim, called with the claim and its sides"""

OF_EACH: Mapping[Verdict, str] = {"fails": "not for", "open": "open for", "holds": "for"}  # some values of `each`


class Part(NamedTuple):
    """The finding for one value of a claim's `each`."""

    value: Any
    found: Finding


@dataclass(frozen=True)
class Answer:
    """The answer to a claim."""

    claim: Claim
    verdict: Verdict
    sentence: str  # with the numbers
    figures: Mapping[str, Any]  # estimate, low, high, n, p, medians: of the worst of `each`
    waiting: int = 0  # cells of the claim that have not run
    parts: tuple[Part, ...] = ()  # by the values of `each`, where there is one


def measures(claims: Sequence[Claim]) -> list[str]:
    """Lists the columns that the claims are tested on, with standard errors, and timing_alone for times."""
    sides = [side for claim in claims for side in (claim.first, claim.second)]
    found = list(dict.fromkeys([c.measure for c in claims] + [s["measure"] for s in sides if "measure" in s]))
    found += [error for name in found if (error := standard_error(name))]
    return [*found, *["timing_alone"] * any(about(name).kind.is_time for name in found)]


def answer(claim: Claim, table: CellTable) -> Answer:
    """Tests a claim on the table, which has the columns of `measures`."""
    try:
        parts = tuple(Part(value, _found(claim, value, part)) for value, part in _split(claim, table))
    except Untestable as trouble:
        return _answer(claim, Part(None, nothing(str(trouble))), ())
    worst = min(parts, key=lambda part: (list(HEADS).index(part.found.verdict), part.found.margin))
    return _answer(claim, worst, parts if claim.each else ())


def _answer(claim: Claim, worst: Part, parts: tuple[Part, ...]) -> Answer:
    found = worst.found
    waiting = sum(part.found.waiting for part in parts or [worst])
    figures = {name: getattr(found, name) for name in FIGURES}
    yet = " yet" if found.verdict == "open" and waiting else ""
    sentence = f"{HEADS[found.verdict]}{yet}: {_words(claim, worst, parts)}."
    return Answer(claim, found.verdict, sentence, figures, waiting, parts)


def _found(claim: Claim, value: Any, table: CellTable) -> Finding:
    """Tests as `_tested`; where that value cannot be tested, the finding says why."""
    try:
        return _tested(claim, value, table)
    except Untestable as trouble:
        return nothing(str(trouble))


def _split(claim: Claim, table: CellTable) -> Iterator[tuple[Any, CellTable]]:
    """Splits the table by the values of `each` that all sides have that have any."""
    if not claim.each:
        yield None, table
        return
    sides = [selected(table, own, claim.where) for own in _sides(claim)]
    if claim.each not in parameters(table):
        raise Untestable(f"the study has no parameter {claim.each}, but {listed(parameters(table))}")
    having = [own for rows in sides if (own := [v for v in table.values(claim.each, rows) if v is not None])]
    common = [value for value in having[0] if all(value in own for own in having)] if having else []
    if not common:
        raise Untestable(f"there is no value of {claim.each} that cells of all sides have")
    rows = np.unique(np.concatenate(sides))
    column = table.columns[claim.each][rows]
    none = np.array([value is None for value in column.tolist()])
    for value in common:
        mine = rows[none | (column == value)]
        yield value, CellTable({name: values[mine] for name, values in table.columns.items()})


def _sides(claim: Claim) -> list[Mapping[str, Any]]:
    return [claim.first] if claim.kind in ("value", "grows") else [claim.first, claim.second]


def _tested(claim: Claim, value: Any, table: CellTable) -> Finding:
    """Tests this value of `each`; open as long as cells of it are waiting."""
    where = {**claim.where, claim.each: value} if claim.each else claim.where
    rows = [selected(table, own, where) for own in _sides(claim)]
    logs = numbered(table, rows, claim.along)
    of = units_of(table, logs)
    sides = [
        side(table, own.get("measure", claim.measure), mine, logs, claim.along, of)
        for own, mine in zip(_sides(claim), rows, strict=True)
    ]
    found = KINDS[claim.kind](claim, *sides)
    waiting = sum(side.waiting for side in sides)
    said = [f"{waiting:,} of {counted(sum(side.cells for side in sides), 'cell')} have not run"] * (waiting > 0)
    short = 0 < found.units < FEWEST and isnan(found.low)
    noun = "clusters" if found.units < found.n else "logs"
    said += [f"{FEWEST} {noun} at least are needed"] * (not waiting and short)
    said += [f"all logs are of {of.within}"] * bool(of.within)
    lacking = "one side has" if len(sides) > 1 else f"some {claim.along} has"
    said += [*found.remarks, *[f"{counted(found.lost, 'log')} left out, where {lacking} no value"] * (found.lost > 0)]
    found = found._replace(waiting=waiting, remarks=(*said, *remarks(sides)))
    return found._replace(verdict="open") if waiting else found


def _words(claim: Claim, worst: Part, parts: Sequence[Part]) -> str:
    found = worst.found
    said = [f"{claim.says.rstrip('.')}: "]
    if parts:
        count = sum(part.found.verdict == found.verdict for part in parts)
        share = f"all {len(parts)}" if count == len(parts) else f"{count} of {len(parts)}"
        said.append(f"{OF_EACH[found.verdict]} {share} values of {claim.each}, at worst with {worst.value}: ")
    said += [found.words, *[f"; claimed: {found.wanted}"] * bool(found.wanted)]
    return "".join([*said, *(f"; {remark}" for remark in found.remarks)])
