"""A recording with an accelerometer: levelled the same from a folder and every bag, and what is odd about it."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command import run
from slamduel import load
from slamduel.bench.commands import detect as command_detect
from slamduel.core.se2 import Array
from slamduel.datasets.cache import generator
from slamduel.datasets.inertial.open import NOTE
from slamduel.datasets.recordings.recording import build, open_recording, without_imu
from slamduel.datasets.recordings.write import write
from slamduel.datasets.worlds.aruco_room import Options, recorded
from slamduel.frontend.inertial.imu import GRAVITY
from slamduel.frontend.inertial.tilts import LEVELS

OPTIONS = Options(seconds=3.0, frame_rate=2.0, gyro=0.02)
KINDS = ("ros1", "ros2", "mcap")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("levels")
    recording, truth, _, imu, *_ = recorded(OPTIONS, generator("aruco-room", 6))
    frames = list(recording.frames)
    recording = replace(recording, frames=frames)
    write({home / name: name for name in ("frames", *KINDS)}, recording, truth, imu)
    write({home / "none": "frames"}, recording, truth)
    return {one.name: one for one in home.iterdir()}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_recording_is_levelled_alike(kind: str, folders: dict[str, Path]) -> None:
    one, other = (build(open_recording(folders[name])).log for name in ("frames", kind))
    for name, value in one.notes[LEVELS].items():
        assert value == pytest.approx(other.notes[LEVELS][name], abs=1e-6)
    np.testing.assert_allclose(one.z, other.z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.z_cov, other.z_cov, rtol=0, atol=1e-9)


def test_without_the_imu_the_log_is_that_of_a_recording_without_one(folders: dict[str, Path]) -> None:
    plain = load(str(folders["none"])).log
    assert load(f"recording[path={folders['frames']},imu=false]").log.digest == plain.digest
    assert build(without_imu(open_recording(folders["mcap"]))).log.digest == plain.digest
    assert LEVELS not in plain.notes
    level = load(str(folders["frames"])).log
    np.testing.assert_array_equal(level.ids, plain.ids)
    assert np.abs(level.z - plain.z).max() > 1e-3
    spread, wide = (np.trace(one.z_cov, axis1=1, axis2=2).sum() for one in (level, plain))
    assert spread < wide / 3


Change = Callable[[Array], Array]

ODD: dict[str, tuple[Change, bool, str]] = {
    "in g": (lambda one: one / GRAVITY, True, "taken to be in g, and converted"),
    "upside down": (lambda one: one * [1, -1, -1], False, "taken to be upside down, and turned back"),
    "of no gravity": (lambda one: one * 0.75, False, "expected gravity"),
    "on its head": (
        lambda one: one * [1, 1, -1],
        False,
        "degrees on average, expected at most 20: sightings are not levelled",
    ),
}


@pytest.mark.parametrize("case", ODD)
def test_an_accelerometer_that_is_odd_is_a_remark_that_names_its_file(
    case: str, folders: dict[str, Path], tmp_path: Path
) -> None:
    change, levelled, words = ODD[case]
    folder = Path(shutil.copytree(folders["frames"], tmp_path / "drive"))
    robot, file = folder / "robot.toml", folder / "imu.csv"
    text = robot.read_text(encoding="utf-8")
    others = "".join(part for part in re.split(r"(?m)^(?=\[)", text) if not part.startswith("[imu"))
    said = "" if case == "upside down" else "[imu]\nmounting = {xyz = [0, 0, 0], rpy = [0, 0, 0]}\n"
    robot.write_text(f"{others}\n{said}", encoding="utf-8")
    header, *rows = file.read_text(encoding="utf-8").splitlines()
    values = np.array([row.split(",") for row in rows], float)
    values[:, 4:7] = change(values[:, 4:7])
    if case == "upside down":
        values[:, 1:4] *= [1, -1, -1]
    lines = [",".join(map(repr, row)) for row in values.tolist()]
    file.write_text("\n".join([header, *lines, ""]), encoding="utf-8")
    opened = open_recording(folder)
    assert any(str(file) in one and words in one for one in opened.recording.remarks), opened.recording.remarks
    assert (opened.recording.tilts is not None) == levelled
    log, plain = build(opened).log, build(open_recording(folders["none"])).log
    if levelled:
        expected = build(open_recording(folders["frames"])).log
        np.testing.assert_allclose(log.z, expected.z, atol=1e-9)
    else:
        assert case == "of no gravity" or "sightings are not levelled: " in log.notes[NOTE]
        np.testing.assert_array_equal(log.z, plain.z)
        np.testing.assert_array_equal(log.z_cov, plain.z_cov)


def test_frames_in_a_gap_of_the_readings_are_as_without(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["frames"], tmp_path / "drive"))
    header, *rows = (folder / "imu.csv").read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if not 1.2 < float(row.split(",")[0]) < 1.8]
    (folder / "imu.csv").write_text("\n".join([header, *kept, ""]), encoding="utf-8")
    log, plain = build(open_recording(folder)).log, build(open_recording(folders["none"])).log
    (remark,) = [one for one in log.remarks if "not levelled" in one]
    assert f"{folder / 'imu.csv'}: has no readings around the times of 1 of 7 frames" in remark
    mine = log.sighting_step == 3
    assert mine.any()
    np.testing.assert_array_equal(log.z[mine], plain.z[mine])
    np.testing.assert_array_equal(log.z_cov[mine], plain.z_cov[mine])


@pytest.mark.usefixtures("no_report")
def test_the_page_says_how_levels_are(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(folders["frames"])
    assert run(command_detect, path, "--out", str(tmp_path / "log")) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Sightings are levelled by gravity: pitch and roll are known to 0." in said
    assert "degrees (median), with a push of 0." in said
    page = (tmp_path / "log" / "detection.html").read_text(encoding="utf-8")
    assert "levelled by gravity" in page
    assert run(command_detect, path, "--out", str(tmp_path / "other"), "--json") == 0
    assert json.loads(capsys.readouterr().out)[LEVELS]["push"] > 0


def test_a_gyros_turns_are_compared_with_those_of_counted_wheels(tmp_path: Path) -> None:
    """Of the wrong sign, and in degrees that robot.toml says to be radians; none of the right ones."""
    recording, truth, _, imu, *_ = recorded(
        Options(seconds=15.0, frame_rate=0.2, gyro=0.02), generator("aruco-room", 6)
    )
    assert imu is not None
    frames = list(recording.frames)
    said = dict[float, list[str]]()
    for scale in (1.0, -1.0, 180 / np.pi):
        one = replace(imu, gyro=imu.gyro * [1.0, 1.0, scale])
        write({tmp_path / str(scale): "frames"}, replace(recording, frames=frames), truth, one)
        told = open_recording(tmp_path / str(scale)).told
        said[scale] = [remark for remark in told if "rad for each that the odometry turns" in remark]
    assert said[1.0] == []
    (turned,), (other,) = said[-1.0], said[180 / np.pi]
    assert "its axes are turned, as upside down" in turned
    assert "perhaps it is in deg/s, and not in rad/s as [imu] gyro in robot.toml says" in other
