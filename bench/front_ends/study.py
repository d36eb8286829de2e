"""`bench speed --frontend`: cost, accuracy and consistency of marker detection and of laser scan matching."""

import argparse
import csv
import io
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from ...frontend.errors import InputError
from ...frontend.files import write_whole
from ..words.console import ProgressBar
from . import laser
from .cameras import DISTANCES, CameraAccuracy, CameraStudy
from .corner_tables import CORNER_COLUMNS, Row, accuracy_table, camera_table, cost_table, misreading_table, record
from .corners import FULL, MOVING, QUICK, STILL, STREAK, Accuracy, Extent, Study, steps
from .laser_tables import LASER_COLUMNS, LaserRow, honesty_table, laser_record, scan_table, search_table

OPTIONS = ("placements", "clutter", "crowded", "only", "scans")  # the study's own options

PARTS = ("markers", "cameras", "laser")

COLUMNS = (*CORNER_COLUMNS, *LASER_COLUMNS)


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    add = group.add_argument
    add("--placements", type=int, metavar="N", help=f"markers looked at for each distance ({FULL.placements})")
    add(
        "--clutter", type=int, metavar="N", help=f"frames without a marker, full of what resembles one ({FULL.clutter})"
    )
    add("--crowded", type=int, metavar="N", help=f"frames with six markers, looked through ({FULL.crowded})")
    add("--only", choices=PARTS, help="one part: markers by an ideal camera, by real cameras, or the laser front end")
    add(
        "--scans",
        type=Path,
        metavar="FILE",
        help=f"also time the laser front end on this log in CARMEN's format ({laser.NAMED} if it was fetched)",
    )


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    extent = _extent(namespace)
    parts = PARTS if namespace.only is None else (namespace.only,)
    if namespace.scans is not None and ("laser" not in parts or not namespace.scans.is_file()):
        found = "no such file, expected a log" if "laser" in parts else f"--only {parts[0]}, expected no log"
        raise InputError(f"--scans {namespace.scans}: found {found} of laser scans")
    corners: list[Row] = _measure(Study(namespace.seed), extent, console) if "markers" in parts else []
    if "cameras" in parts:
        corners += _measure_cameras(CameraStudy(namespace.seed), extent, console)
    lasers: list[LaserRow] = []
    if "laser" in parts:
        scans = laser.QUICK if namespace.quick else laser.FULL
        lasers = _measure_laser(laser.LaserStudy(namespace.seed, scans, namespace.scans), console)
    written: list[Path] = []
    if namespace.csv is not None:
        write_whole(namespace.csv, as_csv(corners, lasers))
        written.append(namespace.csv)
    if namespace.out is not None:
        written += _write(namespace.out, corners, lasers)
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


def _measure_cameras(study: CameraStudy, extent: Extent, console: Console) -> list[CameraAccuracy]:
    rows: list[CameraAccuracy] = []
    with ProgressBar(console, "cameras", study.steps * extent.placements) as bar:

        def advance() -> None:
            bar.update(advance=1)

        for distance in DISTANCES:
            found = study.accuracy(distance, extent.placements, advance)
            console.print(camera_table(found))
            rows += found
    return rows


def _measure_laser(study: laser.LaserStudy, console: Console) -> list[LaserRow]:
    with ProgressBar(console, "laser scans") as bar:

        def advance() -> None:
            bar.update(advance=1)

        study.warm_up()
        recorded = study.recorded(advance)
        drives = study.drives(advance)
        costs = [laser.scan_cost(drives, advance)]
        if recorded is not None:
            costs.append(laser.scan_cost([recorded], advance))
        console.print(scan_table(costs))
        bar.update(description="searches")
        search = study.searches(drives, advance)
        console.print(search_table(search))
        errors = laser.honesty(drives)
        console.print(honesty_table(errors))
    return [*costs, search, *errors]


def as_csv(corners: Sequence[Row], lasers: Sequence[LaserRow]) -> str:
    """Writes one line per row, in COLUMNS; blank where a study has no such figure."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(map(record, corners))
    writer.writerows(map(laser_record, lasers))
    return text.getvalue()


def _write(folder: Path, corners: Sequence[Row], lasers: Sequence[LaserRow]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    table, picture, cameras = (folder / name for name in ("frontend.csv", "frontend.png", "cameras.png"))
    write_whole(table, as_csv(corners, lasers))
    written = [table]
    if ideal := [row for row in corners if isinstance(row, Accuracy)]:
        from .corner_figure import write_figure

        write_figure(picture, ideal)
        written.append(picture)
    if real := [row for row in corners if isinstance(row, CameraAccuracy)]:
        from .camera_figure import write_camera_figure

        write_camera_figure(cameras, real)
        written.append(cameras)
    return written
