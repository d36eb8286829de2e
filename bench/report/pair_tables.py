"""Makes the report's tables of pairs: every two backends' errors, and their costs."""

from math import isnan

from ..drawing.table import Entry, Table, TableRow
from ..verdict.accuracy import between
from ..verdict.costs import MARGIN, CostRatio
from ..verdict.ranking import standing
from ..verdict.statistics import FEWEST, Comparison
from ..verdict.verdict import Verdict
from ..words.columns import about
from ..words.numerals import counted, number
from ..words.report_columns import COST_PAIRS, PAIRS

COST_WORDS = {
    "cheaper": "cheaper",
    "dearer": "more costly",
    "alike": "alike",
    "open": "not told apart",
    "few": "too few rounds",
}

WORDS = {
    "better": "closer",
    "worse": "further off",
    "alike": "alike",
    "open": "not significant",
    "unproven": "not supported by the test",
    "few": "too few logs",
}


def pairs_table(found: Verdict) -> Table:
    """Makes the table of comparisons, one row each, in the verdict's order."""
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
    known, tested = not isnan(c.low), c.units >= FEWEST
    return [
        Entry("" if isnan(c.ratio) else number(c.ratio), note=_ends(c), value=None if isnan(c.ratio) else c.ratio),
        Entry(WORDS[standing(c)], note=between(c) if known and standing(c) == "open" else ""),
        Entry(("<0.0001" if c.adjusted < 1e-4 else f"{c.adjusted:.2g}") * tested, value=c.adjusted if tested else None),
        Entry(f"{c.effect:.2f}" if tested else "", value=c.effect if tested else None),
        Entry(f"{c.closer} of {c.n}", value=c.closer),
    ]


def cost_pairs_table(found: Verdict) -> Table:
    """Makes the table of every two backends' costs, one row each; without repeats it has none."""
    rows = [
        TableRow(c.first, [Entry(c.second), Entry(about(column).called), *_cost_entries(c)])
        for column, pairs in found.costs.items()
        for c in pairs
    ]
    caption = (
        "Every two backends' costs on the same logs in the same rounds: how many times the first one's the second one's"
        f" is, and its 95 % interval for the machine as it was; claimed where that is beyond {MARGIN:g}, as load shifts"
        " ratios"
    )
    return Table(COST_PAIRS, rows, caption)


def _cost_entries(c: CostRatio) -> list[Entry]:
    return [
        Entry(number(c.ratio), note=_ends(c), value=c.ratio),
        Entry(COST_WORDS[c.standing]),
        Entry(f"{counted(c.rounds, 'round')}, {counted(c.logs, 'log')}", value=c.rounds),
    ]


def _ends(c: Comparison | CostRatio) -> str:
    return "" if isnan(c.low) else f"{number(c.low)}\N{EN DASH}{number(c.high)}"
