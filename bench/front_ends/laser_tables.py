"""Writes the study of the laser front end as tables for the terminal, and as rows of the CSV."""

import math
from collections.abc import Sequence

from rich.table import Table

from .consistency import Consistency
from .laser import PARTS, ScanCost, SearchCost
from .tables import CONSISTENCY_COLUMNS, consistency_record, plain

LaserRow = ScanCost | SearchCost | Consistency

LASER_COLUMNS = (
    *("log", "count", "median_ms", "mean_ms", "p99_ms", "match_ms", "insert_ms", "search_ms", "optimise_ms"),
    *("reference_ms", "ratio", "same", *CONSISTENCY_COLUMNS),
)

REFERENCE = (
    "reference: ICP of a scan with the one before it, 20 rounds, SciPy's k-d tree and NumPy; ratio: mean by that"
)

EVERY_POSE = (
    "reference: every pose of the window tried, as sums of NumPy arrays; ratio: reference by search, the median"
)


def scan_table(rows: Sequence[ScanCost]) -> Table:
    """Makes the table of CPU time per scan, one row per log."""
    headings = ("scans", "median", "mean", "p99", *PARTS, "reference", "ratio")
    table = plain("CPU time of a laser scan, ms, one thread", ["log"], headings, REFERENCE)
    for row in rows:
        parts = (f"{part:.2f}" for part in row.parts)
        figures = (f"{row.median:.2f}", f"{row.mean:.2f}", f"{row.p99:.1f}", *parts)
        table.add_row(row.log, f"{row.scans:,}", *figures, f"{row.icp:.2f}", f"{row.mean / row.icp:.2f}")
    return table


def search_table(row: SearchCost) -> Table:
    """Makes the table of one kind of search."""
    headings = ("poses", "searches", "median", "p99", "reference", "ratio", "same score")
    table = plain("CPU time of a search by branch and bound, ms, one thread", ["window"], headings, EVERY_POSE)
    table.add_row(
        f"±{row.window:g} m, ±{math.degrees(row.turn):.0f}°",
        f"{row.poses:,}",
        str(row.searches),
        f"{row.median:.2f}",
        f"{row.p99:.1f}",
        f"{row.exhaustive:.0f}",
        f"{row.ratio:.0f}",
        f"{row.same} of {row.compared}",
    )
    return table


def laser_record(row: LaserRow) -> dict[str, str | int | float]:
    """The columns of a row."""
    if isinstance(row, ScanCost):
        names = ("match_ms", "insert_ms", "search_ms", "optimise_ms")
        parts = dict(zip(names, row.parts, strict=True))
        figures = {"median_ms": row.median, "mean_ms": row.mean, "p99_ms": row.p99, **parts}
        against = {"reference_ms": row.icp, "ratio": row.mean / row.icp}
        return {"study": "laser scan", "log": row.log, "count": row.scans, **figures, **against}
    if isinstance(row, SearchCost):
        figures = {"median_ms": row.median, "p99_ms": row.p99, "reference_ms": row.exhaustive, "ratio": row.ratio}
        return {"study": "laser search", "count": row.searches, **figures, "same": row.same}
    return consistency_record("laser", row)
