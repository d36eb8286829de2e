"""`bench render DATASET --as FORMATS --out FOLDER`: writes a rendered drive as recordings, with its truth."""

import argparse
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from rich.console import Console

from ...core.errors import InputError
from ...datasets.cache import generator
from ...datasets.on_demand.imu import Body, Drive
from ...frontend.inertial.imu import Imu
from ..plan.spec import dataset_variants
from ..plan.values import seed
from ..plan.variant import DatasetVariant
from ..words.console import ProgressBar

if TYPE_CHECKING:
    from ...datasets.recordings.write import Located

MARKERS, DEPTH = RENDERED = ("aruco-room", "depth-room")

ORIGIN = np.array([48.0, 11.5])  # degrees, of the middle of the room: x is east, y north

Frame = TypeVar("Frame")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add(
        "dataset",
        nargs="?",
        default=MARKERS,
        help="the drive, options in brackets as in bench run (default: %(default)s)",
    )
    add("--seed", type=seed, default=0, help="which drive, as bench run numbers them (default: %(default)s)")
    add(
        "--as", dest="formats", default="frames", metavar="FORMATS",
        help="frames, ros1, ros2, mcap; of aruco-room video (lossless) and mp4, of depth-room tum (TUM's layout); "
        "separated by commas (default: %(default)s)",
    )  # fmt: skip
    add("--out", type=Path, required=True, help="a new folder; of several formats, each gets its own inside")
    add("--quiet", action="store_true", help="no progress, and nothing printed")


def main(namespace: argparse.Namespace) -> int:
    """Renders the drive once and writes it in every format; 0."""
    variant = _variant(namespace.dataset)
    known = _formats(variant.name)
    formats = [name.strip() for name in namespace.formats.split(",")]
    for name in formats:
        if name not in known:
            raise InputError(f"--as: found {name!r}, expected one of {', '.join(known)} for {variant.name}.")
    if len(set(formats)) < len(formats):
        raise InputError(f"--as {namespace.formats}: a format is named twice, expected once.")
    out: Path = namespace.out
    places = {out: formats[0]} if len(formats) == 1 else {out / name: name for name in formats}
    console = Console(emoji=False, highlight=False, soft_wrap=True, quiet=namespace.quiet)
    (_depth if variant.name == DEPTH else _markers)(variant, namespace.seed, places, console)
    for folder, name in places.items():
        console.print(f"{known[name]}: {folder}", markup=False)
    return 0


def _formats(name: str) -> Mapping[str, str]:
    """The formats of a dataset's recordings, with what they are."""
    if name == DEPTH:
        from ...datasets.recordings.write_depth import FORMATS
    else:
        from ...datasets.recordings.write import FORMATS
    return FORMATS


def _markers(variant: DatasetVariant, number: int, places: Mapping[Path, str], console: Console) -> None:
    """Writes the frames of a camera among markers, with all other sensors of its robot."""
    if variant.options.outliers > 0:
        raise InputError(f"bench render: found {variant.label}: outliers are added to a log, not to frames.")

    from ...datasets.recordings.write import write
    from ...datasets.worlds.aruco_room import matching, recorded

    made = recorded(variant.options, generator(variant.name, number))
    recording, end = made.recording, (variant.options.frames - 1) / variant.options.frame_rate
    inertial, world = _located(variant, number, made.drive, end, made.imu, made.body)
    with ProgressBar(console, "rendering", variant.options.frames * len(recording.detectors)) as bar:
        recording = replace(recording, frames=_watched(recording.frames, bar))
        write(places, recording, made.truth, inertial, made.scans, matching(variant.options), world, made.depth)


def _depth(variant: DatasetVariant, number: int, places: Mapping[Path, str], console: Console) -> None:
    """Writes the frames of a depth camera, with all other sensors of its robot."""
    from ...datasets.recordings.write_depth import write_depth
    from ...datasets.worlds.depth_room import record, shots_of

    recording, truth = record(variant.options, generator(variant.name, number))
    shots, end = shots_of(recording), float(truth.t[-1])
    drive, felt = _inertial(variant.options, number, end, shots.rocking)
    felt, world = _located(variant, number, drive, end, felt, shots.rocking)
    with ProgressBar(console, "rendering", len(truth.t)) as bar:
        recording = replace(recording, frames=_watched(recording.frames, bar))
        write_depth(places, recording, truth, shots.poses, felt, world)


def _inertial(options: Any, number: int, end: float, body: Body | None) -> tuple[Drive, Imu | None]:
    """The drive, and the readings of an IMU up to `end`, s, on a `body` that rocks or is level; None without one."""
    from ...datasets.on_demand.imu import imu_of
    from ...datasets.worlds.aruco_room import GYRO
    from ...datasets.worlds.rendered_world import LOOP
    from ...datasets.worlds.wheeled_robot import drive

    along = partial(drive, LOOP, options.speed)
    felt = body is not None or options.compass
    given = replace(options, gyro=GYRO) if felt and not options.gyro else options
    return along, imu_of(given, along, end, generator(f"imu of {DEPTH}", number), body)


def _located(
    variant: DatasetVariant, number: int, drive: Drive, end: float, imu: Imu | None, body: Body | None
) -> tuple[Imu | None, "Located | None"]:
    """The IMU with a compass, and positions by GPS up to `end`, s, by the options; x is east, y north."""
    from ...datasets.fixes.geodetic import degrees
    from ...datasets.fixes.robot import GpsTable, WorldTables
    from ...datasets.on_demand.receivers import every, positions_of, with_magnetometer
    from ...datasets.recordings.write import Located
    from ...datasets.recordings.write_bag import Positions
    from ...frontend.world.compass import Compass

    options, name = variant.options, f"fixes of {variant.name}"
    t, xy = positions_of(options, drive, end, generator(name, number))
    gps = compass = positions = None
    if len(t):
        positions = Positions(t, degrees(xy, ORIGIN), np.full(len(t), options.gps_sd))
        gps = GpsTable(origin=ORIGIN, antenna=np.array([options.gps_x, options.gps_y]))
    if imu is not None and options.compass:
        imu = with_magnetometer(imu, options, drive, generator(name, number), body)
        if imu.mag is not None:
            compass = Compass(sd=options.compass_sd, offset_sd=options.compass_offset, every=every(options))
    if gps is None and compass is None:
        return imu, None
    return imu, Located(positions, WorldTables(gps, compass))


def _watched(frames: Iterable[Frame], bar: ProgressBar) -> Iterator[Frame]:
    """The frames, each with a step of the progress bar."""
    for frame in frames:
        yield frame
        bar.advance()


def _variant(text: str) -> DatasetVariant:
    variants = dataset_variants(text, "bench render")
    if len(variants) != 1 or variants[0].name not in RENDERED:
        expected = " or ".join(RENDERED)
        raise InputError(f"bench render: found {text!r}, expected {expected}, whose frames are rendered.")
    return variants[0]
