"""Makes the report's table of the constant errors of sensors that backends have estimated."""

from collections.abc import Sequence

from ..drawing.table import Entry, Table, TableRow
from ..verdict.ranking import ordered
from ..verdict.summary import Line, typical
from ..words.columns import CONSTANTS, ESTIMATED, about
from ..words.numerals import number


def constants_table(lines: Sequence[Line]) -> Table:
    """Makes the table, a row for each backend and constant: medians over the logs; none where none is estimated."""
    rows = [
        TableRow(line.backend, [Entry(_called(name)), *(_entry(line, column) for column in _columns(name))])
        for name, *_ in CONSTANTS
        for line in ordered(lines)
        if name in line.values
    ]
    caption = (
        "Medians over the logs, beside an estimate their 95 % interval or, of fewer than 6 logs, their range; true: as "
        "the simulated world has drawn it or, where path and landmarks are known, as fits the measurements best there"
    )
    return Table(ESTIMATED, rows, caption)


def _columns(name: str) -> tuple[str, str, str]:
    return name, f"{name}_sd", f"{name}_true"


def _called(name: str) -> str:
    unit = about(name).kind.unit
    return about(name).heading + f", {unit}" * bool(unit)


def _entry(line: Line, column: str) -> Entry:
    if column not in line.values:
        return Entry("")
    found = typical(line, column)
    ends = "" if found.low == found.high else f"{number(found.low)} to {number(found.high)}"
    return Entry(number(found.value), note=ends * (not column.endswith("_sd")), value=found.value)
