"""A study: a question, the cells that can answer it, what to plot against what, and the claims to be tested on them.

A cell's parameters are what the study tells it apart by: `dataset` and `backend` as the file names them, `seed`, and
the options that it sweeps, each by its own name; every cell has all of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ...frontend.errors import InputError
from ..plan.work import Work
from .claim import Claim


@dataclass(frozen=True)
class Figure:
    """What to plot against what: medians with intervals of `y` over `x`, a line for every value of `by`."""

    x: str  # a parameter
    y: str  # a column of cells.csv or metrics.csv
    by: str  # a parameter
    where: Mapping[str, Any]  # of the cells that are drawn: parameter -> value
    log: Literal["", "x", "y", "xy"]
    title: str
    caption: str


@dataclass(frozen=True, kw_only=True)
class Study(Work):
    """A study as its file has it, in one of its sizes."""

    name: str
    title: str
    question: str
    source: str
    finding: str  # what was published, "" for a question of one's own
    note: str  # what a reader of the answer has to know, such as why it is another than the published one
    size: Literal["quick", "full"]
    figures: tuple[Figure, ...]
    claims: tuple[Claim, ...]
    text: str  # the file

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the cells' parameters: dataset, backend, seed, then what is swept."""
        return tuple(self.cells[0].parameters) if self.cells else ()


def about(study: Study, folder: Path, command: Sequence[str]) -> Callable[[Mapping[str, Any]], Mapping[str, Any]]:
    """The facts of the study for its record in `folder`, from those that are in it, which must be of the same study."""

    def facts(known: Mapping[str, Any]) -> Mapping[str, Any]:
        refuse_another(study, folder, known)
        named = {"name": study.name, "size": study.size, "text": study.text}
        return {"kind": "study", "command": list(command), **named}

    return facts


def refuse_another(study: Study, folder: Path, known: Mapping[str, Any]) -> None:
    """InputError where a record with the facts `known` is of something else than this study, of whatever text."""
    if known.get("kind", "study") != "study":
        raise InputError(f"--out {folder}: holds a run; expected a new folder, or one of the study {study.name}.")
    name = known.get("name", study.name)
    if name != study.name:
        raise InputError(f"--out {folder}: holds the study {name}, expected {study.name} or another folder.")
