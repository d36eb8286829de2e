"""Columns of tables and files: name, heading, meaning, and the kind of their values."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from .numerals import number

SHORTEST_S = 0.001  # s; shorter times are written as below this: a filter's finish does nothing


def _count(value: float) -> str:
    return f"{value:,.0f}"


def _percent(value: float) -> str:
    return f"{number(100 * value)} %"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Properties that the values of a column share."""

    unit: str = ""  # "" for words, counts, shares and plain numbers
    sql_type: Literal["TEXT", "INTEGER", "REAL"] = "REAL"
    names_cell: bool = False  # part of the key of a cell
    of_plan: bool = False  # said by the plan alone, so that a result does not depend on it
    is_error: bool = False  # a cell that failed counts as infinite in it
    is_time: bool = False  # depends on a clock, and is marked * where other cells ran beside
    never_negative: bool = True
    expected: float | None = None  # its mean where the covariances match the errors
    shown: Callable[[float], str] = number  # as a table has it, without the unit

    @property
    def is_measured(self) -> bool:
        """True for a number that was counted or measured in a cell."""
        return not self.names_cell and self.sql_type != "TEXT"

    @property
    def is_nees(self) -> bool:
        """True where 1 means that the covariances match the errors."""
        return self.expected == 1


TEXT = Kind(sql_type="TEXT")
PLANNED = Kind(sql_type="TEXT", of_plan=True)
NAME = Kind(sql_type="TEXT", names_cell=True)
SEED = Kind(sql_type="INTEGER", names_cell=True, shown=_count)
COUNT = Kind(sql_type="INTEGER", shown=_count)
NUMBER = Kind()
ERROR_M = Kind(unit="m", is_error=True)
ERROR_DEG = Kind(unit="degrees", is_error=True)
ERROR_RAD = Kind(unit="rad", is_error=True)
BOUND_M = Kind(unit="m")
METRES = Kind(unit="m", never_negative=False)
RADIANS = Kind(unit="rad", never_negative=False)
SIGNED = Kind(never_negative=False)
SD_RAD = Kind(unit="rad")
TURN_RATE = Kind(unit="rad/s", never_negative=False)
SD_TURN_RATE = Kind(unit="rad/s")
NEES = Kind(expected=1.0)
INSIDE_95 = Kind(expected=0.95, shown=_percent)
SHARE = Kind(shown=_percent)
CPU_US = Kind(unit="µs", is_time=True)
CPU_MS = Kind(unit="ms", is_time=True)
CPU_S = Kind(unit="s", is_time=True, shown=lambda s: number(s) if s >= SHORTEST_S else f"<{SHORTEST_S:g}")
CPU_SHARE = Kind(is_time=True, shown=_percent)
CPU_RATIO = Kind(is_time=True)
EXPONENT = Kind(is_time=True, never_negative=False, shown=lambda b: f"{round(b, 2) + 0.0:.2f}")  # never -0.00
SECONDS = Kind(unit="s")
MACHINE = Kind(is_time=True)
MEGABYTES = Kind(unit="MB")


class Column(NamedTuple):
    """A column of cells.csv, of metrics.csv or of a report's tables."""

    name: str
    heading: str  # in a table
    kind: Kind
    meaning: str
    said: str = ""  # its name on an axis or in a sentence, where the heading needs the table's

    @property
    def called(self) -> str:
        """Returns its name where it stands alone, without a unit."""
        return self.said or self.heading

    @property
    def with_unit(self) -> str:
        """Returns its name with its unit, or with the expected value."""
        return self.called + f", {self.kind.unit}" * bool(self.kind.unit) + " (1 = consistent)" * self.kind.is_nees

    @property
    def gist(self) -> str:
        """Returns its name and the first sentence of its meaning; "" for a column that has none."""
        first = self.meaning.split(". ")[0].rstrip(".")
        lowered = first if first[:2].isupper() else first[:1].lower() + first[1:]  # abbreviations stay
        return first and f"{self.called[:1].upper()}{self.called[1:]}: {lowered}."
