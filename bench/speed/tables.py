"""Writes the study of the backends' speed as tables for the terminal, and as CSV."""

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table

from ...core.files import csv_text
from ..words.console import plain
from ..words.numerals import listed, number
from .isam2_parts import BY_HAND, PARTS, WHOLE
from .timing import FIFTHS, TimingRow

COLUMNS = (
    *("kind", "name", "beside", "landmarks", "reason", "steps", "mean_us", "p50_us", "p95_us", "p99_us", "max_us"),
    *(f"fifth{k}_us" for k in range(1, FIFTHS + 1)),
    "implementation",
)
"""kind: backend, or part of a backend's step. beside: the backend of a part. reason: why a row has no figures.
fifth1_us ...: means over the fifths of the run. implementation: whose program it is."""

CAUTION = "Costs compare implementations, not algorithms alone."


def turns_table(rows: Sequence[TimingRow], which: str) -> Table:
    """Makes the table of what was timed in turns, every figure with its ratio to the first backend's at that size."""
    timed = [row for row in rows if row.kind == "backend" and row.timing is not None]
    first = dict[int, TimingRow]()
    for row in timed:
        first.setdefault(row.landmarks, row)
    names = " or ".join(dict.fromkeys(row.name for row in first.values())) or "the first"
    table = _table(f"CPU time of a step, µs, and how many times {plain(names)}'s: {which}", "N", "backend")
    table.add_column("implementation", no_wrap=True)
    for heading in ("steps", "mean", "", "p50", "", "p99", ""):
        table.add_column(heading, justify="right", no_wrap=True)
    for index, row in enumerate(timed):
        assert row.timing is not None
        new = index == 0 or timed[index - 1].landmarks != row.landmarks
        last = index + 1 == len(timed) or timed[index + 1].landmarks != row.landmarks
        basis = first[row.landmarks].timing
        cells = list[str]()
        for name in ("mean", "p50", "p99"):
            us = getattr(row.timing, name)
            cells += [number(us), f"{number(us / getattr(basis, name))} \N{MULTIPLICATION SIGN}"]
        size = f"{row.landmarks:,}" if new else ""
        table.add_row(size, plain(row.name), row.implementation, f"{row.timing.steps:,}", *cells, end_section=last)
    table.caption, table.caption_justify = plain("\n".join([*_reasons(rows), CAUTION])), "left"
    return table


def part_table(rows: Sequence[TimingRow]) -> Table:
    """Makes the table of an iSAM2 step's parts, and of the step beside a loop over GTSAM by hand."""
    table = _table("Where a step of iSAM2 goes, µs, timed apart", "backend", "part")
    for heading in ("N", "mean", "of a step", "p50", "p99"):
        table.add_column(heading, justify="right", no_wrap=True)
    by_hand = {(row.beside, row.landmarks): row.timing for row in rows if row.name == BY_HAND and row.timing}
    for row in rows:
        if row.kind == "part" and row.timing is not None:
            whole = step_of_parts(rows, row.beside, row.landmarks)
            share = f"{100 * row.timing.mean / whole:.1f} %" if row.name in PARTS else "apart"
            if row.name == WHOLE:
                other = by_hand[row.beside, row.landmarks]
                share = f"{row.timing.mean / other.mean:.2f} \N{MULTIPLICATION SIGN} by hand"
            figures = (number(row.timing.mean), share, number(row.timing.p50), number(row.timing.p99))
            table.add_row(plain(row.beside), row.name, f"{row.landmarks:,}", *figures)
    return table


def step_of_parts(rows: Sequence[TimingRow], beside: str, landmarks: int) -> float:
    """The mean step, in µs, of which the parts beside that backend are parts."""
    mine = [row for row in rows if row.kind == "part" and (row.beside, row.landmarks) == (beside, landmarks)]
    return sum(row.timing.mean for row in mine if row.name in PARTS and row.timing)


def as_csv(rows: Sequence[TimingRow]) -> str:
    """Writes one line per row, in COLUMNS; blank where there is no such figure."""
    records = [row._asdict() | ({} if row.timing is None else _figures(row)) for row in rows]
    return csv_text(COLUMNS, ([record.get(name) for name in COLUMNS] for record in records))


def _figures(row: TimingRow) -> dict[str, float | str]:
    assert row.timing is not None
    t = row.timing
    fifths = {f"fifth{k}_us": us for k, us in enumerate(t.fifths, 1)}
    figures = {"mean_us": t.mean, "p50_us": t.p50, "p95_us": t.p95, "p99_us": t.p99, "max_us": t.max, **fifths}
    return {"steps": t.steps} | {name: "" if math.isnan(us) else round(us, 4) for name, us in figures.items()}


def _reasons(rows: Sequence[TimingRow]) -> list[str]:
    """Lists why rows have no figures, each reason once, with the sizes at which it holds."""
    sizes: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.reason:
            sizes.setdefault((row.name, row.reason), []).append(f"N={row.landmarks:,}" if row.landmarks else "")
    return [f"{', '.join([name, listed(at)][: 1 + any(at)])}: {reason}." for (name, reason), at in sizes.items()]


def _table(title: str, *texts: str) -> Table:
    table = Table(
        title=f"\n[bold]{title}[/]\n",
        title_style="",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        collapse_padding=True,
        pad_edge=False,
        show_edge=False,
    )
    for heading in texts:
        table.add_column(heading, overflow="fold")
    return table
