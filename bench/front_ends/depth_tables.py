"""Writes the study of the front end for depth cameras as tables for the terminal, and as rows of the CSV."""

from collections.abc import Sequence

from rich.table import Table

from .consistency import Consistency
from .depth import DepthRow, FrameCost, LoopCost, PairCost
from .depth_timed import PARTS
from .tables import consistency_record, plain

DEPTH_COLUMNS = (*(f"{part}_ms" for part in PARTS), *("places", "held_mb", "held_kb_a_frame"))

ORB = "frames: those looked at; ORB: OpenCV's detector alone, on the same frames; ratio: mean by that"

OPENCV = (
    "reference: OpenCV's brute-force matcher, for neighbours followed by solvePnPRansac; ratio: mean by that, on the "
    "same pairs"
)

HELD = "held: arrays that the front end keeps, at the end of the longest drive, and their growth over its last half"


def frame_table(rows: Sequence[FrameCost]) -> Table:
    """Makes the table of CPU time per frame, one row per log."""
    headings = ("frames", "median", "mean", "p99", *PARTS, "ORB", "ratio")
    table = plain("CPU time of a depth camera's frame beside loop search, ms, one thread", ["log"], headings, ORB)
    for row in rows:
        figures = (row.median, row.mean, row.p99, *row.parts, row.orb)
        table.add_row(row.log, f"{row.frames:,}", *(f"{figure:.1f}" for figure in figures), f"{row.ratio:.1f}")
    return table


def pair_table(rows: Sequence[PairCost]) -> Table:
    """Makes the table of CPU time per pair of frames, one row per kind and log."""
    headings = ("pairs", "mean", "p99", "reference", "ratio")
    table = plain("CPU time of a pair of frames, ms, one thread", ["log", "pair"], headings, OPENCV)
    for row in rows:
        figures = (row.mean, row.p99, row.reference, row.ratio)
        table.add_row(row.log, row.kind, f"{row.pairs:,}", *(f"{figure:.2f}" for figure in figures))
    return table


def loop_table(rows: Sequence[LoopCost]) -> Table:
    """Makes the table of loop search and of memory, one row per log."""
    headings = ("frames", "median", "mean", "p99", "places", "held, MB", "KB a frame")
    table = plain("CPU time of loop search in a frame, ms, one thread; memory", ["log"], headings, HELD)
    for row in rows:
        figures = (f"{row.median:.1f}", f"{row.mean:.1f}", f"{row.p99:.1f}")
        table.add_row(row.log, f"{row.frames:,}", *figures, str(row.places), f"{row.held_mb:.1f}", f"{row.held_kb:.1f}")
    return table


def depth_record(row: DepthRow) -> dict[str, str | int | float]:
    """The columns of a row."""
    if isinstance(row, Consistency):
        return consistency_record("depth", row)
    figures = {"log": row.log, "mean_ms": row.mean, "p99_ms": row.p99}
    if isinstance(row, PairCost):
        against = {"reference_ms": row.reference, "ratio": row.ratio}
        return {"study": f"depth pair, {row.kind}", "count": row.pairs, **figures, **against}
    figures |= {"count": row.frames, "median_ms": row.median}
    if isinstance(row, LoopCost):
        memory = {"places": row.places, "held_mb": row.held_mb, "held_kb_a_frame": row.held_kb}
        return {"study": "depth loop search", **figures, **memory}
    parts = {f"{part}_ms": spent for part, spent in zip(PARTS, row.parts, strict=True)}
    return {"study": "depth frame", **figures, **parts, "reference_ms": row.orb, "ratio": row.ratio}
