"""Every comparison behind a verdict, as a table."""

from math import isnan

from ..drawing.table import Entry, Table, TableRow
from ..verdict.accuracy import between
from ..verdict.ranking import standing
from ..verdict.statistics import FEWEST, Comparison
from ..verdict.verdict import Verdict
from ..words.columns import about
from ..words.numerals import number
from ..words.report_columns import PAIRS

WORDS = {
    "better": "closer",
    "worse": "further off",
    "alike": "alike",
    "open": "cannot be told apart",
    "unproven": "not borne out by the test",
    "few": "too few logs",
}


def pairs_table(found: Verdict) -> Table:
    """A row a comparison, in the order of the verdict's; those with dead reckoning are corrected among themselves."""
    rows = [
        TableRow(c.first, [Entry(c.second), Entry(about(column).heading), *_entries(c)])
        for column, comparisons in found.comparisons.items()
        for c in comparisons
    ]
    caption = (
        "Every pair on the same logs: how many times the first one's error the second one's is, and its 95 % interval; "
        "those with dead reckoning are corrected among themselves"
    )
    return Table(PAIRS, rows, caption)


def _entries(c: Comparison) -> list[Entry]:
    tested = c.n >= FEWEST
    ends = f"{number(c.low)}\N{EN DASH}{number(c.high)}" if tested else ""
    return [
        Entry("" if isnan(c.ratio) else number(c.ratio), note=ends, value=None if isnan(c.ratio) else c.ratio),
        Entry(WORDS[standing(c)], note=between(c) if tested and standing(c) == "open" else ""),
        Entry(_p(c.adjusted) if tested else "", value=c.adjusted if tested else None),
        Entry(f"{c.effect:.2f}" if tested else "", value=c.effect if tested else None),
        Entry(f"{c.closer} of {c.n}", value=c.closer),
    ]


def _p(p: float) -> str:
    return "<0.0001" if p < 1e-4 else f"{p:.2g}"
