"""A recording whose robot.toml has max_tilt or height: scans levelled by its accelerometer, and what is lacking."""

from pathlib import Path

import numpy as np
import pytest

from refusals import refused
from slamduel.datasets.cache import generator
from slamduel.datasets.recordings.recording import open_recording
from slamduel.datasets.recordings.several import OpenedSeveral, open_several
from slamduel.datasets.recordings.write import write
from slamduel.datasets.scans.tilted import levels_of
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, recorded


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """A recording of frames, scans and an inertial measurement unit."""
    options = Options(seconds=4.0, frame_rate=1.0, scan_rate=5.0, imu=True)
    recording, truth, made, imu, *_ = recorded(options, generator("aruco-room", 1))
    write({tmp_path / "drive": "frames"}, recording, truth, imu, made, MATCHING)
    return tmp_path / "drive"


def opened(drive: Path, asked: str = "") -> OpenedSeveral:
    """The recording with a line more in [laser]."""
    robot = drive / "robot.toml"
    robot.write_text(robot.read_text().replace("[laser]", f"[laser]\n{asked}"))
    found = open_several(drive)
    assert isinstance(found, OpenedSeveral)
    assert found.scans is not None
    return found


def test_robot_toml_asks_for_scans_without_those_that_lean(drive: Path) -> None:
    plain, level = opened(drive), opened(drive, "max_tilt = 0.03")
    assert plain.scans is not None
    assert level.scans is not None
    assert 2 <= len(level.scans.recording.t) < len(plain.scans.recording.t) == 20
    assert "leans by more than max_tilt, 0.03 rad" in " ".join(level.scans.remarks)


def test_robot_toml_asks_for_scans_without_returns_of_the_floor(drive: Path) -> None:
    plain, level = opened(drive), opened(drive, "height = 0.1")
    assert plain.scans is not None
    assert level.scans is not None
    before, after = plain.scans.recording, level.scans.recording
    assert len(after.t) == len(before.t)
    lost = np.isfinite(before.ranges) & np.isnan(after.ranges)
    assert 0 < lost.sum() < 0.3 * lost.size
    assert before.ranges[lost].min() > 1.0
    kept = np.isfinite(after.ranges)
    assert (after.ranges[kept] <= before.ranges[kept]).all()
    assert "% of the returns are of the floor" in " ".join(level.scans.remarks)


@pytest.mark.parametrize("asked", ["max_tilt = 0.03", "height = 0.1"])
def test_without_readings_it_is_refused(drive: Path, asked: str) -> None:
    robot = drive / "robot.toml"
    text = robot.read_text().replace("[laser]", f"[laser]\n{asked}")
    (drive / "imu.csv").unlink()
    robot.write_text("\n".join(text.split("[imu]")[:1]) + text[text.index("[laser]") :])
    refused("max_tilt and height need levels by gravity, and there are no inertial readings", open_several, drive)
    frames = open_recording(drive)
    refused("there are no inertial readings", levels_of, "x", None, frames.recording.motion, [])


def test_a_height_below_zero_is_refused(drive: Path) -> None:
    robot = drive / "robot.toml"
    robot.write_text(robot.read_text().replace("[laser]", "[laser]\nheight = -0.1"))
    refused("height", open_several, drive)
