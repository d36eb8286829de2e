"""`bench speed --frontend`: cost, accuracy and consistency of every corner refinement."""

import argparse
from pathlib import Path

from rich.console import Console

from ...frontend.errors import InputError
from ...frontend.files import write_whole
from ..words.console import ProgressBar
from .corner_tables import Row, accuracy_table, as_csv, cost_table, misreading_table
from .corners import FULL, MOVING, QUICK, STILL, STREAK, Accuracy, Extent, Study, steps

OPTIONS = ("placements", "clutter", "crowded")  # the study's own options


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    add = group.add_argument
    add("--placements", type=int, metavar="N", help=f"markers looked at for each distance ({FULL.placements})")
    add(
        "--clutter", type=int, metavar="N", help=f"frames without a marker, full of what resembles one ({FULL.clutter})"
    )
    add("--crowded", type=int, metavar="N", help=f"frames with six markers, looked through ({FULL.crowded})")


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    extent = _extent(namespace)
    rows = _measure(Study(namespace.seed), extent, console)
    written: list[Path] = []
    if namespace.csv is not None:
        write_whole(namespace.csv, as_csv(rows))
        written.append(namespace.csv)
    if namespace.out is not None:
        written += _write(namespace.out, rows)
    return written


def _extent(namespace: argparse.Namespace) -> Extent:
    extent = QUICK if namespace.quick else FULL
    for flag, least in (("placements", 2), ("clutter", 0), ("crowded", 0)):
        count = getattr(namespace, flag)
        if count is not None and count < least:
            raise InputError(f"--{flag} {count}: expected {least} or more")
        if count is not None:
            extent = extent._replace(**{flag: count})
    return extent


def _measure(study: Study, extent: Extent, console: Console) -> list[Row]:
    rows: list[Row] = []
    with ProgressBar(console, "timing", steps(extent)) as bar:

        def advance() -> None:
            bar.update(advance=1)

        costs = list(study.costs(extent.timed, advance))
        console.print(cost_table(costs))
        rows += costs
        for name, distances, streak in (("placements", STILL, 0.0), ("moving", MOVING, STREAK)):
            bar.update(description=name)
            found = [study.accuracy(distance, streak, extent.placements, advance) for distance in distances]
            console.print(accuracy_table([row for at in found for row in at]))
            rows += [row for at in found for row in at]
        if extent.clutter + extent.crowded:
            bar.update(description="wrong ids")
            misread = list(study.misreadings(extent, advance))
            console.print(misreading_table(misread))
            rows += misread
    return rows


def _write(folder: Path, rows: list[Row]) -> list[Path]:
    from .corner_figure import write_figure

    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / "frontend.csv", folder / "frontend.png"
    write_whole(table, as_csv(rows))
    write_figure(picture, [row for row in rows if isinstance(row, Accuracy)])
    return [table, picture]
