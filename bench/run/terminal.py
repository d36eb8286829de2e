"""Prints a run's results: one table per dataset, which backend to use, and what went wrong."""

import io
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table

from ..verdict.association import association_sentences
from ..verdict.bound_words import bound_sentence
from ..verdict.consistency import void
from ..verdict.cost_words import basis, meanwhile, repeat_troubles
from ..verdict.implementations import sentence
from ..verdict.ranking import path_errors
from ..verdict.statistics import FEWEST
from ..verdict.summary import Line, typical, units_of
from ..verdict.verdict import Verdict, verdict
from ..words.console import plain, watched, wrapped
from ..words.names import called
from ..words.numerals import counted
from .cell_remarks import cell_remarks

LOST = 1e6  # m, or NEES, from which on only the order of magnitude is shown
LABEL = (18, 28, 60)  # columns of a backend's label before it is wrapped: below NARROW, below MEDIUM, and beyond

NARROW, MEDIUM = 70, 100

FIRST_TO_GO = ("p99", "in 95 %", "step, µs", "done", "map, m")  # where space is short; three of them before intervals
STATUS_STYLE = {"done": "green", "skipped": "magenta"}  # others are red; yellow cannot be read on white
PURPOSES = {"online": "online", "final": "afterwards", "map": "for the map"}  # headings of recommendations, by purpose
PURPOSE = 11  # columns of the headings
NONE: Mapping[str, Sequence[str]] = {}


def by_dataset(lines: Sequence[Line]) -> dict[str, list[Line]]:
    """Groups the lines by dataset label."""
    found: dict[str, list[Line]] = {}
    for line in lines:
        found.setdefault(line.dataset, []).append(line)
    return found


def verdicts(lines: Sequence[Line]) -> dict[str, Verdict]:
    """The verdict on each dataset, by its label."""
    return {dataset: verdict(mine) for dataset, mine in by_dataset(lines).items()}


def conclude(console: Console, lines: Sequence[Line], remarks: Mapping[str, Sequence[str]] = NONE) -> None:
    """Prints the results, dataset by dataset, with the `remarks` on its logs."""
    found = by_dataset(lines)
    for table, mine in zip(tables(lines, console.width), found.values(), strict=True):
        console.print(table)
        said = [
            *(_uses(verdict(mine)) if any(line.done for line in mine) else ()),
            *(("bound", said) for said in (bound_sentence(mine),) if said),
            *(("ids", said) for said in association_sentences(mine)),
            *(("costs", said) for said in (sentence(mine), basis(mine), meanwhile(mine)) if said),
            *(("remark", said) for said in repeat_troubles(mine)),
            *failures(mine),
            *(("remark", remark) for remark in remarks.get(mine[0].dataset, ())),
        ]
        if watched(console):  # else each cell has told its own at its end
            said += [("cells", remark) for remark in cell_remarks(mine)]
            console.print(_folded(said), highlight=False)
        for heading, text in () if watched(console) else said:
            console.print(f"  {heading:<{PURPOSE}}  {plain(text)}", highlight=False, soft_wrap=True)
        console.print()


def _folded(said: Sequence[tuple[str, str]]) -> Padding:
    shown = Table.grid(padding=(0, 2))
    shown.add_column(no_wrap=True, style="dim", min_width=PURPOSE)
    shown.add_column()
    for heading, text in said:
        shown.add_row(heading, plain(text))
    return Padding(shown, (0, 0, 0, 2))


def _uses(found: Verdict) -> Iterator[tuple[str, str]]:
    for use in found.uses:
        yield PURPOSES.get(use.purpose, use.purpose), f"{use.backend}: {use.why}" if use.backend else use.why
    if not found.uses and found.sentences:
        yield "verdict", found.sentences[0]


