"""Writes the study of the backends' speed as tables for the terminal, and as CSV."""

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table

from ...core.files import csv_text
from ..words.console import plain
from ..words.numerals import listed, number
from .isam2_parts import PARTS
from .ratios import Ratio, growth, step_of_parts
from .timing import FIFTHS, TimingRow

COLUMNS = (
    *("kind", "name", "beside", "landmarks", "particles", "reason", "steps", "mean_us", "p50_us", "p95_us", "p99_us"),
    *("max_us", *(f"fifth{k}_us" for k in range(1, FIFTHS + 1)), "finish_ms", "array_bytes", "resident_bytes"),
    "implementation",
)
"""kind: backend, reference, part of a backend's step, or together: in turns with others on the same steps. beside:
the backend in whose process a reference or part was timed. reason: why a row has no figures. fifth1_us ...: means
over the fifths of the run. finish_ms: the smoothing at the end, once. array_bytes: NumPy arrays that the backend
holds. resident_bytes: growth of the process, where a backend's memory is GTSAM's. implementation: whose program it
is."""

CAUTION = "Costs compare implementations, not algorithms alone."
STATE = "State: NumPy arrays held, with their room to grow; *: growth of the process, as GTSAM holds the memory."


def backend_table(rows: Sequence[TimingRow], title: str) -> Table:
    """Makes the table of every backend at every size; particles are a column where one has them."""
    table = _table(title, "backend")
    particles = any(row.particles is not None for row in rows)
    headings = ("N", *(["M"] if particles else []), "steps", "mean", "p50", "p95", "p99", "max", "1st ⅕", "last ⅕")
    for heading in (*headings, "state"):
        table.add_column(heading, justify="right", no_wrap=True)
    for index, row in enumerate(rows):
        size = (f"{row.landmarks:,}", *([f"{row.particles:,}" if row.particles else ""] if particles else []))
        new = index == 0 or rows[index - 1].name != row.name
        last = index + 1 == len(rows) or rows[index + 1].name != row.name
        name = plain(row.name) if new else ""
        if row.timing is None:
            table.add_row(name, *size, "[red]none[/]", end_section=last)
            continue
        t = row.timing
        figures = (t.mean, t.p50, t.p95, t.p99, t.max, t.fifths[0], t.fifths[-1])
        cells = (f"{t.steps:,}", *("" if math.isnan(us) else number(us) for us in figures))
        table.add_row(name, *size, *cells, _state(row), end_section=last)
    notes = _reasons(rows)
    if powers := growth(rows):
        fitted = "; ".join(f"{name} N^{power:z.2f}" for name, power in powers.items())
        notes.append(f"Median step, fitted to the three largest maps: {fitted}.")
    notes += _programs(rows)
    notes.append(STATE)
    table.caption, table.caption_justify = plain("\n".join(notes)) or None, "left"
    return table


def together_table(rows: Sequence[TimingRow], reference: str) -> Table:
    """Makes the table of what was timed in turns, every figure with its ratio to the reference's at that size."""
    table = _table(f"In turns on the same steps, µs, and how many times {plain(reference)}'s", "N", "backend")
    table.add_column("implementation", no_wrap=True)
    for heading in ("steps", "mean", "", "p50", "", "p99", ""):
        table.add_column(heading, justify="right", no_wrap=True)
    timings = {(row.name, row.landmarks): row.timing for row in rows}
    timed = [row for row in rows if row.timing is not None]
    for index, row in enumerate(timed):
        assert row.timing is not None
        new = index == 0 or timed[index - 1].landmarks != row.landmarks
        last = index + 1 == len(timed) or timed[index + 1].landmarks != row.landmarks
        basis = timings.get((reference, row.landmarks))
        cells = list[str]()
        for name in ("mean", "p50", "p99"):
            us = getattr(row.timing, name)
            cells += [number(us), f"{number(us / getattr(basis, name))} \N{MULTIPLICATION SIGN}" if basis else ""]
        size = f"{row.landmarks:,}" if new else ""
        table.add_row(size, plain(row.name), row.implementation, f"{row.timing.steps:,}", *cells, end_section=last)
    notes = [*_reasons(rows), CAUTION]
    table.caption, table.caption_justify = plain("\n".join(notes)), "left"
    return table


