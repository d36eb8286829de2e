"""`bench detect` of any recording: a log that runs as it is, whole or not at all, and a page that needs no other."""

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import command
import floor_drives as floor
from html_page import Page
from narrow_window import fits, would_be_seen
from slamduel.bench.cli import main
from slamduel.bench.detect.folder import Request
from slamduel.bench.plan.load import load
from slamduel.core.truth.tum import write_tum
from slamduel.datasets.formats import log_folder
from slamduel.datasets.recordings.write import write
from slamduel.datasets.recordings.write_depth import write_depth
from slamduel.datasets.worlds import aruco_room, depth_room
from tiers import first_quick


def markers(folder: Path) -> None:
    write({folder: "frames"}, *aruco_room.record(aruco_room.Options(seconds=3.0), np.random.default_rng(1)))


def several(folder: Path) -> None:
    options = aruco_room.Options(seconds=5.0, frame_rate=2.0, scan_rate=5.0)
    recording, truth, scans, *_ = aruco_room.recorded(options, np.random.default_rng(1))
    write({folder: "frames"}, recording, truth, None, scans, aruco_room.MATCHING)


def laser(folder: Path) -> None:
    recording = floor.floor_drive()
    floor.carmen(folder / "floor.clf", recording)
    assert recording.odometry is not None
    write_tum(folder / "truth.tum", recording.t + floor.BEGIN, recording.odometry)
    (folder / "robot.toml").write_text('name = "cart"\n[laser]\npose = [0.0, 0.0, 0.0]\n')


def depth(folder: Path) -> None:
    recording, truth = depth_room.record(depth_room.Drive(laps=0.12, boxes=2), np.random.default_rng(5))
    write_depth({folder: "frames"}, recording, truth, depth_room.shots_of(recording).poses)


class Sensor(NamedTuple):
    write: Callable[[Path], None]  # a recording
    said: str  # about it, a pattern
    files: str  # beside those of every log
    figures: int
    part: float  # s


SENSORS = {
    "markers": Sensor(
        markers,
        r"^\d+ sightings of \d+ markers in 16 frames, \d\.\d\d a frame; \d+ saw none\. Corners fit to .* px\. "
        r"Against the truth, ranges are .*\. Left out: \d+ sightings beyond 3 m\. report",
        "landmarks.csv contact.png", 7, 1.0,
    ),
    "several": Sensor(
        several,
        r"^Frames and 25 scans of 201 beams in 5\.00 s: \d+ steps over 1\.\d+ m, \d motions by the scans alone, "
        r"0 loop closures\. \d+ sightings of \d+ markers in 11 frames, .* Every scan matched the last metres\. .*"
        r"Left out: .* Turned down: nothing\. report",
        "landmarks.csv loops.csv scans.npz contact.png map.png", 7, 2.5,  # one path for both
    ),
    "laser": Sensor(
        laser,
        r"^169 scans of 181 beams in 33\.6 s, with wheels: \d+ steps over 1\d\.\d m, 0 loop closures\. .* "
        r"so no loop was searched for\. Turned down: nothing\. remark: there is no sighting and no loop",
        "scans.npz map.png", 1, 10.0,
    ),
    "depth": Sensor(
        depth,
        r"^\d+ frames of 640x480 pixels in \d\.\d\d s, with wheels: \d+ steps over 1\.\d+ m, [\d,]+ sightings of \d+ "
        r"landmarks\. \d+ of \d+ pairs of keyframes were registered\. The floor levels every step\. "
        r"Turned down: .*\. Left out: nothing\. ",
        "clouds.npz map.png", 3, 2.0,  # paths, tilt, height: nothing was seen again
    ),
}  # fmt: skip


class Made(NamedTuple):
    recording: Path
    out: Path
    said: str
    sensor: Sensor