def failures(lines: Sequence[Line]) -> Iterator[tuple[str, str]]:
    """Yields what went wrong on one dataset: cells not done, by backend."""
    rows = [row.columns for line in lines for row in line.rows]
    if rows and all(row["status"] == "skipped" for row in rows):
        yield "nothing run", f"{counted(len(rows), 'cell')}, all skipped: there is nothing to compare"
    for line in lines:
        ends: dict[tuple[str, str], int] = {}
        for row in line.rows:
            end = row.columns["status"], row.columns["reason"] or ""
            ends[end] = ends.get(end, 0) + (end[0] != "done")
        for (status, reason), n in ends.items():
            if n:
                yield status, f"{line.backend}, {n} of {len(line.rows)}: {reason}"
    for line in lines:
        steps = [(row.columns["nees_void"], row.columns["steps"]) for row in line.rows if row.columns["nees_void"]]
        if steps:
            wrong, of = max(steps)
            cells = f" in {len(steps)} of {counted(len(line.rows), 'cell')}" if len(line.rows) > 1 else ""
            yield "remark", f"{line.backend}: NEES: not a covariance at {wrong:,} of {counted(of, 'step')}{cells}"


def complain(lines: Sequence[Line]) -> None:
    """Prints what failed on standard error, for a user who asked for nothing else."""
    for dataset, mine in by_dataset(lines).items():
        for heading, text in failures(mine):
            if heading != "remark":
                print(f"bench: {dataset}: {heading}: {text}", file=sys.stderr)


def status(lines: Sequence[Line]) -> int:
    """A run's exit status: 0 where something was done and nothing failed; 1 also if all were skipped."""
    ends = [row.columns["status"] for line in lines for row in line.rows]
    ends += [one["status"] for line in lines for row in line.rows for one in row.rounds]
    return 0 if "done" in ends and set(ends) <= {"done", "skipped"} else 1


def tables(lines: Sequence[Line], width: int, planned: Mapping[tuple[str, str], int] | None = None) -> list[Table]:
    """Makes one table per dataset, with the columns that fit into `width`.

    Medians over the logs, and their 95 % intervals from FEWEST logs on, else ranges over the cells. During a run,
    `planned` are its cells by dataset and backend; then there are no intervals yet.
    """
    groups = by_dataset(lines)
    names = called(list(groups))
    rows = [[_entries(line, planned) for line in group] for group in groups.values()]
    shown: list[Table] = []
    whole = all(line.done == len(line.rows) for line in lines)
    for form in _forms(width, [] if planned is not None else range(5 if whole else 4)):
        shown = [
            _table(names[dataset], group, entries, form)
            for (dataset, group), entries in zip(groups.items(), rows, strict=True)
        ]
        if all(Measurement.get(_RULER, _RULER.options, table).maximum <= width for table in shown):
            break
    return shown


_RULER = Console(width=1000, emoji=False, file=io.StringIO())


class _Form(NamedTuple):
    without: Sequence[str]
    ranges: bool
    label: int  # columns


def _forms(width: int, with_ranges: Sequence[int]) -> Iterator[_Form]:
    """Yields forms, the richest first; `with_ranges` are how many columns may go before ranges do."""
    label = min(LABEL[(width >= NARROW) + (width >= MEDIUM)], max(8, width - 32))
    yield from (_Form(FIRST_TO_GO[:k], True, label) for k in with_ranges)
    yield from (_Form(FIRST_TO_GO[:k], False, label) for k in range(len(FIRST_TO_GO) + 1))


class _Entry(NamedTuple):
    text: str
    ends: str = ""


def _entries(line: Line, planned: Mapping[tuple[str, str], int] | None) -> dict[str, _Entry]:
    """A line's entries by heading; the map's where true places are known."""
    v = line.values
    spreads = {
        "ATE, m": (path_errors(line.truth_kind)["online"],),
        "final, m": (path_errors(line.truth_kind)["final"],),
        "map, m": ("final_map_rmse_m", "map_rmse_m") if line.surveyed else (),
    }
    of = len(line.rows) if planned is None else planned[line.dataset, line.backend]
    entries = {"done": _Entry(f"{line.done}/{of}")}
    for heading, columns in spreads.items():
        column = next((column for column in columns if column in v), None)
        entries[heading] = _Entry("") if column is None else _metres(*_ends(line, column, final=planned is None))
    nees = v.get("nees")
    form = "" if nees is None else ".2f" if nees.median < 100 else ".0f" if nees.median < LOST else ".1e"
    entries["NEES / 3"] = _Entry("none" * void(line) if nees is None else f"{nees.median:{form}}")
    inside, p50, p99 = (v.get(name) for name in ("nees_inside", "step_us_p50", "step_us_p99"))
    entries["in 95 %"] = _Entry("" if inside is None else f"{100 * inside.median:.0f} %")
    batch = bool(entries["final, m"].text) and not entries["ATE, m"].text  # it keeps the steps until the end
    entries["step, µs"] = _Entry("" if p50 is None or batch else _whole(p50.median))
    entries["p99"] = _Entry("" if p99 is None or batch else _whole(p99.median) + ("" if line.alone else "*"))
    return entries


