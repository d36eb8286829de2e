"""`bench detect RECORDING --out LOG`: makes a recording of a camera, depth camera or scanner a log with a report."""

import argparse
import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ...core.errors import InputError
from ...datasets.depth.open import OpenedDepth, open_depth
from ...datasets.recordings.recording import open_recording
from ...datasets.recordings.robot import read_robot
from ...datasets.scans.open import OpenedScans, ScanTopics, open_scans
from ..camera.detect import DetectRequest, detect
from ..camera.folder import PAGE, check_place
from ..camera.noise_calibration import toml
from ..camera.preview import CODECS, Preview
from ..camera.summary import Findings, as_json, headline, left_out_words
from ..depth.detect import DepthRequest
from ..depth.detect import detect as look
from ..depth.findings import advice as depth_advice
from ..depth.findings import as_json as depth_as_json
from ..depth.findings import headline as depth_headline
from ..depth.findings import turned_down_words as depth_turned_down
from ..laser.detect import LaserRequest
from ..laser.detect import detect as match_scans
from ..laser.findings import advice as scans_advice
from ..laser.findings import as_json as scans_as_json
from ..laser.findings import headline as scans_headline
from ..laser.findings import turned_down_words
from ..plan.values import check_file, positive
from ..words.console import ProgressBar, plain, screen_console
from ..words.numerals import number


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
    add("--scan", metavar="TOPIC", help="the topic of the laser scans, in a bag with several")
    add("--odometry", metavar="TOPIC", help="the topic of their odometry, in a bag with several")
    add("--preview", type=Path, metavar="FILE", help="also write an annotated video (.mp4 .avi .mkv .webm)")
    add("--seconds", type=positive, metavar="N", help="stop after the first N seconds")
    add("--calibrate-noise", action="store_true", help="fit the noise models; the recording must have truth")
    add("--strict", action="store_true", help="refuse a log with a remark; none is written")
    add("--json", action="store_true", help="print the findings as JSON, and nothing else")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Detects; 0 where a log was written, even one without a sighting."""
    out: Path = namespace.out
    check_place(out)
    check_file("--preview", namespace.preview, tuple(CODECS))
    scans = open_scans(Path(namespace.recording), namespace.robot, ScanTopics(namespace.scan, namespace.odometry))
    if scans is not None:
        return _scans(scans, namespace)
    preview = None if namespace.preview is None else Preview(namespace.preview)
    depth = open_depth(Path(namespace.recording), namespace.robot)
    if depth is not None:
        return _depth(depth, preview, namespace)
    robot = None if namespace.robot is None else read_robot(namespace.robot)
    opened = open_recording(Path(namespace.recording), robot, namespace.seconds)
    console = screen_console(quiet=namespace.quiet or namespace.json)
    request = DetectRequest(
        namespace.recording, out, preview, namespace.seconds, namespace.calibrate_noise, namespace.strict
    )
    with ProgressBar(console, "frames", opened.length) as bar:

        def advance(markers: int) -> None:
            bar.update(advance=1, note=f"{markers:,} markers")

        findings = detect(opened.recording, opened.truth, request, advance)
    if namespace.json:
        print(json.dumps(as_json(findings, str(out)), indent=2))
        return 0
    sentences = [*headline(findings), f"Left out: {left_out_words(findings.log)}.", *findings.advice]
    _tell(console, sentences, findings.remarks)
    if findings.calibration is not None:
        console.print(_noise_table(findings))
        console.print(plain(toml(findings.calibration).rstrip()), highlight=False)
    _lead_on(console, out, raced=bool(findings.sightings.kept.any()))
    return 0


def _tell(console: Console, sentences: Sequence[str], remarks: Sequence[str]) -> None:
    for sentence in sentences:
        console.print(plain(sentence), highlight=False)
    for remark in remarks:
        console.print(plain(f"remark: {remark}."), highlight=False, soft_wrap=True)


def _lead_on(console: Console, out: Path, *, raced: bool = True) -> None:
    """Names the report, and the command that comes next where there is something to race backends on."""
    console.print(f"report: {plain(str(out / PAGE))}", highlight=False, soft_wrap=True)
    if raced:
        console.print(f"next:   bench run --dataset {plain(shlex.quote(str(out)))}", highlight=False, soft_wrap=True)


def _depth(opened: OpenedDepth, preview: Preview | None, namespace: argparse.Namespace) -> int:
    """Takes a depth camera's frames through the front end; 0 where a log was written."""
    if namespace.calibrate_noise:
        raise InputError(
            f"--calibrate-noise: {namespace.recording} is of a depth camera, which has no markers to fit; expected it "
            "without. depth_sd, floor and turn_floor under [depth] in robot.toml state the noise."
        )
    for flag, topic in (("--scan", namespace.scan), ("--odometry", namespace.odometry)):
        if topic is not None:
            raise InputError(
                f"{flag}: {namespace.recording} is of a depth camera, expected [topics] in robot.toml for its topics."
            )
    out: Path = namespace.out
    console = screen_console(quiet=namespace.quiet or namespace.json)
    with ProgressBar(console, "frames", opened.length) as bar:

        def advance(steps: int) -> None:
            bar.update(advance=1, note=f"{steps:,} steps")

        request = DepthRequest(namespace.recording, out, preview, namespace.seconds, namespace.strict)
        found = look(opened, request, advance)
    if namespace.json:
        print(json.dumps(depth_as_json(found, str(out)), indent=2))
        return 0
    _tell(console, [*depth_headline(found), depth_turned_down(found), *depth_advice(found)], found.remarks)
    _lead_on(console, out)
    return 0


def _scans(opened: OpenedScans, namespace: argparse.Namespace) -> int:
    """Matches laser scans; 0 where a log was written."""
    for flag, given in (("--preview", namespace.preview), ("--calibrate-noise", namespace.calibrate_noise)):
        if given:
            raise InputError(f"{flag}: {namespace.recording} has laser scans, expected a camera's recording.")
    out: Path = namespace.out
    console = screen_console(quiet=namespace.quiet or namespace.json)
    with ProgressBar(console, "scans", len(opened.recording.t)) as bar:

        def advance(loops: int) -> None:
            bar.update(advance=1, note=f"{loops:,} loops")

        request = LaserRequest(namespace.recording, out, namespace.seconds, namespace.strict)
        found = match_scans(opened, request, advance)
    if namespace.json:
        print(json.dumps(scans_as_json(found, str(out)), indent=2))
        return 0
    sentences = [*scans_headline(found), f"Turned down: {turned_down_words(found)}.", *scans_advice(found)]
    _tell(console, sentences, found.remarks)
    _lead_on(console, out)
    return 0


def _noise_table(findings: Findings) -> Table:
    title = "Errors by range, and NEES, of which 1 is exact"
    shown = Table(title=title, title_style="", title_justify="left", box=None, pad_edge=False)
    headings = (
        "range, m",
        "sightings",
        "range error, mm",
        "bearing error, deg",
        "NEES as stated",
        "proportional",
        "propagated",
    )
    for heading in headings:
        shown.add_column(heading, justify="right")
    assert findings.calibration is not None
    for one in findings.calibration.bins:
        shown.add_row(
            f"{one.low:g}-{one.high:g}",
            f"{one.sightings:,}",
            f"{1e3 * one.range_mean:+.1f} ± {1e3 * one.range_sd:.1f}",
            f"{57.29578 * one.bearing_mean:+.3f} ± {57.29578 * one.bearing_sd:.3f}",
            *map(number, one.nees),
        )
    return shown
