"""Recordings of laser scans by their path: bags, CARMEN logs and folders with robot.toml, and what names a mistake."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bags
import floor_drives as floor
from fuzzing import survivors
from refusals import refusal, refused
from slamduel.bench.plan.load import load
from slamduel.core.truth.tum import write_tum
from slamduel.datasets.recordings.robot import read_robot
from slamduel.datasets.scans.open import OpenedScans, open_scans
from slamduel.datasets.scans.robot import LaserRobot, read_laser_robot
from slamduel.frontend.laser.recording import LaserRecording

FULL = """
name = "cart"
[laser]
topic = "/front"
source = "drive.bag"
pose = [0.1, -0.2, 0.3]
min_range = 0.2
max_range = 40
odometry = "wheels"
max_gap = 0.4
odom_frame = "world"
step = 0.3
turn = 0.2
cell = 0.04
loops = false
loop_every = 3
[topics]
odometry = "/wheel_odom"
[prior]
pose = [1.0, 2.0, 0.5]
sd = [0.1, 0.1, 0.05]
"""


@pytest.fixture(scope="module")
def drive() -> LaserRecording:
    return floor.floor_drive()


def written(folder: Path, words: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(words)
    return folder / "robot.toml"


def test_every_key_of_robot_toml_counts(tmp_path: Path) -> None:
    robot = read_laser_robot(written(tmp_path, FULL))
    assert (robot.name, robot.topic, robot.source) == ("cart", "/front", "drive.bag")
    assert robot.odometry_topic == "/wheel_odom"
    assert robot.pose.tolist() == [0.1, -0.2, 0.3]
    assert (robot.min_range, robot.max_range, robot.max_gap) == (0.2, 40.0, 0.4)
    assert (robot.odometry, robot.odom_frame) == ("wheels", "world")
    s = robot.settings
    assert (s.step, s.turn, s.cell, s.loops, s.loop_every) == (0.3, 0.2, 0.04, False, 3)
    assert robot.prior.pose.tolist() == [1.0, 2.0, 0.5]
    np.testing.assert_allclose(np.diag(robot.prior.cov), [0.01, 0.01, 0.0025])
    bare = read_laser_robot(written(tmp_path / "bare", "[laser]\n"))
    assert bare.settings == LaserRobot().settings
    assert (bare.pose, bare.prior, bare.topic, bare.max_range) == (None, None, None, 25.0)


def test_a_robot_toml_of_a_camera_is_none_of_a_scanner(tmp_path: Path) -> None:
    assert read_laser_robot(written(tmp_path, '[markers]\ndictionary = "4X4_50"\nside = 0.1\n')) is None
    refused(r"robot\.toml, line 3: laser: is of a robot with a scanner, expected", read_robot, written(tmp_path, FULL))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("min_range = 0.2", "minrange = 0.2", "line 7: laser.minrange: there is no such key; did you mean 'min_range'"),
        ("[topics]\nodometry", "[topics]\nodometri", "topics.odometri: there is no such key; did you mean 'odometry'?"),
        ("[prior]", "[prio]", "prio: there is no such key; did you mean 'prior'?"),
        ("pose = [0.1, -0.2, 0.3]", "pose = [0.1, -0.2]", "line 6: laser.pose: found [0.1, -0.2], expected 3 numbers"),
        (
            "pose = [0.1, -0.2, 0.3]",
            "pose = [0.1, -0.2, 30]",
            "found 30, expected radians from -3.15 to 3.15 (0.524",
        ),
        (
            "pose = [0.1, -0.2, 0.3]",
            "pose = [100, -20, 0.3]",
            "found 100, expected metres from -5 to 5 (0.1 if",
        ),
        ("max_range = 40", "max_range = 0.1", "line 8: laser.max_range: ranges would count from 0.2 to 0.1 m, exp"),
        ("max_range = 40", "max_range = 400", "found 400, expected metres from 0 to 100 (4 if this is in centimetres)"),
        ("min_range = 0.2", "min_range = -1", "laser.min_range: found -1, expected a number at least 0"),
        ('odometry = "wheels"', 'odometry = "wheel"', "found 'wheel', expected one of 'auto', 'wheels', 'none'"),
        ("max_gap = 0.4", "max_gap = 0", "laser.max_gap: found 0, expected a number above 0"),
        ("max_gap = 0.4", "max_tilt = 10", "laser.max_tilt: found 10, expected radians from 0 to 0.5 (0.175 if this"),
        ("step = 0.3", "step = 30", "laser.step: found 30, expected a number from 0.05 to 10"),
        ("step = 0.3", "step = 0.01", "laser.step: found 0.01, expected a number at least 0.05"),
        ("loops = false", 'loops = "no"', "laser.loops: found 'no', expected true or false"),
        ("loop_every = 3", "loop_every = 0", "laser.loop_every: found 0, expected a whole number, at least 1"),
        ('topic = "/front"', "topic = 3", "laser.topic: found 3, expected a text in quotes"),
        ("[prior]", "[markers]\nside = 1\n[prior]", "laser: is given beside [markers], expected one robot.toml for"),
        ("[laser]", "laser = 3\n[laser2]", "laser2: there is no such key; did you mean 'laser'?"),
    ],
)
def test_mistakes_in_robot_toml_are_named_with_their_line(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in FULL
    assert words in refusal(read_laser_robot, written(tmp_path, FULL.replace(old, new, 1)))


def test_a_folder_a_bag_and_a_carmen_log_are_datasets_by_their_path(drive: LaserRecording, tmp_path: Path) -> None:
    laser = "[laser]\npose = [0.0, 0.0, 0.0]\nstep = 0.3\n"
    written(tmp_path / "clf", laser)
    floor.carmen(tmp_path / "clf" / "drive.clf", drive)
    path = floor.bag(tmp_path / "ros2", "ros2", floor.scans(drive), floor.odometry(drive))
    written(tmp_path / "ros2", laser)
    logs = [load(one)[0] for one in (tmp_path / "clf", tmp_path / "clf" / "drive.clf", tmp_path / "ros2", path)]
    logs.append(load(f"recording[path={path},robot={tmp_path / 'clf' / 'robot.toml'}]")[0])
    for log in logs[1:]:
        np.testing.assert_allclose(log.delta, logs[0].delta, rtol=0, atol=1e-9)
    assert logs[0].notes["laser"]["settings"]["step"] == 0.3
    moved = tmp_path / "alone"
    moved.mkdir()
    bare, _ = load((tmp_path / "ros2" / "drive").rename(moved / "drive"))
    assert bare.notes["laser"]["settings"]["step"] == 0.5
    assert bare.name == "drive"
    assert bare.remarks


def test_the_truth_beside_is_that_of_the_steps(drive: LaserRecording, tmp_path: Path) -> None:
    written(tmp_path / "drive", "[laser]\n")
    floor.carmen(tmp_path / "drive" / "floor.clf", drive)
    assert drive.odometry is not None
    write_tum(tmp_path / "drive" / "truth.tum", drive.t + floor.BEGIN, drive.odometry)
    log, truth = load(tmp_path / "drive")
    assert truth is not None
    np.testing.assert_array_equal(truth.t, log.t)
    write_tum(tmp_path / "drive" / "truth.tum", drive.t + 5000, drive.odometry)
    log, _ = load(tmp_path / "drive")
    assert any("truth.tum has no pose at the log's times" in remark for remark in log.remarks)


def test_what_cannot_be_opened_is_named(drive: LaserRecording, tmp_path: Path) -> None:
    written(tmp_path / "drive", "[laser]\n")
    refused(r"drive: found none, expected one recording: a ROS bag", open_scans, tmp_path / "drive")
    one = floor.carmen(tmp_path / "drive" / "a.clf", drive)
    floor.carmen(tmp_path / "drive" / "b.clf", drive)
    refused(r"found a\.clf, b\.clf, expected one recording: .* \[laser\] source in", open_scans, tmp_path / "drive")
    written(tmp_path / "drive", '[laser]\nsource = "b.clf"\n')
    found = open_scans(tmp_path / "drive")
    assert found.recording.name == "b"
    written(tmp_path / "drive", '[laser]\nsource = "c.clf"\n')
    refused(r"which is the \[laser\] source in robot\.toml", open_scans, tmp_path / "drive")
    written(tmp_path / "drive", '[laser]\ntopic = "/scan"\n')
    refused(r"a\.clf: topic is given, '/scan', and a CARMEN log has no topics", open_scans, one)
    (tmp_path / "drive" / "film.mp4").touch()
    refused(r"film\.mp4: found a file of an unknown kind, expected a", open_scans, tmp_path / "drive" / "film.mp4")
    refused(r"nothing: there is no such file or folder", open_scans, tmp_path / "drive" / "nothing")
    written(tmp_path / "drive", '[markers]\ndictionary = "4X4_50"\nside = 0.1\n')
    refused(r"robot\.toml: has no \[laser\], expected it for the scans in .*a\.clf", open_scans, one)


def test_a_cameras_recording_is_left_to_the_camera(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    path = bags.write(tmp_path / "bag", "ros2", [bags.image(k * 10**8, np.zeros((4, 6))) for k in range(1, 4)])
    assert open_scans(path) is None
    assert open_scans(tmp_path / "nowhere") is None
    assert open_scans(Path("camera:0")) is None
    written(tmp_path / "bag", '[markers]\ndictionary = "4X4_50"\nside = 0.1\n')
    assert open_scans(path) is None


def test_carmens_no_return_is_none_with_any_range(drive: LaserRecording, tmp_path: Path) -> None:
    path = floor.carmen(tmp_path / "floor.clf", drive)
    written(tmp_path, "[laser]\nmax_range = 100\nmin_range = 0.0\n")
    found = open_scans(path)
    missing = drive.ranges[5] > 20
    assert missing.any()
    points = found.recording.scanner.points(found.recording.ranges[5])
    assert len(points) == int((~missing).sum())
    nothing = floor.carmen(tmp_path / "none.clf", replace(drive, ranges=np.full_like(drive.ranges, 81.83)))
    refused("no range is between 0 and 100 m, expected metres", open_scans, nothing)


def test_a_damaged_log_is_read_or_refused_with_a_sentence(drive: LaserRecording, tmp_path: Path) -> None:
    few = replace(drive, t=drive.t[:12], ranges=drive.ranges[:12, ::6], odometry=drive.odometry[:12])  # pyright: ignore[reportOptionalSubscript]

    def usable(opened: OpenedScans | None) -> None:
        recording = opened.recording
        assert (np.diff(recording.t) > 0).all()
        assert np.isfinite(recording.scanner.angles).all()
        assert recording.odometry is None or np.isfinite(recording.odometry).all()
        for ranges in recording.ranges:
            assert np.isfinite(recording.scanner.points(ranges)).all()

    found, sentences = survivors(open_scans, floor.carmen(tmp_path / "floor.clf", few), 240, 3, usable)
    assert len(found) > 60
    assert len(sentences) > 30
