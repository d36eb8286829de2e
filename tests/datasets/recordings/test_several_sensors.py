"""A recording of markers and a laser scanner: the same factors in every kind of it, and what cannot be used."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fuzzing import survivors
from recording_logs import of
from refusals import refused, refused_at
from slamduel.core.factors import Log
from slamduel.datasets.cache import generator
from slamduel.datasets.recordings.any_recording import Options as Chosen
from slamduel.datasets.recordings.any_recording import make
from slamduel.datasets.recordings.recording import Opened, open_recording
from slamduel.datasets.recordings.recording import build as build_frames
from slamduel.datasets.recordings.sensors import sensors_in
from slamduel.datasets.recordings.several import OpenedSeveral, open_several
from slamduel.datasets.recordings.write import write
from slamduel.datasets.scans.open import OpenedScans, open_scans
from slamduel.datasets.scans.robot import LaserRobot
from slamduel.datasets.scans.scans_csv import SCANS, read_scans_csv, write_scans_csv
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, aruco_room, recorded
from slamduel.frontend.wheels.ticks import Wheels
from tiers import first_quick

KINDS = ("frames", "ros1", "ros2", "mcap")
OPTIONS = Options(seconds=8.0, frame_rate=1.0, scan_rate=5.0)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One drive as each kind of recording."""
    home = tmp_path_factory.mktemp("several")
    recording, truth, scans, *_ = recorded(OPTIONS, generator("aruco-room", 3))
    write({home / name: name for name in KINDS}, recording, truth, None, scans, MATCHING)
    return {name: home / name for name in KINDS}


@pytest.mark.parametrize("kind", first_quick(KINDS[1:], 1))
def test_every_kind_gives_the_same_factors(kind: str, folders: dict[str, Path], log: Log) -> None:
    found = of(folders[kind])
    assert len(log.ids) > 5
    assert len(log.loop_to) >= 5
    for column in ("ids", "sighting_first", "loop_first", "loop_to"):
        np.testing.assert_array_equal(getattr(found, column), getattr(log, column))
    for column in ("t", "delta", "delta_cov", "z", "z_cov", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)
    assert found.remarks == log.remarks == []


def test_the_world_gives_the_same_factors_without_a_recording(log: Log) -> None:
    made = aruco_room(OPTIONS, generator("aruco-room", 3))
    for column in ("t", "delta", "z", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(made.log, column), getattr(log, column), rtol=0, atol=1e-9)
    assert made.truth is not None
    np.testing.assert_array_equal(made.truth.t, made.log.t)


def test_a_room_without_a_scanner_is_what_it_was() -> None:
    alone, truth, scans, *_ = recorded(replace(OPTIONS, scan_rate=0.0), generator("aruco-room", 3))
    beside, both, *_ = recorded(OPTIONS, generator("aruco-room", 3))
    assert scans is None
    assert isinstance(alone.motion, Wheels)
    assert isinstance(beside.motion, Wheels)
    np.testing.assert_array_equal(alone.motion.ticks.counts, beside.motion.ticks.counts)
    np.testing.assert_array_equal(next(iter(alone.frames)).image, next(iter(beside.frames)).image)
    np.testing.assert_array_equal(both.poses[np.isin(both.t, truth.t)], truth.poses)


def test_each_sensor_alone_is_what_its_own_robot_gives(drive: Path, log: Log) -> None:
    markers, laser = of(drive, sensors="markers"), of(drive, sensors="laser")
    text = (drive / "robot.toml").read_text()
    (drive / "robot.toml").write_text(text[: text.index("[laser]")])
    alone = build_frames(open_recording(drive)).log
    assert markers.digest == alone.digest
    np.testing.assert_array_equal(markers.z, log.z)
    assert not len(laser.ids)
    assert len(laser) + len(markers) == len(log)


