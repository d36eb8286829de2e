"""`bench render DATASET --as FORMATS --out FOLDER`: writes a rendered drive as recordings, with its truth."""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from ...datasets.cache import generator
from ...frontend.errors import InputError
from ..plan.spec import DatasetVariant, dataset_variants
from ..plan.values import seed
from ..words.console import ProgressBar

RENDERED = "aruco-room"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add(
        "dataset",
        nargs="?",
        default=RENDERED,
        help="the drive, options in brackets as in bench run (default: %(default)s)",
    )
    add("--seed", type=seed, default=0, help="which drive, as bench run numbers them (default: %(default)s)")
    add(
        "--as", dest="formats", default="frames", metavar="FORMATS",
        help="frames, video (lossless), mp4, ros1, ros2, mcap, separated by commas (default: %(default)s)",
    )  # fmt: skip
    add("--out", type=Path, required=True, help="a new folder; of several formats, each gets its own inside")
    add("--quiet", action="store_true", help="no progress, and nothing printed")


def main(namespace: argparse.Namespace) -> int:
    """Renders the drive once and writes it in every format; 0."""
    variant = _variant(namespace.dataset)
    if variant.options.outliers > 0:
        raise InputError(f"bench render: found {variant.label}: outliers are added to a log, not to frames.")

    from ...datasets.recordings.write import FORMATS, write
    from ...datasets.worlds.aruco_room import record

    formats = [name.strip() for name in namespace.formats.split(",")]
    for name in formats:
        if name not in FORMATS:
            raise InputError(f"--as: found {name!r}, expected one of {', '.join(FORMATS)}.")
    if len(set(formats)) < len(formats):
        raise InputError(f"--as {namespace.formats}: a format is named twice, expected once.")
    out: Path = namespace.out
    places = {out: formats[0]} if len(formats) == 1 else {out / name: name for name in formats}
    console = Console(emoji=False, highlight=False, soft_wrap=True, quiet=namespace.quiet)
    recording, truth = record(variant.options, generator(variant.name, namespace.seed))
    with ProgressBar(console, "rendering", len(truth.t)) as bar:

        def frames() -> Iterator[Any]:
            for frame in recording.frames:
                yield frame
                bar.update(advance=1)

        write(places, replace(recording, frames=frames()), truth)
    for folder, name in places.items():
        console.print(f"{FORMATS[name]}: {folder}", markup=False)
    return 0


def _variant(text: str) -> DatasetVariant:
    variants = dataset_variants(text, "bench render")
    if len(variants) != 1 or variants[0].name != RENDERED:
        raise InputError(f"bench render: found {text!r}, expected {RENDERED}, the dataset whose frames are rendered.")
    return variants[0]
