"""Inertial readings of recordings: the same from a folder and every kind of bag, and what is odd about them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
from inertial_drives import FIELD, Drive, drive
from refusals import refusal
from slamduel.core.factors import Log, Prior
from slamduel.core.se2 import Array
from slamduel.core.toml.table import TomlTable
from slamduel.datasets.inertial.open import NOTE, OpenedImu, beside, open_imu
from slamduel.datasets.inertial.robot import ImuTable, imu_in
from slamduel.frontend.camera.quaternions import matrix
from slamduel.frontend.inertial.imu import GRAVITY, Imu
from slamduel.frontend.inertial.standing import Readings
from slamduel.frontend.inertial.tilts import unlevelled
from slamduel.frontend.inertial.turns import integrated
from slamduel.frontend.wheels.track import Track, TrackNoise
from tiers import first_quick

NS = 10**9
BEGIN = 100  # s
SIDEWAYS = (0.5, 0.5, 0.5, 0.5)
"""The quaternion of a unit whose x looks to the left, y up and z ahead."""


@cache
def short() -> Drive:
    """A drive of 20 s, half of it at rest; its magnetometer is read at every fifth reading."""
    one = drive(0, 20.0, 50.0)
    imu = one.imu
    assert imu.mag is not None
    mag = np.where((np.arange(len(imu)) % 5 == 0)[:, None], imu.mag, np.nan)
    return one._replace(imu=replace(imu, mag=mag))


def stamps(t: Array) -> list[int]:
    return [BEGIN * NS + round(one * NS) for one in t.tolist()]


def messages(imu: Imu, turn: Array | None = None, **changes: Any) -> list[bags.Said]:
    """Messages of readings whose unit has the axes `turn` (3, 3) on the robot."""
    turn = np.eye(3) if turn is None else turn
    assert imu.accel is not None
    said = [
        bags.imu(stamp, gyro, accel, **changes)
        for stamp, gyro, accel in zip(stamps(imu.t), imu.gyro @ turn, imu.accel @ turn, strict=True)
    ]
    if imu.mag is not None:
        rows = np.flatnonzero(np.isfinite(imu.mag[:, 0]))
        fields = (imu.mag @ turn)[rows]
        said += [bags.magnetic(stamp, field) for stamp, field in zip(stamps(imu.t[rows]), fields, strict=True)]
    return sorted(said, key=lambda one: one.stamp)


def written(path: Path, imu: Imu, header: str = "", **scale: float) -> Path:
    """imu.csv, its columns times `scale`."""
    columns, names = [imu.t + BEGIN], ["t"]
    for name, values in (("gyro", imu.gyro), ("accel", imu.accel), ("mag", imu.mag)):
        if values is not None:
            columns += list(values.T * scale.get(name, 1.0))
            names += [f"{name}_{axis}" for axis in "xyz"]
    rows = [",".join("" if np.isnan(one) else repr(one) for one in row) for row in np.column_stack(columns).tolist()]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header or ",".join(names), *rows, ""]))
    return path


def opened(
    recording: Path, table: ImuTable | None = None, odometry: Readings | None = None, home: Path | None = None
) -> tuple[OpenedImu, list[str], str]:
    """The readings, the remarks and the note."""
    notes, remarks = dict[str, Any](), list[str]()
    found = open_imu(recording, home or recording.parent, table, odometry, notes, remarks)
    assert found is not None, notes
    return found, remarks, notes[NOTE]


def of_csv(path: Path, **given: Any) -> tuple[OpenedImu, list[str], str]:
    """The readings of an imu.csv that `written` writes, with the `table` that is given."""
    table, odometry = given.pop("table", None), given.pop("odometry", None)
    return opened(written(path, **given).parent, table, odometry, path.parent)


def refused(path: Path, table: ImuTable | None = None) -> str:
    return refusal(open_imu, path, path, table or ImuTable(), None, {}, [])


@cache
def expected() -> tuple[Array, Array, Array, Array]:
    one = short().imu
    assert one.accel is not None
    assert one.mag is not None
    return one.t + BEGIN, one.gyro, one.accel, one.mag


def check_same(found: Imu) -> None:
    for one, other in zip((found.t, found.gyro, found.accel, found.mag), expected(), strict=True):
        assert one is not None
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def test_a_folder_has_the_readings(tmp_path: Path) -> None:
    found, remarks, note = of_csv(tmp_path / "imu.csv", imu=short().imu)
    check_same(found.imu)
    assert remarks == []
    assert note.startswith("gyro, accelerometer, magnetometer at 50 Hz for 19.98 s; no gap; its axes are taken to be")
    assert "the robot stands in " in note
    assert "degrees/s" in note


@pytest.mark.parametrize("kind", first_quick(bags.KINDS, 2))
def test_every_kind_of_bag_has_the_same_readings(kind: str, tmp_path: Path) -> None:
    turn = matrix(np.array([0.0, 0.0, 0.0, *SIDEWAYS]))[:3, :3]
    placed = bags.transforms(
        BEGIN * NS, bags.Transform("base_link", "imu", (0.1, 0, 0.2), SIDEWAYS), topic="/tf_static"
    )
    found, remarks, note = opened(bags.write(tmp_path, kind, [placed, *messages(short().imu, turn)]))
    check_same(found.imu)
    assert remarks == []
    assert "mounted as tf has imu" in note
    np.testing.assert_allclose(found.imu.arm, [0.1, 0, 0.2])


def test_robot_toml_says_how_a_unit_is_mounted(tmp_path: Path) -> None:
    one = short().imu
    (tmp_path / "robot.toml").write_text("[imu]\nmounting = {xyz = [0, 0, 0.2], rpy = [3.14159265358979, 0, 1.5]}\n")
    table = imu_in(TomlTable.read(tmp_path / "robot.toml"))
    assert table is not None
    c, s = np.cos(1.5), np.sin(1.5)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.diag([1.0, -1.0, -1.0])
    assert one.accel is not None
    found, remarks, note = of_csv(tmp_path / "imu.csv", imu=Imu(one.t, one.gyro @ turn, one.accel @ turn), table=table)
    np.testing.assert_allclose(found.imu.gyro, one.gyro, atol=1e-9)
    assert remarks == []
    assert "mounted as robot.toml says" in note


def test_a_unit_of_which_nothing_is_said_is_upside_down_by_gravity(tmp_path: Path) -> None:
    one, turn = short().imu, np.diag([1.0, -1.0, -1.0])
    assert one.accel is not None
    found, (remark,), note = of_csv(tmp_path / "imu.csv", imu=Imu(one.t, one.gyro @ turn, one.accel @ turn))
    assert "nothing says how it is mounted: taken to be upside down, and turned back; [imu] mounting" in remark
    assert "upside down by gravity" in note
    np.testing.assert_allclose(found.imu.gyro[:, 2], one.gyro[:, 2], atol=0.1)
    _, (remark,), _ = of_csv(
        tmp_path / "b" / "imu.csv",
        imu=Imu(one.t, one.gyro, -one.accel),
        table=ImuTable(mounting=np.eye(4)),
    )
    assert "perhaps the mounting is another, or the accelerometer's sign" in remark


def test_tf_and_robot_toml_that_differ_are_a_remark(tmp_path: Path) -> None:
    placed = bags.transforms(BEGIN * NS, bags.Transform("base_link", "imu", (0, 0, 0), SIDEWAYS), topic="/tf_static")
    bag = bags.write(tmp_path, "ros2", [placed, *messages(short().imu)])
    _, (remark,), _ = opened(bag, ImuTable(mounting=np.eye(4)))
    assert "is turned by 120 degrees from where tf has imu" in remark


UNITS: dict[str, tuple[dict[str, float], ImuTable, str]] = {
    "g": ({"accel": 1 / GRAVITY}, ImuTable(), "taken to be in g, and converted"),
    "degrees": ({"gyro": 180 / np.pi}, ImuTable(), "taken to be in degrees/s, and converted"),
    "microtesla": ({"mag": 1e6}, ImuTable(), "taken to be in uT, and converted"),
    "said": ({"accel": 1 / GRAVITY, "gyro": 180 / np.pi}, ImuTable(gyro="deg/s", accelerometer="g"), ""),
}


@pytest.mark.parametrize("case", UNITS)
def test_units_are_found_or_said(case: str, tmp_path: Path) -> None:
    scale, table, words = UNITS[case]
    found, remarks, _ = of_csv(tmp_path / "imu.csv", imu=short().imu, table=table, **scale)
    check_same(found.imu)
    assert len(remarks) == bool(words)
    assert all(words in remark for remark in remarks)


@pytest.mark.parametrize(
    ("said", "factor", "words"),
    [
        ("m/s^2", 1 / GRAVITY, "perhaps it is in g, and not in m/s^2 as [imu] accelerometer in robot.toml says"),
        ("g", 1.0, "perhaps it is in m/s^2, and not in g as [imu] accelerometer in robot.toml says"),
        ("mg", 1 / GRAVITY, "perhaps it is in g, and not in mg as [imu] accelerometer in robot.toml says"),
        ("m/s^2", 0.0, "perhaps gravity was taken off"),
        ("m/s^2", 0.5, "perhaps its unit is another"),
    ],
)
def test_an_accelerometer_in_another_unit_than_is_said(said: str, factor: float, words: str, tmp_path: Path) -> None:
    found, (remark,), _ = of_csv(
        tmp_path / "imu.csv", imu=changed(lambda imu: imu), table=ImuTable(accelerometer=said), accel=factor
    )
    assert found.imu.accel is None
    assert remark.endswith(f"{words}; it is not used")


def test_a_header_says_units(tmp_path: Path) -> None:
    rates = ",".join(f"w_RS_S_{axis} [deg s^-1]" for axis in "xyz")
    header = f"#timestamp [ms],{rates},ax_g,ay_g,az_g,mx(uT),my(uT),mz(uT)"
    one = short().imu
    late = replace(one, t=(one.t + BEGIN) * 1e3 - BEGIN)
    scale = {"gyro": 180 / np.pi, "accel": 1 / GRAVITY, "mag": 1e6}
    found, remarks, _ = of_csv(tmp_path / "imu.csv", imu=late, header=header, **scale)
    check_same(found.imu)
    assert remarks == []


def test_a_slow_robots_degrees_are_found_by_its_wheels(tmp_path: Path) -> None:
    one = drive(1, 60.0, 50.0, hills=0.0)
    slow = one._replace(imu=Imu(one.t, one.imu.gyro / 10), heading=one.heading / 10)
    wheels = slow.odometry._replace(t=one.t + BEGIN)
    found, remarks, _ = of_csv(tmp_path / "imu.csv", imu=slow.imu, odometry=wheels, gyro=180 / np.pi)
    np.testing.assert_allclose(found.imu.gyro, slow.imu.gyro, atol=1e-9)
    assert any("for each that the odometry turns, expected 1: taken to be in degrees/s" in one for one in remarks)
    _, remarks, _ = of_csv(tmp_path / "imu.csv", imu=slow.imu, odometry=wheels, gyro=-1.0)
    assert any("expected 1: its axes are turned, as upside down" in one for one in remarks)
    _, remarks, _ = of_csv(tmp_path / "imu.csv", imu=slow.imu, odometry=wheels)
    assert remarks == []


@pytest.mark.parametrize(
    ("said", "factor", "words"),
    [
        ("rad/s", 180 / np.pi, "perhaps it is in deg/s, and not in rad/s as [imu] gyro in robot.toml says"),
        ("deg/s", 1.0, "perhaps it is in rad/s, and not in deg/s as [imu] gyro in robot.toml says"),
        ("header", 180 / np.pi, "perhaps it is in deg/s, and not in rad/s as the header says"),
    ],
)
def test_a_gyro_in_another_unit_than_is_said_has_no_turns_and_levels_nothing(
    said: str, factor: float, words: str, tmp_path: Path
) -> None:
    one = drive(1, 60.0, 50.0, hills=0.0)
    imu = replace(one.imu, mag=None)
    wheels = one.odometry._replace(t=one.t + BEGIN)
    rates = ",".join(f"gyro_{axis} [rad/s]" for axis in "xyz")
    header = f"t,{rates},ax,ay,az" if said == "header" else ""
    table = ImuTable(gyro=None if said == "header" else said, mounting=np.eye(4))
    given = {"imu": imu, "odometry": wheels, "table": table, "header": header}
    found, (remark,), _ = of_csv(tmp_path / "imu.csv", **given, gyro=factor)
    assert words in remark
    assert remark.endswith("; its turns are not in the log")
    assert unlevelled(found.imu, Track(*wheels, TrackNoise())) == "the gyro's turns are not those of the odometry"
    at = np.arange(BEGIN + 1.0, BEGIN + 50.0)
    log = log_of(at)
    assert beside(log, found) is log
    right = 1.0 if said != "deg/s" else 180 / np.pi
    fine, remarks, _ = of_csv(tmp_path / "fine" / "imu.csv", **given, gyro=right)
    assert remarks == []
    assert unlevelled(fine.imu, Track(*wheels, TrackNoise())) == ""
    assert beside(log, fine).gyro is not None
    turned, (remark,), _ = of_csv(tmp_path / "turned" / "imu.csv", **given, gyro=-right)
    assert "its axes are turned, as upside down" in remark
    assert unlevelled(turned.imu, Track(*wheels, TrackNoise())) == "the gyro's turns are not those of the odometry"


def test_odometry_that_is_made_of_the_gyro_does_not_count_it_twice(tmp_path: Path) -> None:
    one = drive(1, 60.0, 50.0, hills=0.0)
    imu = Imu(one.t, one.imu.gyro)
    heading = integrated(imu.t, imu.gyro[:, 2], imu.t)
    fused = one.odometry._replace(t=one.t + BEGIN, poses=np.column_stack((one.odometry.poses[:, :2], heading)))
    found, (remark,), _ = of_csv(tmp_path / "imu.csv", imu=imu, odometry=fused)
    assert found.twice
    assert "made of this gyro's readings" in remark
    wheels = one.odometry._replace(t=one.t + BEGIN)
    assert not of_csv(tmp_path / "imu.csv", imu=imu, odometry=wheels)[0].twice  # as good as wheels can be


def log_of(at: Array) -> Log:
    """A log of a robot that stands still, with steps at the times `at`."""
    delta = np.concatenate((np.full((1, 3), np.nan), np.zeros((len(at) - 1, 3))))
    none, cov = np.zeros(0, np.int64), np.full((len(at), 3, 3), 1e-4) * np.eye(3)
    prior = Prior(np.zeros(3), 1e-6 * np.eye(3))
    return Log.from_arrays("drive", prior, at, delta, cov, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)))


@pytest.mark.parametrize("since", [BEGIN - 1000.0, BEGIN + 1000.0])
def test_readings_of_another_time_than_the_steps_are_told_with_both_times(since: float, tmp_path: Path) -> None:
    found, remarks, _ = of_csv(tmp_path / "imu.csv", imu=changed(lambda imu: imu))
    assert remarks == []
    log = beside(log_of(np.arange(since, since + 10.5, 0.5)), found)
    assert log.gyro is None
    (remark,) = log.remarks
    assert (
        "no turn between two steps is known by the gyro, as the times do not overlap: its readings are of 100 to "
        f"119.98 s, the log's steps of {since:g} to {since + 10:g} s; [imu] time_offset in robot.toml "
        "(up to 10 s) moves them"
    ) in remark
    track = Track(np.array([since, since + 10.0]), np.zeros((2, 3)), TrackNoise())
    words = f"100 to 119.98 s, and those of the odometry, {since:g} to {since + 10:g} s, have less than 1 s in common"
    assert unlevelled(found.imu, track).startswith("neither")
    assert unlevelled(replace(found.imu, placed=True), track) == f"its times, {words}"
    assert beside(log_of(np.arange(BEGIN, BEGIN + 9.5, 0.5)), found).gyro is not None


def changed(change: Callable[[Imu], Imu]) -> Imu:
    return change(replace(short().imu, mag=None))


def at_rows(rows: Sequence[int] | slice, imu: Imu) -> Imu:
    assert imu.accel is not None
    kept = np.arange(len(imu))[rows]
    return Imu(imu.t[kept], imu.gyro[kept], imu.accel[kept])


def saturated(imu: Imu) -> Imu:
    return replace(imu, gyro=np.clip(imu.gyro, -0.2, 0.2))


def without_gravity(imu: Imu) -> Imu:
    assert imu.accel is not None
    return replace(imu, accel=imu.accel - np.array([0, 0, GRAVITY]))


ODD: dict[str, tuple[Callable[[Imu], Imu], str]] = {
    "2 Hz": (partial(at_rows, slice(None, None, 25)), "comes at 2 Hz (median), expected at least 10"),
    "gap": (partial(at_rows, [*range(400), *range(650, 1000)]), "no reading for 5.02 s, from 107.98 to 113 s"),
    "saturated": (saturated, "readings of the gyro are at the end of its range (0.2 rad/s)"),
    "no gravity": (without_gravity, "perhaps gravity was taken off; it is not used"),
}


@pytest.mark.parametrize("case", ODD)
def test_what_is_odd_is_a_remark(case: str, tmp_path: Path) -> None:
    change, words = ODD[case]
    found, remarks, _ = of_csv(tmp_path / "imu.csv", imu=changed(change))
    assert any(words in remark for remark in remarks), remarks
    if case == "saturated":
        assert found.imu.clipped is not None
        gyro = changed(lambda imu: imu).gyro
        assert found.imu.clipped.sum() == (np.abs(gyro) > 0.2).any(axis=1).sum()


BAD: dict[str, tuple[str, str]] = {
    "no time": ("gyro_x,gyro_y,gyro_z\n1,2,3\n", "line 1: has no column of the time"),
    "no gyro": ("t,ax,ay,az\n1,2,3,4\n", "line 1: has no gyro"),
    "two axes": ("t,gx,gy\n0,1,2\n", "line 1: found no gyro_z, expected three axes of the gyro"),
    "twice": ("t,gx,wx,gy,gz\n", "found the columns gx and wx, expected one of them"),
    "no header": ("1,2,3,4\n2,3,4,5\n", "line 1: found numbers, expected a header such as t,gyro_x"),
    "unit": ("t,gx [Hz],gy [Hz],gz [Hz]\n", "gx [Hz] has the unit 'Hz', expected one of rad/s, deg/s"),
    "units": (
        "t,gx [rad/s],gy [deg/s],gz [deg/s]\n1,2,3,4\n2,3,4,5\n",
        "the axes of the gyro have the units deg/s and",
    ),
    "backwards": ("t,gx,gy,gz\n1,0,0,0\n1,0,0,1\n", "line 3: t is 1.0, expected later than 1.0"),
    "no number": ("t,gx,gy,gz\n1,0,0,x\n2,0,0,0\n", "line 2: gz is 'x', expected a number"),
    "blank": ("t,gx,gy,gz\n1,0,0,0\n2,0,,0\n", "line 3: gy is blank, expected a number"),
    "short": ("t,gx,gy,gz\n1,0,0,0\n2,0,0\n", "line 3: found 3 columns, expected 4"),
    "one row": ("t,gx,gy,gz\n1,0,0,0\n", "found 1 rows, expected at least 2"),
    "milliseconds": ("t,gx,gy,gz\n10,0,0,0\n20,0,0,0\n30,0,0,0\n", "expected at most 5: perhaps it is in milliseconds"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_refused_where_it_is_asked_for(case: str, tmp_path: Path) -> None:
    content, words = BAD[case]
    (tmp_path / "imu.csv").write_text(content)
    assert words in refused(tmp_path)
    notes, remarks = dict[str, Any](), list[str]()
    assert open_imu(tmp_path, tmp_path, None, None, notes, remarks) is None
    assert notes[NOTE].startswith("not used: ")
    assert words in notes[NOTE]
    assert remarks == [f"the inertial readings are {notes[NOTE]}"]


def test_a_file_without_a_header_has_its_columns_in_robot_toml(tmp_path: Path) -> None:
    path = written(tmp_path / "imu.csv", short().imu)
    path.write_text(path.read_text().split("\n", 1)[1])
    names = ("t", *(f"{sensor}{axis}" for sensor in "gam" for axis in "xyz"))
    found, _, _ = opened(tmp_path, ImuTable(columns=names), home=tmp_path)
    check_same(found.imu)


def test_a_part_that_a_message_does_not_give_is_not_read(tmp_path: Path) -> None:
    bag = bags.write(tmp_path, "ros2", messages(changed(lambda imu: imu), linear_acceleration=-1.0))
    found, _, note = opened(bag)
    assert found.imu.accel is None
    assert note.startswith("gyro at 50 Hz")
    (tmp_path / "b").mkdir()
    bag = bags.write(tmp_path / "b", "ros1", messages(short().imu, angular_velocity=-1.0))
    assert "say that they have no angular velocity" in refusal(open_imu, bag, bag.parent, ImuTable(), None, {}, [])


def test_a_message_without_a_time_has_that_of_its_reception(tmp_path: Path) -> None:
    whole = messages(changed(lambda imu: imu))
    found, _, _ = opened(bags.write(tmp_path, "mcap", [one._replace(stamp=0, received=one.stamp) for one in whole]))
    np.testing.assert_allclose(found.imu.t, short().t + BEGIN, atol=1e-9)


def test_of_several_topics_one_has_to_be_named(tmp_path: Path) -> None:
    one = changed(lambda imu: imu)
    both = sorted((*messages(one), *messages(one, topic="/raw")), key=lambda said: said.stamp)
    bag = bags.write(tmp_path, "ros2", both)
    words = "/imu (sensor_msgs/Imu, 1000 messages), /raw (sensor_msgs/Imu, 1000 messages), expected [imu] topic"
    notes = dict[str, Any]()
    assert open_imu(bag, tmp_path, None, None, notes, []) is None
    assert words in notes[NOTE]
    assert words in refusal(open_imu, bag, tmp_path, ImuTable(), None, {}, [])
    found, _, _ = opened(bag, ImuTable(topic="/raw"))
    assert len(found.imu) == 1000


def test_a_recording_without_readings_is_as_it_was(tmp_path: Path) -> None:
    notes, remarks = dict[str, Any](), list[str]()
    assert open_imu(tmp_path, tmp_path, None, None, notes, remarks) is None
    assert (notes, remarks) == ({}, [])
    assert "has no inertial readings, expected" in refused(tmp_path)


def test_the_field_is_that_of_the_world(tmp_path: Path) -> None:
    found, _, _ = of_csv(tmp_path / "imu.csv", imu=short().imu)
    assert found.imu.mag is not None
    size = np.linalg.norm(found.imu.mag[::5], axis=1)
    np.testing.assert_allclose(size, np.linalg.norm(FIELD), rtol=1e-9)