def test_topics_and_sources_choose_the_scans(folders: dict[str, Path], drive: Path) -> None:
    opened = open_several(folders["ros2"])
    assert isinstance(opened, OpenedSeveral)
    assert opened.scans is not None
    assert opened.scans.recording.notes["topics"]["scan"] == "/scan"
    (drive / "more").mkdir()
    shutil.move(drive / SCANS, drive / "more" / SCANS)
    refused(
        r"found none, expected one recording: .*scans.csv. \[laser\] source in robot.toml selects one.* "
        r"is missing, where robot.toml has \[laser\]",
        open_several,
        drive,
    )
    text = (drive / "robot.toml").read_text()
    (drive / "robot.toml").write_text(text.replace("[laser]", f'[laser]\nsource = "more/{SCANS}"'))
    again = open_several(drive)
    assert isinstance(again, OpenedSeveral)
    assert len(again.scans.recording.t) == len(opened.scans.recording.t)


def test_sensors_that_are_not_there_are_refused(drive: Path) -> None:
    assert sensors_in("laser, markers", "--sensors") == ("laser", "markers")
    assert sensors_in("all", "--sensors") is None
    for empty in ("", " "):
        refused(
            "--sensors: found an empty name, expected all, or some of markers, laser, ", sensors_in, empty, "--sensors"
        )
    refused(r"--sensors lasre: found 'lasre'; did you mean 'laser'\?$", sensors_in, "lasre", "--sensors")
    refused(
        r"--sensors markers,: found ''; expected one of compass, depth, gps, gyro, laser, markers, wheels\.$",
        sensors_in,
        "markers,",
        "--sensors",
    )
    refused("--sensors laser,laser: a sensor is named twice, expected once", sensors_in, "laser,laser", "--sensors")
    text = (drive / "robot.toml").read_text()
    (drive / "robot.toml").write_text(text[: text.index("[laser]")])
    assert open_several(drive) is None
    robot = drive / "robot.toml"
    words = "found [markers], expected [laser] for the sensor laser that is named"
    refused_at(robot, words, open_several, drive, None, None, ("laser",))
    robot.unlink()
    words = "found no robot.toml, expected [markers] for the sensor markers that is named"
    refused_at(drive, words, open_several, drive, None, None, ("markers",))


def test_other_clocks_are_refused(drive: Path) -> None:
    lines = (drive / SCANS).read_text().splitlines()
    later = [lines[0], *(f"{float(line.split(',', 1)[0]) + 5000},{line.split(',', 1)[1]}" for line in lines[1:])]
    (drive / SCANS).write_text("\n".join(later))
    words = (
        "none of the 40 scans is within the time of the encoder readings: scans are from 5000.05 to 5007.85 s, encoder"
    )
    refused_at(drive / SCANS, words, open_several, drive)
    assert isinstance(open_several(drive, sensors=("markers",)), Opened)


def test_scans_beyond_the_wheels_are_left_out_with_a_remark(drive: Path) -> None:
    lines = (drive / "ticks.csv").read_text().splitlines()
    (drive / "ticks.csv").write_text(
        "\n".join(line for line in lines if not line[0].isdigit() or float(line.split(",")[0]) < 7.0)
    )
    opened = open_several(drive)
    assert isinstance(opened, OpenedSeveral)
    assert opened.scans is not None
    assert opened.scans.remarks == [
        "5 of 40 scans are before or after the encoder readings, 0 to 6.98 s, and are left out"
    ]


def test_a_motion_that_nothing_measured_leaves_matching_to_the_scans(drive: Path) -> None:
    (drive / "ticks.csv").unlink()
    robot = drive / "robot.toml"
    robot.write_text(robot.read_text() + "\n[drift]\nposition = 0.5\nturning = 0.5\n")
    opened = open_several(drive)
    assert isinstance(opened, OpenedSeveral)
    assert opened.scans is not None
    assert opened.scans.recording.odometry is None
    log = of(drive)
    assert not log.delta[1:].any()
    assert len(log.loop_to) >= 5
    robot.write_text(robot.read_text().replace("[laser]", '[laser]\nodometry = "wheels"'))
    refused("nothing measured the motion, expected wheels for", open_several, drive)


