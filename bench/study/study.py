"""A study: a question, the cells that can answer it, figures to plot, and claims to test on the cells.

Cells are identified by their parameters: `dataset` and `backend` as the file names them, `seed`, and the swept options,
each by its own name; every cell has all of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any, Literal

from ...core.errors import InputError
from ..plan.work import Work

Selection = Mapping[str, Any]


@dataclass(frozen=True)
class Claim:
    """A claim: a sentence, with the measure, the cells and the bounds by which it holds or does not.

    Five kinds, recognised by their keys. A selection is parameter -> value; it may name a `measure` of its own.

    of, with above, below or within: the median of the measure. less, than, with factor: paired, the one is smaller, by
    at least that factor. alike, to, by: paired, the ratio is within 1 / (1 + by) and 1 + by. of, grows, with above,
    below or within: the exponent with which the measure grows with a parameter. less, than, crosses, with within: the
    value of a parameter from which on the one is smaller.

    With `each`, a claim has to hold for every value of that parameter. A side selects one configuration: one value of
    every parameter but the seed, and that of grows and crosses. Two sides are paired by log, that is by seed. `where`
    and `each` do not apply to a side none of whose cells has the parameter: dead reckoning has no particles.
    """

    kind: Literal["value", "less", "alike", "grows", "crosses"]
    says: str
    measure: str
    first: Selection  # of, less or alike
    second: Selection  # than or to; empty where there is one side only
    low: float = -inf
    high: float = inf  # the bounds of the interval; less has its factor as `low`
    along: str = ""  # of grows and crosses
    each: str = ""
    where: Selection = field(default_factory=dict[str, Any])  # of both sides


@dataclass(frozen=True)
class Figure:
    """A figure: medians with intervals of `y` over `x`, one line for every value of `by`."""

    x: str  # a parameter
    y: str  # a column of cells.csv or metrics.csv
    by: str  # a parameter
    where: Mapping[str, Any]  # of the cells that are drawn: parameter -> value
    log: Literal["", "x", "y", "xy"]
    title: str
    caption: str
    printed: Mapping[str, Mapping[Any, float]] = field(default_factory=dict[str, Mapping[Any, float]])
    """published values of y, by whose they are and x"""


@dataclass(frozen=True, kw_only=True)
class Study(Work):
    """A study as its file has it, in one of its sizes."""

    name: str
    title: str
    question: str
    source: str
    finding: str  # what was published, "" for a question of one's own
    note: str  # for readers of the answer, such as why it differs from the published one
    size: Literal["quick", "full"]
    figures: tuple[Figure, ...]
    claims: tuple[Claim, ...]
    text: str  # the file

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the cells' parameters: dataset, backend, seed, then swept options."""
        return tuple(self.cells[0].parameters) if self.cells else ()


def about(study: Study, folder: Path, command: Sequence[str]) -> Callable[[Mapping[str, Any]], Mapping[str, Any]]:
    """The function that adds a study's facts to those of its record in `folder`, of the same study."""

    def facts(known: Mapping[str, Any]) -> Mapping[str, Any]:
        refuse_another(study, folder, known)
        named = {"name": study.name, "size": study.size, "text": study.text}
        return {"kind": "study", "command": list(command), **named}

    return facts


def refuse_another(study: Study, folder: Path, known: Mapping[str, Any]) -> None:
    """Raises InputError where a record's facts are not those of this study, of whatever text."""
    if known.get("kind", "study") != "study":
        raise InputError(f"--out {folder}: holds a run; expected a new folder, or one of the study {study.name}.")
    name = known.get("name", study.name)
    if name != study.name:
        raise InputError(f"--out {folder}: holds the study {name}, expected {study.name} or another folder.")