@pytest.fixture(scope="module", params=first_quick(SENSORS, 2))
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A recording, and its log."""
    home, sensor = tmp_path_factory.mktemp("made"), SENSORS[request.param]
    recording, out = home / "[drive]", home / "a log's"
    sensor.write(recording)
    with redirect_stdout(StringIO()) as said:
        assert main(["detect", str(recording), "--out", str(out)]) == 0
    return Made(recording, out, " ".join(said.getvalue().split()), sensor)


@pytest.mark.usefixtures("no_report")
def test_a_recording_becomes_a_log_that_runs(made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert re.search(made.sensor.said, made.said), made.said
    assert "\x1b" not in made.said
    assert f"report: {made.out / 'detection.html'}" in made.said
    quoted = str(made.out).replace("'", "'\"'\"'")
    assert made.said.endswith(f"next: bench run --dataset '{quoted}'")
    files = f"log.toml odometry.csv sightings.csv truth.tum detection.html {made.sensor.files}"
    assert {path.name for path in made.out.iterdir()} == set(files.split())
    log, truth = log_folder.read(made.out)
    direct = load(made.recording)
    assert log.digest == direct.log.digest
    assert log.name == direct.log.name
    np.testing.assert_array_equal(truth.t, direct.truth.t)
    np.testing.assert_array_equal(truth.poses, direct.truth.poses)
    assert main(["run", "--backend", "dead-reckoning", "--dataset", str(made.out), "--out", str(tmp_path / "run")]) == 0
    assert "ATE" in capsys.readouterr().out


def test_the_page_needs_nothing_but_itself(made: Made) -> None:
    text = (made.out / "detection.html").read_text(encoding="utf-8")
    page = Page(text)
    tags = Counter(tag for tag, _ in page.elements)
    assert not {"script", "link", "iframe", "object"} & tags.keys()
    assert tags["svg"] == made.sensor.figures
    pictures = [one for one in page.targets if re.match(r"data:image/(png|jpeg);base64,[\w/]", one)]
    assert len(pictures) == tags["img"] > 0
    assert all(attrs["alt"] for tag, attrs in page.elements if tag == "img")
    files = {path.name for path in made.out.iterdir()} - {"detection.html"}
    assert {one for one in page.targets if one[:1] != "#" and one not in pictures} == files
    assert "@import" not in text
    assert set(re.findall(r"url\(([^)])", text)) <= {"#"}
    assert not re.search("#0[1-9]0[1-9]0[1-9]", text)  # no stand-in colour is left


@pytest.mark.slow
def test_the_page_fits_a_narrow_window(made: Made, tmp_path: Path) -> None:
    text = (made.out / "detection.html").read_text(encoding="utf-8")
    assert fits(text, tmp_path)
    assert would_be_seen(text, tmp_path)


def test_an_earlier_detection_is_replaced_by_the_first_seconds(
    made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "log"
    shutil.copytree(made.out, out)
    whole, part = log_folder.read(out).log, str(made.sensor.part)
    words = ["detect", str(made.recording), "--out", str(out), "--seconds", part]
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    log = log_folder.read(out).log
    assert 2 <= len(log) < len(whole)
    assert log.t[-1] - log.t[0] <= made.sensor.part
    np.testing.assert_array_equal(log.delta[1:], whole.delta[1 : len(log)])
    assert list(tmp_path.iterdir()) == [out]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["log"], found["name"], found["truth"]) == (str(out), log.name, "truth")
    assert found["seconds"] == pytest.approx(made.sensor.part, abs=0.21)


def test_the_first_seconds_end_with_a_frame_at_them() -> None:
    times = [5.0, 6.0, 7.0, 8.0]
    assert list(Request("drive", Path(), seconds=2.0).first(times, float)) == times[:3]
    assert list(Request("drive", Path()).first(times, float)) == times


def test_what_is_odd_is_told_and_strictly_is_a_refusal(
    made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out, sentence = tmp_path / "drive", tmp_path / "log", "truth.tum has no pose at the log's times"
    shutil.copytree(made.recording, folder)
    (folder / "truth.tum").write_text("1000000 0 0 0 0 0 0 1\n")
    words = ["detect", str(folder), "--out", str(out), "--seconds", str(made.sensor.part)]
    assert main([*words, "--strict"]) == 2
    assert f"--strict: {folder}: {sentence}" in capsys.readouterr().err
    assert not out.exists()
    assert main(words) == 0
    assert f"remark: {sentence}" in capsys.readouterr().out
    assert sentence in (out / "detection.html").read_text().replace("&#39;", "'")
    assert len(log_folder.read(out).log.remarks) == 1


def test_a_folder_of_something_else_is_left_alone(
    made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = partial(command.refused, capsys, "detect", made.recording, "--out")
    for name in ("thesis.tex", "log.toml"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("mine")
        assert "is not empty and not of an earlier bench detect" in refused(folder)
        assert "is a file, expected a folder" in refused(folder / name)
        assert [path.read_text() for path in folder.iterdir()] == ["mine"]
    shutil.copytree(made.out, tmp_path / "log")
    (tmp_path / "log" / "thesis.tex").write_text("mine")
    assert "has thesis.tex, which bench detect did not write" in refused(tmp_path / "log")
    (tmp_path / "link").symlink_to(tmp_path / "log")
    assert "is a link, expected the folder itself" in refused(tmp_path / "link")
