"""`bench speed --frontend`: cost, accuracy and consistency of the front ends for markers, laser scans and depth."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from ...core.errors import InputError
from ...core.files import csv_text, write_whole
from ..words.console import ProgressBar
from . import depth, laser
from .cameras import DISTANCES, CameraAccuracy, CameraStudy
from .corner_tables import CORNER_COLUMNS, Row, accuracy_table, camera_table, cost_table, misreading_table, record
from .corners import FULL, MOVING, QUICK, STILL, STREAK, Accuracy, CornerExtent, Study, steps
from .depth_tables import DEPTH_COLUMNS, depth_record, frame_table, loop_table, pair_table
from .laser_tables import LASER_COLUMNS, LaserRow, laser_record, scan_table, search_table
from .tables import consistency_table

OPTIONS = ("placements", "clutter", "crowded", "only", "scans", "frames")  # the study's own options

MARKERS, CAMERAS, LASER, DEPTH = PARTS = ("markers", "cameras", "laser", "depth")

COLUMNS = (*CORNER_COLUMNS, *LASER_COLUMNS, *DEPTH_COLUMNS)

Records = Sequence[dict[str, str | int | float]]


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    add = group.add_argument
    add("--placements", type=int, metavar="N", help=f"markers looked at for each distance ({FULL.placements})")
    add(
        "--clutter", type=int, metavar="N", help=f"frames without a marker, full of what resembles one ({FULL.clutter})"
    )
    add("--crowded", type=int, metavar="N", help=f"frames with six markers, looked through ({FULL.crowded})")
    add(
        "--only",
        choices=PARTS,
        help="one part: markers by an ideal camera, by real cameras, or the front end for laser scans or depth cameras",
    )
    add(
        "--scans",
        type=Path,
        metavar="FILE",
        help=f"also time the laser front end on this log in CARMEN's format ({laser.NAMED} if it was fetched)",
    )
    add(
        "--frames",
        type=Path,
        metavar="PATH",
        help="also time the front end for depth cameras on this recording, a folder or a bag",
    )


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    extent, seed, quick = _extent(namespace), namespace.seed, namespace.quick
    wanted = PARTS if namespace.only is None else (namespace.only,)
    _check(namespace, "scans", LASER, "a log of laser scans")
    _check(namespace, "frames", DEPTH, "a recording of a depth camera")
    corners: list[Row] = _measure(Study(seed), extent, console) if MARKERS in wanted else []
    if CAMERAS in wanted:
        corners += _measure_cameras(CameraStudy(seed), extent, console)
    rows = [record(row) for row in corners]
    if LASER in wanted:
        scans = laser.LaserStudy(seed, laser.QUICK if quick else laser.FULL, namespace.scans)
        rows += [laser_record(row) for row in _measure_laser(scans, console)]
    if DEPTH in wanted:
        frames = depth.DepthStudy(seed, depth.QUICK if quick else depth.FULL, namespace.frames)
        rows += [depth_record(row) for row in _measure_depth(frames, console)]
    written: list[Path] = []
    if namespace.csv is not None:
        write_whole(namespace.csv, as_csv(rows))
        written.append(namespace.csv)
    if namespace.out is not None:
        written += _write(namespace.out, rows, corners)
    return written


def _check(namespace: argparse.Namespace, option: str, front_end: str, kind: str) -> None:
    """Raises InputError for a file that is not there, or that another front end than --only would read."""
    path: Path | None = getattr(namespace, option)
    if path is None:
        return
    if namespace.only not in (None, front_end):
        raise InputError(f"--{option} {path}: found --only {namespace.only}, expected no {kind.partition(' ')[2]}")
    if not (path.exists() if front_end == DEPTH else path.is_file()):
        raise InputError(f"--{option} {path}: found no such file, expected {kind}")


def _extent(namespace: argparse.Namespace) -> CornerExtent:
    extent = QUICK if namespace.quick else FULL
    for flag, least in (("placements", 2), ("clutter", 0), ("crowded", 0)):
        count = getattr(namespace, flag)
        if count is not None and count < least:
            raise InputError(f"--{flag} {count}: expected {least} or more")
        if count is not None:
            extent = extent._replace(**{flag: count})
    return extent


def _measure(study: Study, extent: CornerExtent, console: Console) -> list[Row]:
    rows: list[Row] = []
    with ProgressBar(console, "timing", steps(extent)) as bar:
        costs = list(study.costs(extent.timed, bar.advance))
        console.print(cost_table(costs))
        rows += costs
        for name, distances, streak in (("placements", STILL, 0.0), ("moving", MOVING, STREAK)):
            bar.update(description=name)
            found = [study.accuracy(distance, streak, extent.placements, bar.advance) for distance in distances]
            console.print(accuracy_table([row for at in found for row in at]))
            rows += [row for at in found for row in at]
        if extent.clutter + extent.crowded:
            bar.update(description="wrong ids")
            misread = list(study.misreadings(extent, bar.advance))
            console.print(misreading_table(misread))
            rows += misread
    return rows


def _measure_cameras(study: CameraStudy, extent: CornerExtent, console: Console) -> list[CameraAccuracy]:
    rows: list[CameraAccuracy] = []
    with ProgressBar(console, "cameras", study.steps * extent.placements) as bar:
        for distance in DISTANCES:
            found = study.accuracy(distance, extent.placements, bar.advance)
            console.print(camera_table(found))
            rows += found
    return rows


def _measure_laser(study: laser.LaserStudy, console: Console) -> list[LaserRow]:
    with ProgressBar(console, "laser scans") as bar:
        study.warm_up()
        recorded = study.recorded(bar.advance)
        drives = study.drives(bar.advance)
        costs = [laser.scan_cost(drives, bar.advance)]
        if recorded is not None:
            costs.append(laser.scan_cost([recorded], bar.advance))
        console.print(scan_table(costs))
        bar.update(description="searches")
        search = study.searches(drives, bar.advance)
        console.print(search_table(search))
        errors = laser.consistency(drives)
        console.print(consistency_table("Errors of the laser front end on made-up floors", errors))
    return [*costs, search, *errors]


def _measure_depth(study: depth.DepthStudy, console: Console) -> list[depth.DepthRow]:
    with ProgressBar(console, "depth frames") as bar:
        study.warm_up()
        recorded = study.recorded(bar.advance)
        drives = study.drives(bar.advance)
    logs = [drives] if recorded is None else [drives, [recorded]]
    frames = [depth.frame_cost(log) for log in logs]
    pairs = [row for log in logs for row in depth.pair_costs(log)]
    loops = [depth.loop_cost(log) for log in logs]
    errors = depth.consistency(drives)
    for table in (frame_table(frames), pair_table(pairs), loop_table(loops)):
        console.print(table)
    console.print(consistency_table("Errors of registered frames in rendered rooms", errors))
    return [*frames, *pairs, *loops, *errors]


def as_csv(rows: Records) -> str:
    """Writes one line per row, in COLUMNS; blank where a study has no such figure."""
    return csv_text(COLUMNS, ([row.get(name) for name in COLUMNS] for row in rows))


def _write(folder: Path, rows: Records, corners: Sequence[Row]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    table, picture, cameras = (folder / name for name in ("frontend.csv", "frontend.png", "cameras.png"))
    write_whole(table, as_csv(rows))
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
