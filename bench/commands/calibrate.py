"""`bench calibrate FRAMES --board charuco[...]`: calibrates a camera from views of a ChArUco board or chessboard."""

import argparse
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ...core.errors import InputError
from ...datasets.recordings import frames_folder, video
from ...frontend.boards.board import Board, read_board
from ...frontend.boards.charuco import FEWEST_VIEWS, MODELS, Calibration, calibrate
from ...frontend.boards.chessboard import Chessboard
from ...frontend.boards.other_board import MOST, other_board
from ...frontend.boards.response_fit import BoardResponse, Pictures
from ...frontend.boards.view import View
from ...frontend.camera.calibration import write_camera_info, write_opencv
from ...frontend.markers.aruco import Image
from ..camera.calibration_picture import write_picture
from ..camera.response_words import told
from ..drawing.picture import KINDS
from ..plan.values import check_file
from ..words.console import ProgressBar, plain, screen_console, tell
from ..words.numerals import counted, listed

CALIBRATIONS = (".yaml", ".yml", ".xml", ".json")  # endings of a calibration file's name
MOST_FRAMES = 60  # frames taken from a video, evenly: more of them cost time and add little
STRIDE = 10  # every so many-th frame of a video of unknown length is taken
NAMED = 3  # images that are named where a reason applies to several


class Source(NamedTuple):
    """A source of images, read on demand."""

    length: int
    images: Iterable[tuple[str, Image | None]]  # with their names; None: cannot be read


