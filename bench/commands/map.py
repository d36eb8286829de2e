"""`bench map FOLDER`: writes maps of every log of a laser scanner or depth camera in a run, by each path."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console

from ...core.beside import Clouds, Scans
from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.maps.cloud import merged
from ...frontend.maps.obstacles import HIGH, LOW, Obstacles
from ...frontend.maps.occupancy import CELL, MOST, Occupancy, occupancy
from ...frontend.maps.top_view import top_view
from ..drawing.map_files import write_grid, write_seen
from ..record.schema import Row, label
from ..record.store import Store

SMALLEST, LARGEST, TALLEST = 0.01, 1.0, 100.0  # m

POINTS = 0.05  # m; edge of the cubes that have one point each in a cloud

FILES = {
    "scans": "grid.png; grid.pgm and grid.yaml, a map for ROS; grid.npz, for --map",
    "clouds": "top.png, from above; grid.pgm and grid.yaml, a map for ROS; points.ply, the points",
}


class Written(NamedTuple):
    """A grid that was written."""

    row: Row
    which: str  # of the backend's paths
    place: Path
    kind: str  # of FILES
    grid: Occupancy
    more: str  # that is said of it


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("folder", type=Path, help="the folder that bench run left")
    add(
        "--cell", type=_metres, default=CELL, metavar="M",
        help=f"size of a cell, m (default: {CELL:g}); larger where a grid would have more than {MOST:,} on a side",
    )  # fmt: skip
    add(
        "--heights", type=_heights, default=(LOW, HIGH), metavar="LOW,HIGH",
        help="of a depth camera's log: heights above the floor, m, between which a point is an obstacle, and above "
        f"which nothing is drawn (default: {LOW:g},{HIGH:g})",
    )  # fmt: skip
    add(
        "--points", type=_metres, default=POINTS, metavar="M",
        help=f"of a depth camera's log: one point in every cube of this edge, m (default: {POINTS:g})",
    )  # fmt: skip
    add("--online", action="store_true", help="by online paths; otherwise by final ones where there are any")
    add("--out", type=Path, metavar="FOLDER", help="where to write (default: beside the cells' files, in the run)")
    add("--quiet", action="store_true", help="print nothing but errors")


def _metres(text: str) -> float:
    value = _number(text)
    if not SMALLEST <= value <= LARGEST:
        raise argparse.ArgumentTypeError(f"found {text!r}, expected {SMALLEST:g} to {LARGEST:g} m")
    return value


def _heights(text: str) -> tuple[float, float]:
    values = [_number(one) for one in text.split(",")]
    if len(values) != 2 or not 0 < values[0] < values[1] <= TALLEST:
        raise argparse.ArgumentTypeError(
            f"found {text!r}, expected two heights above 0 and up to {TALLEST:g} m, the lower one first, as "
            f"{LOW:g},{HIGH:g}"
        )
    return values[0], values[1]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def main(namespace: argparse.Namespace) -> int:
    """Writes them; 0."""
    console = Console(emoji=False, highlight=False, markup=False, soft_wrap=True, quiet=namespace.quiet)
    with Store(namespace.folder) as store:
        kinds = list[str]()
        for row, which, place, kind, grid, more in written(store, namespace.out or namespace.folder, namespace):
            kinds += [kind] * (kind not in kinds)
            c, (n, m) = row.columns, grid.cells.shape[:2]
            console.print(
                f"{place}: {label(c['dataset'], c['dataset_options'])}, {label(c['backend'], c['options'])}, the "
                f"{which} path; {n * grid.size:.1f} x {m * grid.size:.1f} m, {n} x {m} cells of {grid.size:g} m{more}"
            )
    if not kinds:
        raise InputError(
            f"{namespace.folder}: no cell with laser scans or clouds of a depth camera beside its log is done, "
            "expected a log of one of them."
        )
    for kind in kinds:
        console.print(f"each: {FILES[kind]}")
    return 0


def written(store: Store, out: Path, how: argparse.Namespace) -> Iterator[Written]:
    """Writes the maps of every cell that is done and has scans or clouds and such a path."""
    folders = store.run()["folders"]
    for row in store.cells():
        c = row.columns
        if c["status"] != "done":
            continue
        beside = store.scans(row) or store.clouds(row)
        if beside is None:
            continue
        arrays = store.arrays(row, ("online", "final"))
        names = ("online",) if how.online else ("final", "online")
        which = next((name for name in names if name in arrays), None)
        if which is None or not np.isfinite(arrays[which]).all():
            continue
        dataset, backend = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        place = out / folders[dataset] / str(c["seed"]) / folders[backend]
        try:
            drawn = _draw(beside, arrays[which], place, how)
        except OSError as error:
            raise InputError(f"{place}: cannot be written: {error.strerror}.") from None
        yield Written(row, which, place, *drawn)


def _draw(beside: Scans | Clouds, path: Array, place: Path, how: argparse.Namespace) -> tuple[str, Occupancy, str]:
    """Writes the maps along a path (n, 3) to `place`; returns their kind, the grid, and what is said of it."""
    if isinstance(beside, Scans):
        grid = occupancy(beside, path, how.cell)
        write_grid(place, grid)
        return "scans", grid, ""
    low, high = how.heights
    grid, points = occupancy(Obstacles(beside, low, high), path, how.cell), merged(beside, path, how.points)
    write_seen(place, grid, top_view(beside, path, how.cell, high=high), points)
    return "clouds", grid, f", obstacles from {low:g} to {high:g} m; {len(points.points):,} points"
