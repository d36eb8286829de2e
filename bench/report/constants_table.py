"""Makes the report's table of the constant errors of sensors that backends have estimated."""

from collections.abc import Iterator, Sequence

import numpy as np

from ..drawing.table import Entry, Table, TableRow
from ..measure.constants import KINDS, UNITS, column
from ..verdict.ranking import ordered
from ..verdict.summary import Line, typical
from ..words.columns import about
from ..words.numerals import number
from ..words.report_columns import ESTIMATED

PARTICLES = "FastSLAM states the spread of its surviving particles as the standard deviation of a constant: too small"


def constants_table(lines: Sequence[Line]) -> Table:
    """Makes the table, a row for each backend and constant: medians over the logs; none where none is estimated."""
    rows = [
        TableRow(line.backend, [Entry(_called(k)), *(_entry(line, column(k, end)) for end in ("", "_sd", "_true"))])
        for k in range(len(KINDS))
        for line in ordered(lines)
        if column(k) in line.values
    ]
    caption = (
        "Medians over the logs, beside an estimate their 95 % interval or, of fewer than 6 logs, their range; true: as "
        "the simulated world has drawn it or, where path and landmarks are known, as fits the measurements best there"
    )
    if any(row.backend.startswith("fastslam") for row in rows):
        off = [one for line in lines if line.backend.startswith("fastslam") for one in _off(line)]
        caption += f". {PARTICLES}"
        caption += f", the error being {number(float(np.median(off)))} times that (median)" if off else ""
    having = [k for k in range(len(ESTIMATED)) if any(row.entries[k].text for row in rows)]
    rows = [row._replace(entries=[row.entries[k] for k in having]) for row in rows]
    return Table([ESTIMATED[k] for k in having], rows, caption)


def _off(line: Line) -> Iterator[float]:
    """Yields errors of constants over their stated standard deviations, of every run where both are known."""
    for c in (row.columns for row in line.rows if row.columns["status"] == "done"):
        for k in range(len(KINDS)):
            found, sd, true = (c.get(column(k, end)) for end in ("", "_sd", "_true"))
            if found is not None and true is not None and sd:
                yield abs(found - true) / sd


def _called(kind: int) -> str:
    return about(column(kind)).heading + f", {UNITS[kind]}" * bool(UNITS[kind])


def _entry(line: Line, name: str) -> Entry:
    if name not in line.values:
        return Entry("")
    found = typical(line, name)
    ends = "" if found.low == found.high else f"{number(found.low)} to {number(found.high)}"
    return Entry(number(found.value), note=ends * ("_sd" not in name), value=found.value)