def reference_table(rows: Sequence[TimingRow]) -> Table:
    """Makes the table of references; of one timed beside several backends, beside the first."""
    table = _table("References, µs, each timed in the backend's own process", "reference", "beside")
    for heading in ("N", "M", "steps", "mean", "p50", "p99"):
        table.add_column(heading, justify="right", no_wrap=True)
    order = {name: k for k, name in enumerate(dict.fromkeys(row.name for row in rows))}
    first = {(row.name, row.landmarks, row.particles): row for row in reversed(rows) if row.kind == "reference"}
    shown = sorted(first.values(), key=lambda row: (order[row.name], row.particles or 0, row.landmarks))
    for row in shown:
        if row.timing is not None:
            t = row.timing
            size = (f"{row.landmarks:,}", f"{row.particles:,}" if row.particles else "")
            table.add_row(row.name, plain(row.beside), *size, f"{t.steps:,}", *map(number, (t.mean, t.p50, t.p99)))
    table.caption, table.caption_justify = plain("\n".join(_reasons(shown))) or None, "left"
    return table


def part_table(rows: Sequence[TimingRow]) -> Table:
    """Makes the table of an iSAM2 step's parts."""
    table = _table("Where a step of iSAM2 goes, µs, timed apart", "backend", "part")
    for heading in ("N", "mean", "of a step", "p50", "p99"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        if row.kind == "part" and row.timing is not None:
            whole = step_of_parts(rows, row.beside, row.landmarks)
            share = f"{100 * row.timing.mean / whole:.1f} %" if row.name in PARTS else "apart"
            figures = (number(row.timing.mean), share, number(row.timing.p50), number(row.timing.p99))
            table.add_row(plain(row.beside), row.name, f"{row.landmarks:,}", *figures)
    return table


def ratio_table(ratios: Sequence[Ratio]) -> Table:
    """Makes the table of expectations and values reached."""
    table = _table("What is expected of them", "what", "expected")
    table.add_column("reached", justify="right", no_wrap=True)
    table.columns[0].no_wrap = False
    for ratio in ratios:
        style = "green" if ratio.holds else "bold red"
        table.add_row(plain(ratio.what), ratio.expected, f"[{style}]{ratio.found}[/]")
    return table


def as_csv(rows: Sequence[TimingRow]) -> str:
    """Writes one line per row, in COLUMNS; blank where there is no such figure."""
    records = [row._asdict() | ({} if row.timing is None else _figures(row)) for row in rows]
    return csv_text(COLUMNS, ([record.get(name) for name in COLUMNS] for record in records))


def ratios_as_csv(ratios: Sequence[Ratio]) -> str:
    """Writes one line per comparison: what, expected, reached, unit, holds."""
    head = ("what", "expected", "reached", "unit", "holds")
    return csv_text(head, ((r.what, r.expected, f"{r.reached:.4g}", r.unit, str(r.holds).lower()) for r in ratios))


def _figures(row: TimingRow) -> dict[str, float | str]:
    assert row.timing is not None
    t = row.timing
    fifths = {f"fifth{k}_us": us for k, us in enumerate(t.fifths, 1)}
    figures = {"mean_us": t.mean, "p50_us": t.p50, "p95_us": t.p95, "p99_us": t.p99, "max_us": t.max, **fifths}
    return {"steps": t.steps} | {name: "" if math.isnan(us) else round(us, 4) for name, us in figures.items()}


def _programs(rows: Sequence[TimingRow]) -> list[str]:
    by_kind: dict[str, dict[str, None]] = {}
    for row in rows:
        if row.implementation:
            by_kind.setdefault(row.implementation, {})[row.name] = None
    if len(by_kind) < 2:
        return []
    return ["; ".join(f"{kind}: {', '.join(names)}" for kind, names in by_kind.items()) + f". {CAUTION}"]


def _reasons(rows: Sequence[TimingRow]) -> list[str]:
    """Lists why rows have no figures, each reason once, with the sizes at which it holds."""
    sizes: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.reason:
            size = f"N={row.landmarks:,}" + (f" M={row.particles:,}" if row.particles else "")
            sizes.setdefault((row.name, row.reason), []).append(size)
    return [f"{name}, {listed(at)}: {reason}." for (name, reason), at in sizes.items()]


def _state(row: TimingRow) -> str:
    size = row.array_bytes if row.resident_bytes is None else max(row.resident_bytes, 0)
    if size is None:
        return ""
    star = "" if row.resident_bytes is None else "*"
    for unit, bytes_of in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= bytes_of:
            return f"{number(size / bytes_of)} {unit}{star}"
    return f"{size} B{star}"


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
