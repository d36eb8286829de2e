"""A recording of markers, a laser scanner and a depth camera: the same factors in every kind of it."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from command import run as run_command
from recording_logs import of
from refusals import refused
from slamduel.bench.commands import detect as command_detect
from slamduel.core.factors import Log
from slamduel.core.se2 import between
from slamduel.datasets.cache import generator
from slamduel.datasets.recordings.several import OpenedSeveral, open_several
from slamduel.datasets.recordings.write import write
from slamduel.datasets.recordings.write_bag import NAMES
from slamduel.datasets.recordings.write_depth import write_depth
from slamduel.datasets.worlds import depth_room
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, recorded
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import drive as along
from tiers import first_quick

KINDS = ("frames", "ros1", "ros2", "mcap")
OPTIONS = Options(seconds=8.0, frame_rate=1.0, scan_rate=5.0)
DEPTH = depth_room.Drive(laps=0.24, frame_rate=2.0, speed=0.4)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One drive as each kind of recording: the depth camera's part in a folder or bag of its own."""
    home = tmp_path_factory.mktemp("three")
    recording, truth, scans, *_ = recorded(OPTIONS, generator("aruco-room", 3))
    write({home / name: name for name in KINDS}, recording, truth, None, scans, MATCHING)
    seen, true = depth_room.record(DEPTH, generator("depth-room", 3))
    cameras = depth_room.shots_of(seen).poses
    write_depth({home / name / "depth": name for name in KINDS}, seen, true, cameras)
    for name in KINDS:
        inside = f"depth/{NAMES[name]}" if name in NAMES else "depth"
        robot = home / name / "robot.toml"
        floors = "floor = 0.0003\nturn_floor = 0.00015\nfloor_share = 0.0\n"
        table = f'[depth]\nsource = "{inside}"\nregistered = true\n{floors}'
        robot.write_text(f"{robot.read_text()}\n{table}")
    return {name: home / name for name in KINDS}


@pytest.mark.parametrize("kind", first_quick(KINDS[1:], 1))
def test_every_kind_gives_the_same_factors(kind: str, folders: dict[str, Path], log: Log) -> None:
    found = of(folders[kind])
    assert log.notes["depth"]["motions"] > 5
    assert log.notes["laser"]["motions"] > 3
    for column in ("ids", "sighting_first", "loop_first", "loop_to"):
        np.testing.assert_array_equal(getattr(found, column), getattr(log, column))
    for column in ("t", "delta", "delta_cov", "z", "z_cov", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)


def test_motions_by_depth_are_those_of_the_robot(log: Log, folders: dict[str, Path]) -> None:
    two = of(folders["frames"], sensors="markers+depth")
    assert "laser" not in two.notes
    assert len(two.loop_to) == two.notes["depth"]["motions"] + two.notes["depth"]["loops"]["in_log"]
    assert len(log.loop_to) == len(two.loop_to) + log.notes["laser"]["motions"] + log.notes["laser"]["loops"]
    true = along(LOOP, OPTIONS.speed, two.t)[0]
    off = two.loop_delta - between(true[two.loop_to], true[two.loop_step])
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(two.loop_cov), off) / 3
    assert squares.mean() < 2.5
    assert np.abs(off[:, :2]).max() < 0.03


def test_sensors_alone_are_what_their_own_robots_give(folders: dict[str, Path], log: Log) -> None:
    markers = of(folders["frames"], sensors="markers")
    np.testing.assert_array_equal(markers.z, log.z)
    assert not len(markers.loop_to)
    depth = of(folders["frames"], sensors="depth")
    assert not len(depth.ids)
    assert len(depth) == log.notes["depth"]["steps"]
    laser = of(folders["frames"], sensors="laser")
    assert len(laser) + len(depth) + len(markers) >= len(log)


def test_scans_and_depth_need_no_markers_in_the_description(drive: Path) -> None:
    """Nor frames beside the depth camera's own, here in a folder; the log is the one with a description of markers."""
    named = of(drive, sensors="laser+depth")
    robot = drive / "robot.toml"
    text = robot.read_text()
    for table in ("markers", "noise"):
        text = re.sub(rf"^\[{table}\]\n(?:[^\[\n].*\n|\n)*", "", text, flags=re.MULTILINE)
    assert "[markers]" not in text
    robot.write_text(text)
    shutil.rmtree(drive / "frames")
    (drive / "frames.csv").unlink()
    log = of(drive)
    assert not len(log.ids)
    assert len(log.loop_to)
    assert log.digest == named.digest
    alone = of(drive, sensors="depth")
    assert "laser" not in alone.notes
    robot.write_text(text.replace("[depth]", "[depth]\nlandmarks = true"))
    refused(r"landmarks.* is true beside \[laser\], expected false", open_several, drive)


def test_without_wheels_frames_tell_the_motion(drive: Path) -> None:
    said = "the robot's motion is unknown, as wheels are left out of the sensors; expected wheels among them, .*drift"
    refused(said, of, drive, sensors="markers+depth+gyro")
    with (drive / "robot.toml").open("a") as file:
        file.write("\n[drift]\nposition = 0.5\nturning = 0.5\n")
    log = of(drive, sensors="markers+depth+gyro")
    assert not log.delta[1:].any()
    assert log.notes["depth"]["motions"] > 5


def test_what_would_count_twice_is_refused(drive: Path) -> None:
    robot = drive / "robot.toml"
    robot.write_text(robot.read_text().replace("[depth]", "[depth]\nlandmarks = true"))
    refused(r"landmarks.* is true beside \[markers\], expected false: .* would count twice", open_several, drive)
    robot.write_text(robot.read_text().replace("landmarks = true", "landmarks = false\nloops = false"))
    opened = open_several(drive)
    assert isinstance(opened, OpenedSeveral)
    assert opened.depth_settings is not None
    assert not opened.depth_settings.loops


def test_sensors_that_are_not_there_are_refused(drive: Path) -> None:
    refused(r"has no \[gps\], expected it for the sensor gps", of, drive, sensors="markers+gps")
    refused("none of them sees, expected markers, laser, depth among them", of, drive, sensors="gps+wheels")


def test_the_page_says_what_was_used(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(command_detect, drive, "--out", tmp_path / "log") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "In the log: " in said
    assert "by depth frames" in said
    assert "each measurement is in one of them" in said
    assert run_command(command_detect, drive, "--out", tmp_path / "two", "--sensors", "markers,depth") == 0
    assert "by the depth frames alone" in " ".join(capsys.readouterr().out.split())
    page = (tmp_path / "two" / "detection.html").read_text()
    assert "what its sensors saw" in page
