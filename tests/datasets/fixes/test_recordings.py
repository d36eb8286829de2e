"""GPS and a compass in recordings: the same factors from every kind, and what cannot be used."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
from fuzzing import survivors
from recording_logs import of
from refusals import refused, refused_at
from slamduel.core.factors import Log
from slamduel.core.se2 import wrap
from slamduel.core.toml.table import TomlTable
from slamduel.datasets.bags.bag import Bag
from slamduel.datasets.cache import generator
from slamduel.datasets.fixes.degrees import exchanged, measured
from slamduel.datasets.fixes.geodetic import degrees, metres
from slamduel.datasets.fixes.gps_csv import FILE, read_gps_csv
from slamduel.datasets.fixes.gps_messages import read_gps_messages
from slamduel.datasets.fixes.robot import GpsTable, WorldTables, world_in
from slamduel.datasets.recordings.write import Located, write
from slamduel.datasets.recordings.write_bag import Positions
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, recorded
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import drive as along
from slamduel.frontend.world.compass import Compass
from tiers import first_quick

KINDS = ("frames", "ros1", "ros2", "mcap")
OPTIONS = Options(seconds=8.0, frame_rate=1.0, scan_rate=5.0, gyro=0.01, sway=0.001)
ORIGIN = np.array([48.1, 11.5])
SD = 0.05
COMPASS = Compass(declination=0.06, sd=0.05, offset_sd=0.0, every=0.7)


def positions(seed: int) -> Positions:
    """What a receiver above the robot's origin tells, three times a second."""
    t = np.arange(0.03, 7.9, 1 / 3)
    xy = along(LOOP, OPTIONS.speed, t)[0][:, :2] + SD * np.random.default_rng(seed).standard_normal((len(t), 2))
    scale = metres(ORIGIN + np.eye(2) * 1e-3, ORIGIN)  # m by a thousandth of a degree
    degrees = ORIGIN + np.column_stack((xy[:, 1] / scale[0, 1], xy[:, 0] / scale[1, 0])) * 1e-3
    np.testing.assert_allclose(metres(degrees, ORIGIN), xy, atol=1e-6)
    return Positions(t, degrees, np.full(len(t), SD))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One drive as each kind of recording."""
    home = tmp_path_factory.mktemp("outdoors")
    recording, truth, scans, imu, *_ = recorded(OPTIONS, generator("aruco-room", 3))
    assert imu is not None
    north = np.pi / 2 - COMPASS.declination - along(LOOP, OPTIONS.speed, imu.t)[0][:, 2]
    mag = np.column_stack((2e-5 * np.cos(north), 2e-5 * np.sin(north), np.full(len(north), -4e-5)))
    mag[np.arange(len(mag)) % 4 > 0] = np.nan
    world = Located(positions(3), WorldTables(GpsTable(origin=ORIGIN), COMPASS))
    places = {home / name: name for name in KINDS}
    write(places, recording, truth, replace(imu, mag=mag), scans, MATCHING, world)
    return {name: home / name for name in KINDS}


@pytest.mark.parametrize("kind", first_quick(KINDS[1:], 1))
def test_every_kind_gives_the_same_factors(kind: str, folders: dict[str, Path], log: Log) -> None:
    found = of(folders[kind])
    assert log.fixes is not None
    assert found.fixes is not None
    assert log.gyro is not None
    assert found.gyro is not None
    assert log.notes["fixes"]["positions"] == 24
    assert log.notes["fixes"]["headings"] >= 8
    np.testing.assert_array_equal(found.fixes.step, log.fixes.step)
    columns = [(*one.fixes.columns.values(), one.gyro.turn) for one in (log, found) if one.fixes and one.gyro]
    for mine, other in zip(*columns, strict=True):
        np.testing.assert_allclose(other, mine, rtol=0, atol=1e-9)
    for column in ("t", "delta", "delta_cov", "z", "z_cov", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)
    assert len(found.remarks) == len(log.remarks) == 0


def test_positions_and_headings_are_those_of_the_robot(log: Log) -> None:
    assert log.fixes is not None
    true = along(LOOP, OPTIONS.speed, log.t[log.fixes.step])[0]
    placed = np.isfinite(log.fixes.z[:, 0])
    off = log.fixes.z[placed, :2] - true[placed, :2]
    assert np.abs(off).max() < 4.5 * SD + 0.15  # the robot moves up to half a step between
    turned = wrap(log.fixes.z[~placed, 2] - true[~placed, 2])
    assert np.abs(turned).max() < 0.06  # levels turn a field that is 63 degrees steep
    assert log.notes["origin"].startswith("latitude 48.1, longitude 11.5")


def test_without_the_tables_the_log_is_what_it_was(drive: Path, log: Log) -> None:
    text = (drive / "robot.toml").read_text()
    (drive / "robot.toml").write_text(text[: text.index("[gps]")] + text[text.index("[laser]") :])
    alone = of(drive)
    assert alone.fixes is None
    for column in ("t", "delta", "delta_cov", "z", "z_cov", "loop_delta", "loop_cov"):
        np.testing.assert_array_equal(getattr(alone, column), getattr(log, column))


def test_a_start_that_robot_toml_does_not_give_is_that_of_the_fixes(drive: Path) -> None:
    text = (drive / "robot.toml").read_text()
    begin = text.index("[prior]")
    (drive / "robot.toml").write_text(text[:begin] + text[text.index("[topics]" if "[topics]" in text else "[gps]") :])
    found = of(drive)
    off = found.prior.pose - along(LOOP, OPTIONS.speed, found.t[:1])[0][0]
    off[2] = wrap(off[2])
    assert 0.02 < np.sqrt(found.prior.cov[2, 2]) < 1.0
    assert off @ np.linalg.solve(found.prior.cov, off) / 3 < 3


def test_each_sensor_of_a_recording_has_the_fixes(drive: Path, log: Log) -> None:
    for sensor in ("markers", "laser"):
        alone = of(drive, sensors=sensor)
        assert alone.fixes is not None
        assert alone.notes["fixes"]["positions"] >= 20
    only = of(drive, imu=False)
    assert only.notes["fixes"] == {"positions": log.notes["fixes"]["positions"], "headings": 0}


def test_an_origin_elsewhere_is_a_remark(drive: Path, log: Log) -> None:
    assert not any("from the start that [prior] gives" in one for one in log.remarks)
    text = (drive / "robot.toml").read_text()
    assert "48.1" in text
    (drive / "robot.toml").write_text(text.replace("48.1", "48.2"))
    for sensors in ("all", "laser+wheels+gps"):
        said = [one for one in of(drive, sensors=sensors).remarks if "from the start that [prior] gives" in one]
        assert len(said) == 1
        assert "s, is 1.11e+04 m from the start that [prior] gives, and the robot drove" in said[0]
        assert "expected [gps] origin at the place from which [prior] counts" in said[0]


def test_what_is_odd_about_readings_is_told_in_the_log_of_each_sensor(drive: Path) -> None:
    rows = [line.split(",") for line in (drive / "imu.csv").read_text().splitlines()]
    for row in rows[1:]:
        row[-3:] = [str(1e4 * float(one)) if one else "" for one in row[-3:]]
    (drive / "imu.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    for sensors in ("all", "markers+wheels+compass", "laser+wheels+compass"):
        log = of(drive, sensors=sensors)
        assert log.notes.get("fixes", {"headings": 0})["headings"] == 0
        assert sum("T across (median), expected 5e-06 to 4.5e-05 T" in one for one in log.remarks) == 1
    robot = drive / "robot.toml"
    robot.write_text(robot.read_text().replace('magnetometer = "T"', 'magnetometer = "G"'))
    log = of(drive)
    assert log.notes["fixes"]["headings"] >= 8
    assert not log.remarks
    robot.write_text(robot.read_text().replace('magnetometer = "G"\n', ""))
    log = of(drive, sensors="laser+wheels+compass")
    assert log.notes["fixes"]["headings"] >= 7
    assert any("taken to be in G, and converted" in one for one in log.remarks)


def test_what_is_asked_for_and_is_not_there_is_refused(drive: Path) -> None:
    (drive / FILE).unlink()
    refused(r"has no positions, expected .*gps.csv or, in a bag, messages of sensor_msgs/NavSatFix, as", of, drive)
    shutil.copy(drive / "imu.csv", drive / "imu2.csv")
    text = (drive / "robot.toml").read_text()
    (drive / "robot.toml").write_text(text[: text.index("[gps]")] + text[text.index("[compass]") :])
    rows = (drive / "imu.csv").read_text().splitlines()
    (drive / "imu.csv").write_text("\n".join(",".join(row.split(",")[:-3]) for row in rows))
    refused("has no magnetometer, expected mag_x,mag_y,mag_z in imu.csv", of, drive)


FAULTS = {
    "t,lat,lon\n0,48,11\n1,48,x": "line 3: lon is 'x', expected a number",
    "t,lat,lon\n0,148,11": "line 2: lat is 148.0, expected -90 to 90 degrees; perhaps latitude and longi",
    "t,lat,lon\n0,48,500": "line 2: lon is 500.0, expected -360 to 360",
    "t,lat,lon\n1,48,11\n1,48,11": "line 3: t is 1.0, expected later than 1.0",
    "t,lat,lon,sd\n1,48,11,0": "line 2: sd is 0.0, expected a standard deviation above 0, m",
    "t,lat,lon\n1,,\n2,,": "none of its 2 rows has a position, expected lat and lon in degrees",
    "t,latitude,lon\n1,2,3": "line 1: ",
}


@pytest.mark.parametrize("text", FAULTS)
def test_faults_in_a_file_name_their_line(text: str, tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(text)
    refused_at(tmp_path / FILE, FAULTS[text], read_gps_csv, tmp_path / FILE, [])


def test_rows_without_a_position_are_left_out(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("t,lat,lon\n0,48,11\n1,,\n2,48,11.0001\n")
    remarks = list[str]()
    found = read_gps_csv(tmp_path / FILE, remarks)
    np.testing.assert_array_equal(found.t, [0, 2])
    assert remarks[0].endswith("1 of 3 rows have no position, and are left out")
    notes = dict[str, Any]()
    refused("nothing says how sure its positions are, expected a column sd", measured, found, GpsTable(), notes, [])
    made = measured(found, GpsTable(sd=2.0, time_offset=0.5), notes, remarks)
    np.testing.assert_array_equal(made.t, [0.5, 2.5])
    np.testing.assert_array_equal(made.cov[0, :2, :2], 4 * np.eye(2))
    assert "[gps] origin in robot.toml states another" in remarks[1]


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    rows = [f"{k / 5},{48 + k / 1e5},11.5,0.5" for k in range(8)]
    (tmp_path / FILE).write_text("\n".join(("t,lat,lon,sd", *rows)) + "\n")
    found, sentences = survivors(lambda path: read_gps_csv(path, []), tmp_path / FILE, 200, 0)
    assert len(found) > 10
    assert len(sentences) > 10
    assert all((np.diff(one.t) > 0).all() and (np.abs(one.degrees[:, 0]) <= 90).all() for one in found)


def sent(tmp_path: Path, *changes: dict[str, Any]) -> Bag:
    """A bag with a message for each of the changes."""
    said = list[bags.Said]()
    for k, one in enumerate(changes):
        whole: dict[str, Any] = {"latitude": 48 + k / 1e5, "longitude": 11.5, **one}
        said.append(bags.navsat(10**9 * (k + 1), **whole))
    return Bag(bags.write(tmp_path, "ros2", said))


def read(bag: Bag, table: GpsTable | None = None) -> tuple[Any, list[str]]:
    remarks = list[str]()
    return read_gps_messages(bag, bag.listed(), table or GpsTable(), remarks), remarks


def test_messages_without_a_fix_are_left_out(tmp_path: Path) -> None:
    found, remarks = read(sent(tmp_path, {}, {"status": -1}, {}, {"latitude": np.nan}, {}, {"latitude": 111.0}, {}))
    np.testing.assert_array_equal(found.t, [1, 3, 5, 7])
    assert "3 of 7 messages of topic /fix cannot be used and are left out" in remarks[0]
    assert "the first, message 2, at 2 s, has no fix by its status" in remarks[0]


def test_a_receiver_that_never_has_a_fix_is_refused(tmp_path: Path) -> None:
    bag = sent(tmp_path, *3 * [{"status": -1}])
    refused("3 of 3 messages of topic /fix cannot be used, expected most of them to be sound", read, bag)


def test_swapped_degrees_in_messages_are_refused(tmp_path: Path) -> None:
    bag = sent(tmp_path, *3 * [{"latitude": 120.0, "longitude": 35.0}])
    refused(
        "latitude 120.0 and longitude 35.0, expected at most 90 and 360 degrees; perhaps they are swapped", read, bag
    )


def test_a_covariance_of_zero_is_refused_and_one_that_is_unknown_needs_sd(tmp_path: Path) -> None:
    (tmp_path / "zero").mkdir()
    bag = sent(tmp_path / "zero", {}, {"cov": (0.0, 0.0, 0.0)})
    refused(
        r"1 of 2 messages have a covariance that is none, the first, at 2 s, \[0.0, 0.0, 0.0, 0.0\] m\^2", read, bag
    )
    found, _ = read(bag, GpsTable(sd=1.5))
    assert found.cov is None
    found, _ = read(sent(tmp_path, *2 * [{"kind": 0}]))
    refused("nothing says how sure its positions are", measured, found, GpsTable(), {}, [])


def test_a_covariance_of_east_and_north_is_kept(tmp_path: Path) -> None:
    found, _ = read(sent(tmp_path, *2 * [{"cov": (1.0, 0.5, 4.0)}]))
    np.testing.assert_array_equal(found.cov[1], [[1.0, 0.5], [0.5, 4.0]])


TABLES = {
    "[gps]\norigin = [91, 0]": "latitude and longitude, degrees",
    "[gps]\nsd = 0": "sd",
    "[gps]\ncolour = 1": "colour",
    "[compass]\ndeclination = 10": "radians from -pi to pi",
    "[compass]\nevery = 0": "every",
    "[compass]\noffset_sd = -1": "offset_sd",
}


@pytest.mark.parametrize("text", TABLES)
def test_faults_in_the_tables_name_their_key(text: str, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(text)
    refused(TABLES[text], world_in, TomlTable.read(tmp_path / "robot.toml"))


@pytest.mark.parametrize("seed", range(8))
def test_degrees_that_are_exchanged_far_from_a_stated_origin_are_said(seed: int) -> None:
    rng = np.random.default_rng(seed)
    origin = np.array([rng.uniform(-60, 60), rng.uniform(-80, 80)])
    found = degrees(rng.uniform(-200, 200, (30, 2)), origin)
    assert exchanged("gps.csv", found, origin) == []
    assert exchanged("gps.csv", found + np.array([3.0, 0.0]), origin) == []  # of another town
    (said,) = exchanged("gps.csv", found[:, ::-1], origin)
    assert said.startswith("gps.csv: latitude and longitude are swapped: the positions are ")
