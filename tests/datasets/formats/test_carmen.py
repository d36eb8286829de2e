"""CARMEN's laser logs: the same scans however they are written, real logs, and what cannot be used."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carmen_files import flaser, robotlaser, written
from recorded import at_hand
from refusals import refused, refused_at
from slamduel.bench.plan.load import load
from slamduel.core.se2 import Array
from slamduel.datasets.formats.carmen import Options, read
from slamduel.datasets.worlds import laser_floor
from slamduel.frontend.laser.recording import LaserRecording


@pytest.fixture(scope="module")
def drive() -> LaserRecording:
    recording, _ = laser_floor.record(laser_floor.Options(laps=0.15, people=0), np.random.default_rng(0))
    return recording


def test_the_same_scans_give_the_same_factors_however_they_are_written(drive: LaserRecording, tmp_path: Path) -> None:
    plain, _ = load(str(written(tmp_path / "floor.clf", drive)))
    for path in (written(tmp_path / "again.clf.gz", drive), written(tmp_path / "robot.clf", drive, robotlaser)):
        other, truth = load(str(path))
        assert truth is None or truth.kind == "reference"
        assert (other.t == plain.t).all()
        assert np.nanmax(np.abs(other.delta - plain.delta)) < 1e-9
        assert np.nanmax(np.abs(other.delta_cov - plain.delta_cov)) < 1e-12
    assert len(plain) > 15
    assert plain.name == "floor"


def test_lines_in_any_order_and_scans_twice(drive: LaserRecording, tmp_path: Path) -> None:
    path = written(tmp_path / "floor.clf", drive)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], *lines[:1:-1], lines[5]]))
    recording, remarks = read(path, Options())
    assert np.abs(recording.t - drive.t).max() < 1e-9
    assert np.abs(recording.ranges - drive.ranges).max() < 1e-9
    assert remarks == [f"1 of {len(drive.t) + 1} scans have the stamp of another one and are left out"]


def raw(t: float, ranges: Array) -> str:
    words = " ".join(f"{r:.2f}" for r in ranges)
    step = np.pi / (len(ranges) - 1)
    return f"RAWLASER1 0 {-np.pi / 2:.17g} 3.14 {step:.17g} 81.9 0.01 0 {len(ranges)} {words} 1 7 {t:.9f} host {t:.9f}"


def odom(t: float, pose: Array) -> str:
    return f"ODOM {' '.join(f'{x:.17g}' for x in pose)} 0.5 0.1 0 {t:.9f} host {t:.9f}"


@pytest.mark.parametrize("stamped", [True, False], ids=["by time", "by row"])
def test_raw_scans_have_the_odometry_around_them(stamped: bool, drive: LaserRecording, tmp_path: Path) -> None:
    """Between two rows of ODOM, in the middle of their motion; the drive is the same as with the wheels in each row."""
    assert drive.odometry is not None
    t, poses = drive.t, drive.odometry.copy()
    poses[:, 2] = np.where(np.abs(poses[:, 2]) > 3, poses[:, 2] + 2 * np.pi, poses[:, 2])  # over the turn of the circle
    rows = list[tuple[float, str]]()
    for k in range(len(t)):
        rows.append((t[k], raw(t[k] * stamped, drive.ranges[k])))
        if stamped and k + 1 < len(t):
            rows.append(((t[k] + t[k + 1]) / 2, odom((t[k] + t[k + 1]) / 2, (poses[k] + poses[k + 1]) / 2)))
        if not stamped:
            rows.append((t[k] - 0.01, odom(0.0, poses[k])))
    text = "\n".join(row for _, row in sorted(rows, key=lambda one: one[0]))
    (tmp_path / "raw.clf").write_text(f"PARAM a b\n{text}\nSYNC end\n")
    recording, remarks = read(tmp_path / "raw.clf", Options())
    assert recording.odometry is not None
    if stamped:
        assert remarks == [f"2 of {len(t)} scans have no odometry within 1 s around them and are left out"]
        np.testing.assert_allclose(recording.t, t[1:-1], atol=1e-9)
        assert np.hypot(*(recording.odometry - drive.odometry[1:-1])[:, :2].T).max() < 0.05
    else:
        np.testing.assert_array_equal(recording.odometry[:, :2], drive.odometry[:, :2])
        assert "time stamps are of no use" in remarks[0]
    log, _ = load(str(tmp_path / "raw.clf"))
    whole, _ = load(str(written(tmp_path / "whole.clf", drive, robotlaser)))
    ways = [np.hypot(*one.delta[1:, :2].T).sum() for one in (log, whole)]
    assert abs(ways[0] - ways[1]) < 0.05 * ways[1]


def test_raw_scans_count_only_where_there_are_no_others(drive: LaserRecording, tmp_path: Path) -> None:
    path = written(tmp_path / "floor.clf", drive)
    expected, _ = read(path, Options())
    between = [odom(0.0, np.zeros(3)), raw(0.0, np.ones(5)), "ODOM is not a number", "RAWLASER1 x"]
    path.write_text("\n".join([*between, *path.read_text().splitlines(), *between]))
    recording, remarks = read(path, Options())
    np.testing.assert_array_equal(recording.ranges, expected.ranges)
    assert not remarks
    alone = tmp_path / "alone.clf"
    alone.write_text("\n".join(raw(t, ranges) for t, ranges in zip(drive.t.tolist(), drive.ranges, strict=True)))
    recording, remarks = read(alone, Options())
    assert recording.odometry is None
    assert remarks == ["its odometry never moves: the front end goes by the scans alone"]


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("ODOM 1 2 x 0 0 0 0.0 host 0.0", "line 1: found 'x' in the odometry, expected a number"),
        ("ODOM 1 2 3 0 0 0", "line 1: the line ends after 7 words, expected 8 for the time"),
        (
            "RAWLASER1 0 0 3 0.1 8 0 0 2 1.0 1.0 3 1 1 1",
            "line 1: the line ends after 15 words, expected 16 for the time",
        ),
    ],
)
def test_faults_of_raw_rows_are_named(row: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "raw.clf"
    path.write_text("\n".join([row, raw(0.0, np.ones(5)), raw(1.0, np.ones(5)), odom(0.5, np.ones(3))]))
    refused_at(path, words, read, path, Options())


def test_wheels_that_never_move_are_none(drive: LaserRecording, tmp_path: Path) -> None:
    path = tmp_path / "still.clf"
    path.write_text("\n".join(flaser(t, r, np.zeros(3)) for t, r in zip(drive.t.tolist(), drive.ranges, strict=True)))
    recording, remarks = read(path, Options())
    assert recording.odometry is None
    assert remarks == ["its odometry never moves: the front end goes by the scans alone"]
    refused("odometry=wheels: the odometry never moves, expected odometry=none", read, path, Options(odometry="wheels"))


@pytest.mark.parametrize("stamp", [lambda t: 0.0, lambda t: float(f"{1.01893e9 + t:.6g}")], ids=["zero", "rounded"])
def test_where_stamps_are_alike_the_order_of_rows_is_that_of_time(
    stamp: Callable[[float], float], drive: LaserRecording, tmp_path: Path
) -> None:
    assert drive.odometry is not None
    rows = zip(drive.t.tolist(), drive.ranges, drive.odometry, strict=True)
    lines = [flaser(stamp(t), ranges, wheels) for t, ranges, wheels in rows]
    (tmp_path / "floor.clf").write_text("\n".join([*lines, lines[-1]]))
    recording, remarks = read(tmp_path / "floor.clf", Options())
    assert np.abs(recording.ranges - drive.ranges).max() < 1e-9
    assert recording.odometry is not None
    assert np.abs(recording.odometry - drive.odometry).max() < 1e-9
    assert recording.t.tolist() == list(range(len(drive.t)))
    (remark,) = remarks
    assert remark.startswith(f"its time stamps are of no use, 1 different for {len(lines) + 1} scans: scans are taken")


def test_sparse_scans_need_the_wheels(drive: LaserRecording, tmp_path: Path) -> None:
    path = written(tmp_path / "floor.clf", drive)
    path.write_text("\n".join(path.read_text().splitlines()[::8]))
    refused(r"the robot moves 0\.\d+ m from scan to scan .*at most 0\.4 m", read, path, Options(odometry="none"))
    assert read(path, Options())[0].odometry is not None


def spoilt(change: Callable[[list[str]], object]) -> Callable[[list[str]], list[str]]:
    def made(lines: list[str]) -> list[str]:
        words = lines[7].split()
        change(words)
        return [*lines[:7], " ".join(words), *lines[8:]]

    return made


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: lines[:1], "found 0 scans (FLASER or ROBOTLASER1 or RAWLASER1), expected at least 2"),
        (spoilt(lambda w: w.__setitem__(1, "x")), "line 8: found 'x' as the number of beams, expected 0 to 10000"),
        (spoilt(lambda w: w.__setitem__(1, "99999")), "line 8: found '99999' as the number of beams, expected 0 to"),
        (spoilt(lambda w: w.__setitem__(9, "1,5")), "line 8: found '1,5' in ranges, expected a number"),
        (spoilt(lambda w: w.__delitem__(slice(-5, None))), "line 8: the line ends after"),
        (spoilt(lambda w: w.__setitem__(-3, "nan")), "line 8: found 'nan' in the time, expected a finite number"),
        (spoilt(lambda w: w.__setitem__(-4, "inf")), "line 8: found 'inf' in the odometry, expected a finite number"),
        (lambda lines: [*lines, flaser(99.0, np.ones(181), np.array([1e6, 0, 0]))], "m from the scan before, expected"),
        (
            lambda lines: [re.sub(r"(?<= )\d+\.\d\d(?= )", "2500.0", line) for line in lines],
            "no range is between 0.15 and 25 m, expected metres",
        ),
    ],
)
def test_what_cannot_be_used_is_named(change: Any, words: str, drive: LaserRecording, tmp_path: Path) -> None:
    path = written(tmp_path / "floor.clf", drive)
    path.write_text("\n".join(change(path.read_text().splitlines())))
    refused_at(path, words, read, path, Options())


def test_a_file_that_is_cut_off_or_missing_is_named(drive: LaserRecording, tmp_path: Path) -> None:
    path = written(tmp_path / "floor.clf.gz", drive)
    path.write_bytes(path.read_bytes()[:20_000])
    refused("expected a whole gzip file", read, path, Options())
    (tmp_path / "plain.clf.gz").write_text("FLASER")
    refused("expected a laser log", read, tmp_path / "plain.clf.gz", Options())
    refused("No such file", read, tmp_path / "none.clf", Options())


def test_the_intel_lab_is_read_with_its_stamps() -> None:
    recording, remarks = read(at_hand("lidar") / "intel.clf.gz", Options())
    assert recording.ranges.shape[1] == 180
    assert len(recording.t) > 8000
    assert recording.odometry is not None
    assert not remarks
    relations = np.loadtxt(at_hand("lidar") / "intel.relations")
    exact = np.isin(relations[:, :2], recording.t).all(axis=1)
    assert exact.sum() == 1625


def test_freiburgs_building_79_has_no_odometry() -> None:
    recording, remarks = read(at_hand("lidar") / "fr079.clf.gz", Options())
    assert recording.odometry is None
    assert recording.ranges.shape[1] == 360
    assert remarks == ["its odometry never moves: the front end goes by the scans alone"]