def _ends(line: Line, column: str, *, final: bool) -> tuple[float, float, float]:
    """The column's median and the ends of its interval, or range; NaN ends for a single value."""
    value = line.values[column]
    median, low, high = typical(line, column)[:3] if final else (value.median, value.low, value.high)
    return (median, low, high) if low < high else (median, math.nan, math.nan)


def _table(name: str, lines: Sequence[Line], entries: Sequence[Mapping[str, _Entry]], form: _Form) -> Table:
    of = units_of(lines)
    title = f"[bold]{plain(name)}[/], {plain(str(of))}"
    known = next((line for line in lines if line.rows), lines[0])
    if known.truth_kind == "reference":
        title += f"; truth unknown: errors{' of paths' * known.surveyed} are distances from {known.reference}"
    if known.with_path is not None:
        title += f"; true path known of {known.with_path}"
    if known.truth_kind == "relations":
        title += "; truth of the path unknown: errors are of true motions between pairs of poses"
    if form.ranges and any(entry.ends for row in entries for entry in row.values()):
        ranges = ", ranges of paths" * (known.with_path is not None and known.with_path.n < FEWEST)
        title += f"; medians ({f'95 % intervals{ranges}' if of.n >= FEWEST else 'ranges'})"
    shown = Table(title=title, title_style="", title_justify="left", box=box.SIMPLE_HEAD, collapse_padding=True)
    shown.add_column("backend", no_wrap=True, overflow="ellipsis", max_width=form.label + 2)
    absent = {"NEES / 3", "in 95 %"} if known.truth_kind == "relations" else set[str]()
    absent |= set() if known.surveyed else {"map, m"}
    headings = [h for h in entries[0] if h not in form.without and h not in absent]
    texts = [[row[h].text + row[h].ends * form.ranges for h in headings] for row in entries]
    called = {"ATE, m": "online, m"} if known.truth_kind == "relations" else {}
    tops = [called.get(heading, heading) for heading in headings]
    for heading, *column in zip(tops, *texts, strict=True):  # what has to be cut is the label, never a number
        shown.add_column(heading, justify="right", no_wrap=True, min_width=max(map(len, (heading, *column))))
    for line, row in zip(lines, texts, strict=True):
        shown.add_row(plain(wrapped(line.backend, form.label)) + " \N{DAGGER}" * line.told, *row)
    notes = ["* timed while other cells ran beside it"] * ("p99" in headings and not all(line.alone for line in lines))
    notes += ["\N{DAGGER} was given the ground truth (--oracle)"] * any(line.told for line in lines)
    if notes:
        shown.caption, shown.caption_justify = "\n".join(notes), "left"
    return shown


def _whole(value: float) -> str:
    return "<1" if value < 0.5 else f"{value:.0f}"


def _metres(median: float, low: float, high: float) -> _Entry:
    """Writes metres to a millimetre, or to a thousandth where that is coarser; beyond LOST the order of magnitude."""
    highest = median if math.isnan(high) else high
    if math.isinf(median):
        return _Entry("failed")
    if highest < 0.0005:
        return _Entry("<0.001")
    form = ".3f" if median < 10 else ".2f" if median < 100 else ".1f" if highest < LOST else ".1e"
    return _Entry(f"{median:{form}}", "" if math.isnan(low) else f" ({low:{form}}-{high:{form}})")