def test_scans_in_a_table_alone_are_a_recording(drive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "alone"
    folder.mkdir()
    shutil.copy(drive / SCANS, folder)
    (folder / "robot.toml").write_text("[laser]\npose = [0.125, 0.0, 0.0]\n")
    opened = open_scans(folder)
    assert isinstance(opened, OpenedScans)
    assert opened.recording.odometry is None
    np.testing.assert_array_equal(opened.recording.scanner.pose, [0.125, 0, 0])
    assert len(make(Chosen(path=str(folder)), np.random.default_rng(0)).log) > 3


def test_tables_of_scans_go_out_and_come_back(tmp_path: Path) -> None:
    scans = recorded(OPTIONS, generator("aruco-room", 3)).scans
    assert scans is not None
    write_scans_csv(tmp_path / SCANS, scans.t, scans.scanner, scans.ranges)
    found, remarks = read_scans_csv(tmp_path / SCANS, LaserRobot())
    assert remarks == []
    np.testing.assert_array_equal(found.t, scans.t)
    np.testing.assert_array_equal(found.ranges, scans.ranges)
    np.testing.assert_array_equal(found.scanner.angles, scans.scanner.angles)


FAULTS = {
    "t,first,r0,r1\n0,0,1,1": "line 1: found 't,first,r0,r1', expected the columns t,first,step,r0,r1 and so on",
    "t,first,step,r0,r1\n0,0,0.1,1,1": "found 1 scans, expected at least 2",
    "t,first,step,r0,r1\n0,0,0.1,1,1\n0,0,0.1,1,1": "line 3: t is 0.0, expected later than 0.0",
    "t,first,step,r0,r1\nnan,0,0.1,1,1": "line 2: t is 'nan', expected a number",
    "t,first,step,r0,r1\n0,0,0.1,1,x": "line 2: r1 is 'x', expected a number",
    "t,first,step,r0,r1\n0,0,-0.1,1,1": "line 2: step is -0.1 rad for 2 beams, expected a step above 0",
    "t,first,step,r0,r1\n0,0,0.1,1,1,1": "line 2: found 6 columns, expected 5, as the header has",
    "t,first,step,r0,r1\n0,0,0.1,,inf\n1,0,0.1,,nan": "expected returns in metres; found none that is a number",
    "t,first,step,r0,r1\n0,0,0.1,-2,-3\n1,0,0.1,-1,": "found -3 to -1, median -2: all are negative",
    "t,first,step,r0,r1\n0,0,0.1,2000,3000\n1,0,0.1,1000,": "found 1000 to 3000, median 2000: perhaps millimetres",
    "t,first,step,r0,r1\n0,0,0.1,0,0\n1,0,0.1,0,": "found 0 to 0, median 0: none is above 0",
}


@pytest.mark.parametrize("text", FAULTS)
def test_faults_in_a_table_name_their_line(text: str, tmp_path: Path) -> None:
    (tmp_path / SCANS).write_text(text)
    refused_at(tmp_path / SCANS, FAULTS[text], read_scans_csv, tmp_path / SCANS, LaserRobot())


def test_rows_of_other_beams_count_at_their_own_angles(tmp_path: Path) -> None:
    (tmp_path / SCANS).write_text("t,first,step,r0,r1,r2\n0,0,0.1,1,2,3\n1,-0.5,0.1,4,5\n")
    found, remarks = read_scans_csv(tmp_path / SCANS, LaserRobot())
    assert found.beams == (2, 3)
    assert "its scans have 2 to 3 beams" in remarks[0]
    np.testing.assert_allclose(
        found.points(1), [[4 * np.cos(0.5), -4 * np.sin(0.5)], [5 * np.cos(0.4), -5 * np.sin(0.4)]]
    )


def test_damaged_tables_are_read_or_refused(tmp_path: Path) -> None:
    rows = [f"{k / 5},-0.5,0.25,{1 + k / 8},2.0,,4.0" for k in range(8)]
    (tmp_path / SCANS).write_text("\n".join(("t,first,step,r0,r1,r2,r3", *rows)) + "\n")
    found, sentences = survivors(lambda path: read_scans_csv(path, LaserRobot()), tmp_path / SCANS, 200, 0)
    assert len(found) > 10
    assert len(sentences) > 10
    assert all((np.diff(one.t) > 0).all() for one, _ in found)
