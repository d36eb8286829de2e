"""A study: a question, the cells that can answer it, what to plot against what, and the claims to be tested on them.

A cell's parameters are what the study tells it apart by: `dataset` and `backend` as the file names them, `seed`, and
the options that it sweeps, each by its own name; every cell has all of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from ..plan.plan import Cell
from .claim import Claim


class StudyCell(NamedTuple):
    """One backend on one log, and where it stands in the study."""

    cell: Cell
    parameters: Mapping[str, Any]  # dataset, backend, seed and what is swept -> value; None: it has no such option
    timed: bool  # it is to run alone on its machine


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


@dataclass(frozen=True)
class Study:
    """A study as its file has it, in one of its sizes."""

    name: str
    title: str
    question: str
    source: str
    finding: str  # what was published, "" for a question of one's own
    note: str  # what a reader of the answer has to know, such as why it is another than the published one
    size: Literal["quick", "full"]
    cells: tuple[StudyCell, ...]
    figures: tuple[Figure, ...]
    claims: tuple[Claim, ...]
    keep: bool  # paths and other arrays go into the store, too
    oracle: bool
    timeout_s: float  # a cell
    memory_mb: int  # a cell
    text: str  # the file

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the cells' parameters: dataset, backend, seed, then what is swept."""
        return tuple(self.cells[0].parameters) if self.cells else ()
