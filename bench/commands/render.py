"""`bench render DATASET --as FORMATS --out FOLDER`: writes a rendered drive as recordings, with its truth."""

import argparse
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from ...core.errors import InputError
from ...datasets.cache import generator
from ...datasets.on_demand.imu import Body
from ...frontend.inertial.imu import Imu
from ..plan.spec import dataset_variants
from ..plan.values import seed
from ..plan.variant import DatasetVariant
from ..words.console import ProgressBar

MARKERS, DEPTH = RENDERED = ("aruco-room", "depth-room")

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
    """Writes the frames of a camera among markers."""
    if variant.options.outliers > 0:
        raise InputError(f"bench render: found {variant.label}: outliers are added to a log, not to frames.")

    from ...datasets.recordings.write import write
    from ...datasets.worlds.aruco_room import matching, recorded

    recording, truth, scans, inertial = recorded(variant.options, generator(variant.name, number))
    with ProgressBar(console, "rendering", variant.options.frames * len(recording.detectors)) as bar:
        recording = replace(recording, frames=_watched(recording.frames, bar))
        write(places, recording, truth, inertial, scans, matching(variant.options))


def _depth(variant: DatasetVariant, number: int, places: Mapping[Path, str], console: Console) -> None:
    """Writes the frames of a depth camera."""
    from ...datasets.recordings.write_depth import write_depth
    from ...datasets.worlds.depth_room import record, shots_of

    recording, truth = record(variant.options, generator(variant.name, number))
    cameras = shots_of(recording).poses
    inertial = _inertial(variant, number, float(truth.t[-1]), shots_of(recording).rocking)
    with ProgressBar(console, "rendering", len(truth.t)) as bar:
        write_depth(places, replace(recording, frames=_watched(recording.frames, bar)), truth, cameras, inertial)


def _inertial(variant: DatasetVariant, number: int, end: float, body: Body | None) -> Imu | None:
    """The readings of an IMU up to `end`, s, on a `body` that rocks or is level; None without options gyro and imu."""
    from ...datasets.on_demand.imu import imu_of
    from ...datasets.worlds.aruco_room import GYRO
    from ...datasets.worlds.rendered_world import LOOP
    from ...datasets.worlds.wheeled_robot import drive

    along = partial(drive, LOOP, variant.options.speed)
    options = variant.options if variant.options.gyro or body is None else replace(variant.options, gyro=GYRO)
    return imu_of(options, along, end, generator(f"imu of {variant.name}", number), body)


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