class Views(NamedTuple):
    """The views found in the images."""

    used: list[View]
    numbers: list[int]  # of their images
    left_out: dict[str, list[str]]  # reason -> images
    size: tuple[int, int]  # px, width and height of all images


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = (
        "Take 15 to 30 sharp pictures in which the board is large and tilted every way by 20 to 45 degrees, near all "
        "edges of the image too. Measure the printed board's squares and markers: their sides are in m. Boards printed "
        "with OpenCV before 4.6 with an even number of rows need legacy=true. The columns and rows of a chessboard are "
        "its inner corners, as OpenCV counts them, one fewer than squares; all of it has to be in the picture."
    )
    add = parser.add_argument
    add("frames", nargs="+", type=Path, metavar="FRAMES", help="images, folders of them, or a video")
    add(
        "--board",
        required=True,
        metavar="BOARD",
        help="charuco[columns=5,rows=7,square=0.04,marker=0.02,dictionary=6X6_250], in squares and m, or "
        "chessboard[columns=8,rows=6,square=0.025], in inner corners and m",
    )
    add(
        "--model",
        choices=list(MODELS),
        default="5",
        help="the lens: that many coefficients, or fisheye (default 5; 8 for wide lenses)",
    )
    add("--out", type=Path, default=Path("calibration.yaml"), metavar="FILE", help="default calibration.yaml")
    add("--camera-info", type=Path, metavar="FILE", help="also write ROS's camera_info YAML")
    add("--picture", type=Path, metavar="FILE", help="also draw coverage and errors (.png .svg .pdf)")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Calibrates; 0 where the calibration was written."""
    board = read_board(namespace.board)
    check_file("--out", namespace.out, CALIBRATIONS)
    check_file("--camera-info", namespace.camera_info, (".yaml", ".yml"))
    check_file("--picture", namespace.picture, KINDS)
    console = screen_console(quiet=namespace.quiet)
    views = _views(namespace.frames, board, console)
    reasons = _reasons(views.left_out)
    try:
        found = calibrate(views.used, views.size, namespace.model)
    except InputError as error:
        other = None if len(views.used) >= FEWEST_VIEWS else other_board(_unused(namespace.frames, views), board)
        if other is not None:
            raise InputError(f"calibration: {other}, expected {namespace.board.strip()}") from None
        raise InputError(". ".join([str(error), *reasons])) from None
    seen = _response(namespace.frames, board, found, views.numbers, console)
    if isinstance(seen, BoardResponse):
        found = replace(found, camera=replace(found.camera, response=seen.response))
    if namespace.picture is not None:
        write_picture(namespace.picture, found)
    if namespace.camera_info is not None:
        write_camera_info(namespace.camera_info, found.camera)
    write_opencv(namespace.out, found.camera)  # last, so that where it is new all the others are
    _report(console, found, [*told(seen), *reasons])
    for path in (namespace.out, namespace.camera_info, namespace.picture):
        if path is not None:
            tell(console, f"wrote: {path}")
    return 0


def _unused(places: list[Path], views: Views) -> list[Image]:
    """Up to a few images, spread over all, in which the board was not found; they are read again."""
    left = np.setdiff1d(np.arange(_all(places).length), views.numbers)
    chosen = set(left[np.linspace(0, len(left) - 1, min(MOST, len(left))).astype(int)].tolist()) if len(left) else set()
    images = enumerate(_all(places).images)
    return [image for number, (_, image) in images if number in chosen and image is not None]


def _views(places: list[Path], board: Board | Chessboard, console: Console) -> Views:
    """Finds the board in all images; InputError for different sizes, or where none can be read."""
    used: list[View] = []
    numbers: list[int] = []
    left_out = defaultdict[str, list[str]](list)
    first: tuple[str, tuple[int, int]] | None = None
    source = _all(places)
    with ProgressBar(console, "looking for the board", source.length) as bar:
        for number, (name, image) in enumerate(source.images):
            bar.advance()
            if image is None:
                left_out["cannot be read as an image"].append(name)
                continue
            height, width = image.shape[:2]
            first = first or (name, (width, height))
            if (width, height) != first[1]:
                before = f"{first[0]}'s {first[1][0]}x{first[1][1]}"
                raise InputError(f"{name}: found {width}x{height} pixels, expected {before}: one camera's images alike")
            view = board.find(name, image)
            if isinstance(view, str):
                left_out[view].append(name)
            elif (twin := _twin(view, used)) is not None:
                left_out[f"the same picture as {twin}"].append(name)
            else:
                used.append(view)
                numbers.append(number)
    if first is None:
        names = listed([name for names in left_out.values() for name in names][:NAMED])
        raise InputError(f"{names}: cannot be read as an image, expected views of the board")
    return Views(used, numbers, dict(left_out), first[1])


def _response(
    places: list[Path], board: Board | Chessboard, found: Calibration, numbers: list[int], console: Console
) -> BoardResponse | str:
    """Reads the images with the `numbers` of the fitted views again; the response, or why it cannot be told."""
    if isinstance(board, Chessboard):
        return "a chessboard has no markers, of which it is told"
    source, fits = _all(places), dict(zip(numbers, found.fits, strict=True))
    pictures = Pictures(board, found.camera)
    with ProgressBar(console, "measuring the camera's response", source.length) as bar:
        for number, (_, image) in enumerate(source.images):
            bar.advance()
            if image is not None and number in fits and not fits[number].bad:
                pictures.add(fits[number], image)
    return pictures.result()


def _all(places: list[Path]) -> Source:
    """The images of all `places`, in their order."""
    sources = [_source(place) for place in places]
    return Source(sum(source.length for source in sources), chain.from_iterable(one.images for one in sources))


def _source(place: Path) -> Source:
    """The images at `place`; InputError where there are none."""
    if not place.exists():
        raise InputError(f"{place}: is not there, expected an image, a folder of images or a video")
    if place.is_dir():
        paths = frames_folder.pictures(place)
        if not paths:
            raise InputError(f"{place}: has no images, expected views of the board")
    elif place.suffix.lower() in frames_folder.PICTURES:
        paths = [place]
    else:
        frames = video.read(place, place.parent, 1.0, 0.0)  # when they were taken does not matter
        stride = STRIDE if frames.length is None else -(-frames.length // MOST_FRAMES)
        numbered = islice(enumerate(frames), 0, None, stride)
        images = ((f"{place.name} frame {number}", frame.image) for number, frame in numbered)
        return Source(-(-(frames.length or 0) // stride), images)
    return Source(len(paths), ((path.name, frames_folder.load(path)) for path in paths))


def _twin(view: View, others: list[View]) -> str | None:
    """Finds the one of `others` with exactly the same corners: a copy adds confidence and no information."""
    same = (o.name for o in others if np.array_equal(o.ids, view.ids) and np.array_equal(o.corners, view.corners))
    return next(same, None)


def _reasons(left_out: dict[str, list[str]]) -> list[str]:
    return [f"Left out {listed(names, NAMED)}: {reason}" for reason, names in left_out.items()]


def _report(console: Console, found: Calibration, reasons: list[str]) -> None:
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("view", overflow="fold")
    for heading in ("corners", "error, px"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("")
    for fit in found.fits:
        remark = "[red]far from the others[/]" if fit.bad else ""
        table.add_row(plain(fit.view.name), str(len(fit.view.ids)), f"{fit.error:.2f}", remark)
    console.print(table)
    (fx, fy), (cx, cy) = found.camera.focal, found.camera.centre
    sx, sy, su, sv = found.sd[:4]
    share, covered = 100 * max(sx / fx, sy / fy), 100 * found.coverage
    lines = (
        f"focal length {fx:.1f} ± {sx:.1f} px across, {fy:.1f} ± {sy:.1f} px down (standard deviation, {share:.2g} %)",
        f"centre {cx:.1f} ± {su:.1f} px across, {cy:.1f} ± {sv:.1f} px down",
        f"corners explained to {found.rms:.2f} px RMS in {counted(len(found.fits), 'view')}",
        f"corners seen in {covered:.0f} % of the image, the board turned by up to {found.turn:.0f} degrees",
    )
    tell(console, *lines, *reasons)
    for remark in found.remarks:
        console.print(f"[yellow]but[/] {plain(remark)}", highlight=False, soft_wrap=True)
