"""`bench map FOLDER`: writes the occupancy grid of every laser log in a run by each backend's path."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console

from ...frontend.errors import InputError
from ...frontend.laser.occupancy import CELL, MOST, Occupancy, occupancy
from ..drawing.grid_files import write_grid
from ..record.schema import Row, label
from ..record.store import Store

SMALLEST, LARGEST = 0.01, 1.0  # m


class Written(NamedTuple):
    """A grid that was written."""

    row: Row
    which: str  # of the backend's paths
    place: Path
    grid: Occupancy


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("folder", type=Path, help="the folder that bench run left")
    add(
        "--cell", type=_metres, default=CELL, metavar="M",
        help=f"size of a cell, m (default: {CELL:g}); larger where a grid would have more than {MOST:,} on a side",
    )  # fmt: skip
    add("--online", action="store_true", help="by online paths; otherwise by final ones where there are any")
    add("--out", type=Path, metavar="FOLDER", help="where to write (default: beside the cells' files, in the run)")
    add("--quiet", action="store_true", help="print nothing but errors")


def _metres(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not SMALLEST <= value <= LARGEST:
        raise argparse.ArgumentTypeError(f"found {text!r}, expected {SMALLEST:g} to {LARGEST:g} m")
    return value


def main(namespace: argparse.Namespace) -> int:
    """Writes them; 0."""
    console = Console(emoji=False, highlight=False, markup=False, soft_wrap=True, quiet=namespace.quiet)
    with Store(namespace.folder) as store:
        found = 0
        for row, which, place, grid in written(store, namespace.out or namespace.folder, namespace.cell, namespace):
            found += 1
            c, (n, m) = row.columns, grid.cells.shape[:2]
            console.print(
                f"{place}: {label(c['dataset'], c['dataset_options'])}, {label(c['backend'], c['options'])}, the "
                f"{which} path; {n * grid.size:.1f} x {m * grid.size:.1f} m, {n} x {m} cells of {grid.size:g} m"
            )
    if not found:
        raise InputError(f"{namespace.folder}: no cell with laser scans beside its log is done, expected a laser log.")
    console.print("each: grid.png; grid.pgm and grid.yaml, a map for ROS; grid.npz, for --map")
    return 0


def written(store: Store, out: Path, cell: float, how: argparse.Namespace) -> Iterator[Written]:
    """Writes the grid of every cell that is done and has scans and such a path."""
    folders = store.run()["folders"]
    for row in store.cells():
        c = row.columns
        scans = store.scans(row) if c["status"] == "done" else None
        if scans is None:
            continue
        arrays = store.arrays(row, ("online", "final"))
        names = ("online",) if how.online else ("final", "online")
        which = next((name for name in names if name in arrays), None)
        if which is None or not np.isfinite(arrays[which]).all():
            continue
        grid = occupancy(scans, arrays[which], cell)
        dataset, backend = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        place = out / folders[dataset] / str(c["seed"]) / folders[backend]
        try:
            write_grid(place, grid)
        except OSError as error:
            raise InputError(f"{place}: cannot be written: {error.strerror}.") from None
        yield Written(row, which, place, grid)
