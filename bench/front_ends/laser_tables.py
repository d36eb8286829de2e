"""Writes the study of the laser front end as tables for the terminal, and as rows of the CSV."""

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table

from .laser import PARTS, Honesty, ScanCost, SearchCost

LaserRow = ScanCost | SearchCost | Honesty

LASER_COLUMNS = (
    *("log", "count", "median_ms", "mean_ms", "p99_ms", "match_ms", "insert_ms", "search_ms", "optimise_ms"),
    *("reference_ms", "ratio", "same", "true_x_m", "true_y_m", "true_heading_rad", "stated_x_m", "stated_y_m"),
    "stated_heading_rad",
)

REFERENCE = (
    "reference: ICP of a scan with the one before it, 20 rounds, SciPy's k-d tree and NumPy; ratio: mean by that"
)

EVERY_POSE = (
    "reference: every pose of the window tried, as sums of NumPy arrays; ratio: reference by search, the median"
)

TRUTH = (
    "root mean square of the true errors | root of the mean stated variance; NEES over 3 degrees of freedom, 1 is exact"
)


def scan_table(rows: Sequence[ScanCost]) -> Table:
    """Makes the table of CPU time per scan, one row per log."""
    table = _table("CPU time of a laser scan, ms, one thread", "log")
    for heading in ("scans", "median", "mean", "p99", *PARTS, "reference", "ratio"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.caption, table.caption_justify = REFERENCE, "left"
    for row in rows:
        parts = (f"{part:.2f}" for part in row.parts)
        figures = (f"{row.median:.2f}", f"{row.mean:.2f}", f"{row.p99:.1f}", *parts)
        table.add_row(row.log, f"{row.scans:,}", *figures, f"{row.icp:.2f}", f"{row.mean / row.icp:.2f}")
    return table


def search_table(row: SearchCost) -> Table:
    """Makes the table of one kind of search."""
    table = _table("CPU time of a search by branch and bound, ms, one thread", "window")
    for heading in ("poses", "searches", "median", "p99", "reference", "ratio", "same score"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.caption, table.caption_justify = EVERY_POSE, "left"
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


def honesty_table(rows: Sequence[Honesty]) -> Table:
    """Makes the table of errors beside their covariances: true | stated."""
    table = _table("Errors of the laser front end on made-up floors, true | stated", "factor")
    for heading in ("count", "x, mm", "y, mm", "heading, mrad", "NEES"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.caption, table.caption_justify = TRUTH, "left"
    for row in rows:
        pairs = (f"{1e3 * true:.1f} | {1e3 * stated:.1f}" for true, stated in zip(row.true, row.stated, strict=True))
        table.add_row(row.kind, f"{row.factors:,}", *pairs, f"{row.nees:.2f}")
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
    axes = ("x_m", "y_m", "heading_rad")
    true = {f"true_{axis}": figure for axis, figure in zip(axes, row.true, strict=True)}
    stated = {f"stated_{axis}": figure for axis, figure in zip(axes, row.stated, strict=True)}
    return {"study": f"laser {row.kind}", "count": row.factors, "nees": row.nees, **true, **stated}


def _table(title: str, first: str) -> Table:
    table = Table(title=f"[bold]{title}[/]", title_style="", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column(first, no_wrap=True)
    return table
