"""`bench detect RECORDING --out LOG`: makes a recording of a camera, depth camera or scanner a log with a report."""

import argparse
import json
import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.table import Table

from ...core.errors import InputError
from ...datasets.depth.open import OpenedDepth, open_depth
from ...datasets.recordings.recording import Opened as Frames
from ...datasets.recordings.recording import finished, open_recording
from ...datasets.recordings.sensors import WHEELS, beside_them, chosen, sensors_in
from ...datasets.recordings.settings import read_described
from ...datasets.recordings.several import OpenedSeveral, open_several
from ...datasets.scans.open import OpenedScans, ScanTopics, open_scans
from ..detect import depth, laser, markers
from ..detect import several as both
from ..detect.findings import Findings
from ..detect.folder import Request, check_place
from ..detect.noise_calibration import RangeBin, toml
from ..detect.page import PAGE
from ..detect.preview import CODECS, Preview
from ..detect.tag_files import ENDINGS
from ..plan.values import check_file, positive
from ..words.console import ProgressBar, plain, screen_console
from ..words.numerals import number


class Opened(NamedTuple):
    """A recording that was opened."""

    detect: Callable[[Request, Callable[[int], None]], Findings]
    length: int | None  # number of frames or scans, if known
    of: str  # frames or scans
    found: str  # the noun of what is counted on the way


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = (
        "A recording is a folder with robot.toml and frames, a video, a bag or a CARMEN log; a bare bag, video or "
        "folder of frames needs --robot, laser scans and a depth camera's bag do not. camera:0 is a camera that is "
        "connected. LOG is what bench run --dataset LOG takes; a folder that an earlier bench detect wrote is "
        "replaced, any other that is not empty is left alone."
    )
    add = parser.add_argument
    add("recording", help="the recording's folder, video or bag, or camera:0")
    add("--out", type=Path, required=True, metavar="LOG", help="the folder the log goes to")
    add("--robot", type=Path, metavar="FILE", help="the robot.toml, if not the one beside the recording")
    add("--sensors", metavar="NAMES", help="of several: markers,laser,depth,wheels,gyro,compass,gps, or all (default)")
    add("--scan", metavar="TOPIC", help="the topic of the laser scans, in a bag with several")
    add("--odometry", metavar="TOPIC", help="the topic of their odometry, in a bag with several")
    add("--preview", type=Path, metavar="FILE", help="also write an annotated video (.mp4 .avi .mkv .webm)")
    add("--poses", type=Path, metavar="FILE", help="also write each marker's 6-DoF pose (.csv .jrl .pyfg .pfg)")
    add("--seconds", type=positive, metavar="N", help="stop after the first N seconds")
    add("--calibrate-noise", action="store_true", help="fit the noise models; the recording must have truth")
    add("--strict", action="store_true", help="refuse a log with a remark; none is written")
    add("--json", action="store_true", help="print the findings as JSON, and nothing else")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Detects; 0 where a log was written, even one without a sighting."""
    n, out = namespace, namespace.out
    check_place(out)
    check_file("--preview", n.preview, tuple(CODECS))
    check_file("--poses", n.poses, ENDINGS)
    opened = _opened(n)
    preview = None if n.preview is None else Preview(n.preview)
    console = screen_console(quiet=n.quiet or n.json)
    with ProgressBar(console, opened.of, opened.length) as bar:

        def advance(found: int) -> None:
            bar.update(advance=1, note=f"{found:,} {opened.found}")

        f = opened.detect(Request(n.recording, out, preview, n.seconds, n.calibrate_noise, n.strict, n.poses), advance)
    if n.json:
        print(json.dumps(f.as_json(str(out)), indent=2))
        return 0
    say = partial(console.print, highlight=False)
    for sentence in (*f.sentences(), f.refused(), *f.advice()):
        say(plain(sentence))
    for remark in f.remarks:
        say(plain(f"remark: {remark}."), soft_wrap=True)
    if isinstance(f, markers.MarkerFindings) and f.calibration is not None:
        say(_noise_table(f.calibration.bins))
        say(plain(toml(f.calibration).rstrip()))
    say(f"report: {plain(str(out / PAGE))}", soft_wrap=True)
    for path in f.poses if isinstance(f, markers.MarkerFindings) else ():
        say(f"poses:  {plain(str(path))}", soft_wrap=True)
    if len(f.log.ids) or f.log.scans is not None or f.log.clouds is not None:  # there is something to run backends on
        say(f"next:   bench run --dataset {plain(shlex.quote(str(out)))}", soft_wrap=True)
    return 0


def _opened(namespace: argparse.Namespace) -> Opened:
    """Opens the recording; InputError for options that those of its sensor do not have."""
    name, path = namespace.recording, Path(namespace.recording)
    topics = ScanTopics(namespace.scan, namespace.odometry)
    sensors = None if namespace.sensors is None else sensors_in(namespace.sensors, "--sensors")
    several = open_several(path, namespace.robot, topics, sensors, namespace.seconds)
    if isinstance(several, OpenedSeveral) and not several.markers:
        of_markers = ("--preview", namespace.preview), ("--poses", namespace.poses)
        for flag, given in (*of_markers, ("--calibrate-noise", namespace.calibrate_noise)):
            if given:
                raise InputError(f"{flag}: --sensors {namespace.sensors} is without markers, expected them as well.")
        return Opened(partial(both.detect_unmarked, several), several.frames.length, "depth frames", "")
    if isinstance(several, OpenedSeveral):
        _check_pictures(namespace, several.frames)
        return Opened(partial(both.detect, several), several.frames.length, "frames", "markers")
    scans = several if isinstance(several, OpenedScans) else None
    if several is None:
        scans = open_scans(path, namespace.robot, topics)
    if scans is not None:
        scans = chosen(scans, sensors)
        of_cameras = ("--preview", namespace.preview), ("--poses", namespace.poses)
        for flag, given in (*of_cameras, ("--calibrate-noise", namespace.calibrate_noise)):
            if given:
                raise InputError(f"{flag}: {name} has laser scans, expected a camera's recording.")
        return Opened(partial(laser.detect, scans), len(scans.recording.t), "scans", "loops")
    images = several if isinstance(several, OpenedDepth) else None
    if several is None:
        images = open_depth(path, namespace.robot)
    if images is not None:
        images = chosen(images, sensors)
        if namespace.calibrate_noise:
            raise InputError(
                f"--calibrate-noise: {name} is of a depth camera, which has no markers to fit; expected it without. "
                "depth_sd, floor and turn_floor under [depth] in robot.toml state the noise."
            )
        if namespace.poses is not None:
            raise InputError(f"--poses: {name} is of a depth camera, expected a recording of markers.")
        for flag, topic in (("--scan", namespace.scan), ("--odometry", namespace.odometry)):
            if topic is not None:
                raise InputError(
                    f"{flag}: {name} is of a depth camera, expected [topics] in robot.toml for its topics."
                )
        return Opened(partial(depth.detect, images), images.length, "frames", "steps")
    frames = several if isinstance(several, Frames) else None
    if frames is None:
        robot = None if namespace.robot is None else read_described(namespace.robot)
        wheels = WHEELS in beside_them(sensors)
        frames = chosen(open_recording(path, robot, namespace.seconds, wheels=wheels), sensors)
    _check_pictures(namespace, frames)
    return Opened(
        partial(
            markers.detect,
            frames.recording,
            frames.truth,
            start_given=frames.start_given,
            finish=partial(finished, frames),
        ),
        frames.length,
        "frames",
        "markers",
    )


def _check_pictures(namespace: argparse.Namespace, frames: Frames) -> None:
    """InputError for a film of a recording without images."""
    if namespace.preview is not None and not frames.pictures:
        raise InputError(
            f"--preview: {namespace.recording} has tags that were found before, and no images; expected it without."
        )


def _noise_table(bins: list[RangeBin]) -> Table:
    title = "Errors by range, and NEES, of which 1 is exact"
    shown = Table(title=title, title_style="", title_justify="left", box=None, pad_edge=False)
    errors = "range error, mm", "bearing error, deg"
    for heading in ("range, m", "sightings", *errors, "NEES as stated", "proportional", "propagated"):
        shown.add_column(heading, justify="right")
    for one in bins:
        shown.add_row(
            f"{one.low:g}-{one.high:g}",
            f"{one.sightings:,}",
            f"{1e3 * one.range_mean:+.1f} ± {1e3 * one.range_sd:.1f}",
            f"{57.29578 * one.bearing_mean:+.3f} ± {57.29578 * one.bearing_sd:.3f}",
            *map(number, one.nees),
        )
    return shown
