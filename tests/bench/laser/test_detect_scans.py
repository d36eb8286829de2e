"""`bench detect` of laser scans: a log that runs as it is, its scans beside it, and a report of what was matched."""

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import bags
import floor_drives as floor
from narrow_window import fits, would_be_seen
from slamduel.bench.cli import main
from slamduel.bench.drawing.map_picture import CELL, MOST, MapPicture, map_picture
from slamduel.bench.laser.detect import LaserRequest, detect
from slamduel.bench.laser.findings import LaserFindings, advice, as_json, headline
from slamduel.bench.plan.load import load
from slamduel.core.beside import Scans
from slamduel.core.factors import Log, Prior
from slamduel.core.relations import Anchors
from slamduel.core.se2 import Array
from slamduel.core.tum import write_tum
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.beside_file import read_beside
from slamduel.datasets.scans.open import open_scans
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.laser.scanner import Scanner
from slamduel.frontend.maps.occupancy import occupancy

FILES = {"log.toml", "odometry.csv", "sightings.csv", "scans.npz", "map.png", "detection.html"}


def run(path: Path, out: Path, **request: Any) -> LaserFindings:
    opened = open_scans(path)
    assert opened is not None
    return detect(opened, LaserRequest("drive", out, **request), lambda _: None)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a short drive, robot.toml and truth.tum."""
    folder, recording = tmp_path_factory.mktemp("floor") / "drive", floor.floor_drive()
    floor.carmen(folder / "floor.clf", recording)
    assert recording.odometry is not None
    write_tum(folder / "truth.tum", recording.t + floor.BEGIN, recording.odometry)
    (folder / "robot.toml").write_text('name = "cart"\n[laser]\npose = [0.0, 0.0, 0.0]\n')
    return folder


@pytest.mark.usefixtures("no_report")
def test_a_folder_becomes_a_log_that_runs(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a log"
    assert main(["detect", str(drive), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert re.search(
        r"169 scans of 181 beams in 33\.6 s, with wheels: \d+ steps over 1\d\.\d m, 0 loop closures\.", told
    )
    assert "so no loop was searched for." in told
    assert "Turned down: nothing." in told
    assert f"report: {out / 'detection.html'}" in told
    assert f"bench run --dataset '{out}'" in told
    assert {path.name for path in out.iterdir()} == FILES | {"truth.tum"}
    log, truth = log_folder.read(out)
    direct, _ = load(drive)
    assert log.digest == direct.digest
    assert log.name == "cart"
    assert truth is not None
    assert len(truth.t) == len(log)
    scans = read_beside(out, "scans", len(log))
    assert scans is not None
    assert 100 < len(scans.ranges) < 169  # one every 0.1 m or rad
    assert main(["run", "--backend", "dead-reckoning", "--dataset", str(out), "--out", str(tmp_path / "run")]) == 0
    assert "ATE" in capsys.readouterr().out


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap"])
def test_a_bare_bag_runs_and_becomes_the_same_log(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = floor.floor_drive()
    path = floor.bag(tmp_path / "bag", kind, floor.scans(recording), floor.odometry(recording), floor.mounting())
    assert main(["detect", str(path), "--out", str(tmp_path / "log"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["scans"], found["beams"], found["wheels"]) == (169, 181, True)
    assert found["remarks"] == ["there is no sighting and no loop closure in it, so every backend gives dead reckoning"]
    log = log_folder.read(tmp_path / "log").log
    direct, _ = load(str(path))
    assert log.digest == direct.digest
    assert found["steps"] == len(log)
    assert main(["run", "--backend", "dead-reckoning", "--dataset", str(path), "--out", str(tmp_path / "run")]) == 0
    assert "dead-reckoning" in capsys.readouterr().out


def test_only_the_first_seconds(drive: Path, tmp_path: Path) -> None:
    found = run(drive, tmp_path / "log", seconds=10.0)
    assert len(found.recording.t) == 51
    assert found.log.t[-1] <= floor.BEGIN + 10.0


def test_the_command_refuses_what_it_cannot_do(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "log")

    def refused(*words: str) -> str:
        capsys.readouterr()
        assert main(["detect", *words, "--out", out]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "Traceback" not in said
        return said

    assert "--preview: " in refused(str(drive), "--preview", str(tmp_path / "x.mp4"))
    assert "has laser scans, expected a camera's recording" in refused(str(drive), "--calibrate-noise")
    assert "a CARMEN log has no topics" in refused(str(drive), "--scan", "/scan")
    assert "the robot moved 0 m in 1 scans, expected at least one step" in refused(str(drive), "--seconds", "0.01")
    recording = floor.floor_drive()
    floor.carmen(tmp_path / "on" / "floor.clf", recording)
    (tmp_path / "on" / "robot.toml").write_text('[laser]\ngrid = "grids"\n')
    assert "[laser] grid in robot.toml localises on a map, and bench detect makes one" in refused(str(tmp_path / "on"))
    (tmp_path / "two").mkdir()
    both = [*floor.scans(recording), *(one._replace(topic="/rear") for one in floor.scans(recording))]
    path = bags.write(tmp_path / "two", "ros2", both)
    assert "/rear (sensor_msgs/LaserScan, 169 messages)" in refused(str(path))
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"nothing")
    assert "is damaged or not a ROS bag" in refused(str(broken))
    assert "--strict: " in refused(str(path), "--scan", "/scan", "--strict")
    assert not (tmp_path / "log").exists()
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "thesis.tex").write_text("mine")
    assert "not of an earlier bench detect" in refused(str(drive))


def test_an_earlier_detection_is_replaced(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "log"
    run(drive, out)
    before = (out / "odometry.csv").read_bytes()
    run(drive, out, seconds=20.0)
    assert (out / "odometry.csv").read_bytes() != before
    assert {path.name for path in tmp_path.iterdir()} == {"log"}


# --- the picture and the page -----------------------------------------------------------------------------------------


def square_room() -> LaserRecording:
    """Nine scans from the middle of a room of 4 m by 2 m, one turned."""
    angles = np.linspace(-np.pi, np.pi, 721)[:-1]
    heading = np.zeros(9)
    heading[4] = 0.5
    poses = np.column_stack((np.linspace(-0.5, 0.5, 9), np.zeros(9), heading))
    ranges = list[Any]()
    for x, y, turn in poses:
        c, s = np.cos(angles + turn), np.sin(angles + turn)
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges.append(np.fmin((np.sign(c) * 2 - x) / c, (np.sign(s) - y) / s))
    scanner = Scanner(angles, np.zeros(3), 0.1, 10.0)
    return LaserRecording("room", scanner, np.arange(9.0), np.array(ranges), poses, Prior(poses[0], 1e-6 * np.eye(3)))


def beside(recording: LaserRecording) -> Scans:
    """Its scans, each at a step of its own."""
    n, origin = len(recording.t), np.zeros((len(recording.t), 3))
    at = Anchors(np.arange(n), origin, origin, np.zeros(n))
    return Scans(at, recording.ranges.astype(np.float32), recording.scanner.angles, recording.scanner.pose)


def drawn(recording: LaserRecording, path: Array) -> MapPicture:
    return map_picture(occupancy(beside(recording), path, CELL, MOST), path)


def test_walls_are_where_the_beams_ended() -> None:
    recording = square_room()
    assert recording.odometry is not None
    picture = drawn(recording, recording.odometry)
    assert picture.cell == 0.05
    assert picture.bar == 1.0
    dark = np.argwhere(picture.image[:-12].max(axis=2) < 40)  # without the bar
    height = picture.image.shape[0] - 12
    x = picture.corner[0] + picture.cell * (dark[:, 1] + 0.5)
    y = picture.corner[1] + picture.cell * (height - 1 - dark[:, 0] + 0.5)
    off = np.minimum(np.abs(np.abs(x) - 2), np.abs(np.abs(y) - 1))
    assert len(dark) > 2 * (4 + 2) / 0.05 * 0.9
    assert off.max() < 0.05 + 1e-9
    assert (np.abs(x) < 2.06).all()
    assert (np.abs(y) < 1.06).all()
    moved = drawn(recording, recording.odometry + np.array([1000.0, 0, 0]))
    np.testing.assert_allclose(moved.corner, picture.corner + np.array([1000.0, 0.0]), atol=0.051)


def test_a_large_map_has_larger_pixels() -> None:
    recording = square_room()
    assert recording.odometry is not None
    far = recording.odometry.copy()
    far[4:, 0] += 400.0
    picture = drawn(recording, far)
    assert max(picture.image.shape) <= 1600
    assert picture.cell > 0.2


def findings(**counts: Any) -> LaserFindings:
    """Those of made-up counts."""
    recording = square_room()
    assert recording.odometry is not None
    n = len(recording.t)
    notes = {
        "scans": n,
        "lost": 0,
        "relocated": 0,
        "by_wheels": 0,
        "searched": 0,
        "confirmed": 0,
        "submaps": 2,
        "wheels": True,
    }
    notes |= {"turned_down": {}, "settings": {"loops": True}, "left_out": "nothing"} | counts
    rows = np.arange(1, n)
    motion = np.tile([0.125, 0.0, 0.0], (n, 1))
    nothing = np.zeros(0, np.int64)
    log = Log.from_arrays(
        "<cart>", recording.prior, recording.t, motion, np.tile(1e-4 * np.eye(3), (n, 1, 1)),
        nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2, 2)), loop_step=rows[5:], loop_to=rows[5:] - 6,
        loop_delta=motion[6:], loop_cov=np.tile(1e-4 * np.eye(3), (n - 6, 1, 1)), notes={"laser": notes},
    )  # fmt: skip
    return LaserFindings(log, None, recording, recording.odometry)


def test_what_was_matched_is_told_in_numbers() -> None:
    plain = findings()
    assert headline(plain)[1:] == [
        "Every scan matched the last metres.",
        "The robot never came back to where it had been, so no loop was searched for.",
    ]
    assert advice(plain) == []
    found = findings(
        lost=3,
        relocated=2,
        by_wheels=2,
        searched=1234,
        confirmed=4,
        turned_down={"no place": 1200, "beams through walls": 31},
    )
    assert headline(found) == [
        "9 scans of 720 beams in 8.00 s, with wheels: 9 steps over 1.00 m, 3 loop closures.",
        "3 scans did not match the last metres (33 %); the search placed 2 of them elsewhere.",
        "2 scans were placed by the wheels: what they were matched to moved along with the robot.",
        (
            "Steps were searched for in earlier submaps 1,234 times: 3 loop closures, 4 of them far from the estimate "
            "and confirmed, and 1,231 turned down."
        ),
    ]
    (said,) = advice(found)
    assert said.startswith("33 % of the scans did not match, and 100 % of the beams are returns between 0.1 and 10 m")
    told = as_json(found, "log")
    assert list(told["turned_down"].items()) == [("no place", 1200), ("beams through walls", 31)]
    json.dumps(told)


def test_the_page_needs_nothing_but_itself(drive: Path, tmp_path: Path) -> None:
    run(drive, tmp_path / "log's")
    text = (tmp_path / "log's" / "detection.html").read_text(encoding="utf-8")
    targets = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert {one for one in targets if not one.startswith(("data:image/png;base64,", "#"))} <= FILES
    assert not re.search(r"<(script|link|iframe)\b", text)
    assert text.count("<svg") == 1
    assert "scans that matched the last metres" in text
    picture = cv2.imread(str(tmp_path / "log's" / "map.png"))
    assert picture is not None
    assert (picture.max(axis=2) < 40).sum() > 500


@pytest.mark.slow
def test_the_page_fits_a_narrow_window(drive: Path, tmp_path: Path) -> None:
    run(drive, tmp_path / "log")
    text = (tmp_path / "log" / "detection.html").read_text(encoding="utf-8")
    assert fits(text, tmp_path)
    assert would_be_seen(text, tmp_path)
