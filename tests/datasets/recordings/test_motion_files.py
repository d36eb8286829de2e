"""Motion beside frames: commands, counters of one file or two, noise that nobody measured, and bags of commands."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import bags
from refusals import refused
from slamduel.core.factors import Log
from slamduel.core.se2 import Array
from slamduel.datasets.readings import read_readings
from slamduel.datasets.recordings import write
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import read_robot
from slamduel.datasets.recordings.rosbag import Topics, read
from slamduel.frontend.wheels.commands import Commanded, Speeds
from slamduel.frontend.wheels.ticks import Ticks

MARKERS = '[markers]\ndictionary = "4X4_50"\nside = 0.1\n'
CAMERA = '[camera]\ncalibration = "calibration.yaml"\n'
CALIBRATION = """\
image_width: 16
image_height: 12
camera_matrix: {rows: 3, cols: 3, data: [15.0, 0, 7.5, 0, 15.0, 5.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
WHEELS = "[encoder]\nleft = 1e-3\nright = 1e-3\nbase = 0.3\n"
T: Array = np.arange(41) / 20
COUNTS: Array = np.rint(np.column_stack((300 * T + 20 * np.sin(3 * T), 400 * T)))


def drive(folder: Path, words: str, **files: str) -> Path:
    """Ten small grey frames at 0.1 to 1.0 s, with that motion."""
    (folder / "frames").mkdir(parents=True)
    for k in range(10):
        assert cv2.imwrite(str(folder / "frames" / f"{0.1 * (k + 1):.6f}.png"), np.full((12, 16), 99, np.uint8))
    (folder / "robot.toml").write_text(CAMERA + MARKERS + words)
    (folder / "calibration.yaml").write_text(CALIBRATION)
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def log_of(folder: Path) -> Log:
    return build(open_recording(folder)).log


def table(header: str, *columns: Array) -> str:
    rows = ("".join(f",{cell:.10g}" for cell in row)[1:] for row in np.column_stack(columns))
    return header + "\n" + "\n".join(rows) + "\n"


RATES = table("t,v,omega", T, np.full(41, 0.5), np.full(41, 0.4))


def test_a_row_that_repeats_the_one_before_is_left_out_with_a_remark(tmp_path: Path) -> None:
    for name, rows in {
        "commands.csv": "t,v,omega\n0,1,0\n0,1,0\n1,2,0\n",
        "odometry.csv": "t,x,y,heading\n0,1,0,0\n0,1,0,0\n1,2,0,0\n",
        "ticks.csv": "t,left,right\n0,1,\n0,1,\n1,2,3\n2,3,4\n",
    }.items():
        folder, remarks = tmp_path / name.partition(".")[0], list[str]()
        folder.mkdir()
        (folder / name).write_text(rows)
        read = read_readings(folder, None, remarks)
        assert read is not None
        assert remarks == [f"{folder / name}, line 3: repeats line 2, its time, too: it is left out"]
        assert np.diff(read.t).min() > 0


def test_commands_are_the_motion_of_frames_and_their_noise_is_said(tmp_path: Path) -> None:
    log = log_of(drive(tmp_path / "a", "", commands=RATES))
    np.testing.assert_allclose(log.delta[1:], np.tile([0.05, 0.001, 0.04], (9, 1)), atol=2e-5)
    np.testing.assert_allclose(np.sqrt(log.delta_cov[1, 0, 0]), 0.1 * np.sqrt(0.05), rtol=0.01)
    (remark,) = log.remarks
    assert remark.startswith(
        f"{tmp_path / 'a'}: nothing was measured of the way in which the robot follows its commands"
    )
    assert remark.endswith("forward = 0.1, turning = 0.2, turning_by_turn = 0.3 by default; bench noise measures it")
    known = log_of(drive(tmp_path / "b", "[commands]\nforward = 0.05\nturning = 0.1\nturning_by_turn = 0.1\n",
                         commands=RATES))  # fmt: skip
    assert known.remarks == []
    assert known.notes["commands"]["noise"]["forward"] == 0.05


def test_shares_of_full_power_and_a_delay(tmp_path: Path) -> None:
    base, full = 0.25, 2.0
    shares = table("t,left,right", T, np.full(41, (0.5 - 0.4 * base / 2) / full),
                   np.full(41, (0.5 + 0.4 * base / 2) / full))  # fmt: skip
    one = log_of(drive(tmp_path / "a", "", commands=RATES))
    other = log_of(drive(tmp_path / "b", f"[commands]\nbase = {base}\nfull = {full}\n", commands=shares))
    np.testing.assert_allclose(other.delta[1:], one.delta[1:], atol=1e-9)
    refused(r"b\d?: commands: found speeds of the left and right wheel, expected base",
            log_of, drive(tmp_path / "b2", "", commands=shares))  # fmt: skip
    late = log_of(drive(tmp_path / "c", "[commands]\ndelay = 0.35\n", commands=RATES))
    assert late.notes["counts"]["frames without commands"] == 3
    refused(r"commands\.delay: found 350, .* \(0\.35 if this is in milliseconds\)",
            log_of, drive(tmp_path / "d", "[commands]\ndelay = 350\n", commands=RATES))  # fmt: skip


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (
            {"commands": "t,v\n0,1\n"},
            r"commands\.csv, line 1: found the columns t,v, expected t,v,omega or t,left,right",
        ),
        ({"commands": "t,v,omega\n0,1,0\n0,2,0\n"}, r"commands\.csv, line 3: t is 0\.0, expected later than 0\.0"),
        ({"commands": "t,v,omega\n0,1,x\n"}, r"commands\.csv, line 2: omega is 'x', expected a number"),
        ({"commands": RATES, "ticks": "t,left,right\n"}, r"has ticks\.csv as well as commands\.csv, expected one"),
        ({"left": "t,count\n0,1\n"}, r"has left\.csv without right\.csv, expected both"),
        ({"right": "t,count\n0,1\n"}, r"has right\.csv without left\.csv, expected both"),
        ({"ticks": "t,left,right\n0,1,2\n1,,\n"}, r"ticks\.csv, line 3: has no count, expected that of the left"),
        ({"ticks": "t,left,right\n0,1,\n1,2,\n"}, r"ticks\.csv: has no count of the right wheel, expected some"),
        ({"ticks": "t,left,right\n0,1,\n1,nan,2\n"}, r"ticks\.csv, line 3: left is nan, expected a finite number"),
        ({"ticks": "t,left,right\n0,1,\n,2,2\n"}, r"ticks\.csv, line 3: t is blank, expected a number"),
        ({"ticks": "t,left,right\n1,1,\n0,,2\n"}, r"ticks\.csv, line 3: t is 0\.0, expected later than 1\.0"),
        (
            {"left": "t,count\n0,1\n1,2\n", "right": "t,count\n2,1\n3,2\n"},
            r"the left and right counts are from 0\.0 to 1\.0 s and 2\.0 to 3\.0 s, expected times in common",
        ),
    ],
)
def test_what_cannot_be_read_is_a_sentence(tmp_path: Path, files: dict[str, str], message: str) -> None:
    for name, text in files.items():
        (tmp_path / f"{name}.csv").write_text(text)
    refused(message, read_readings, tmp_path, None, [])


def test_counters_in_one_table_in_rows_of_their_own_and_in_two_files_make_one_log(tmp_path: Path) -> None:
    expected = log_of(drive(tmp_path / "a", WHEELS + "k = 0.01\n", ticks=table("t,left,right", T, COUNTS)))
    later = T + 0.01
    right = np.interp(later, T, COUNTS[:, 1])
    rows = sorted([*((t, f"{t!r},{n:.10g},") for t, n in zip(T.tolist(), COUNTS[:, 0], strict=True)),
                   *((t, f"{t!r},,{n:.10g}") for t, n in zip(later.tolist(), right, strict=True))])  # fmt: skip
    blank = "t,left,right\n" + "".join(row + "\n" for _, row in rows)
    sides = {"left": table("t,count", T, COUNTS[:, 0]), "right": table("t,count", T, COUNTS[:, 1])}
    for folder in (drive(tmp_path / "b", WHEELS + "k = 0.01\n", ticks=blank),
                   drive(tmp_path / "c", WHEELS + "k = 0.01\n", **sides)):  # fmt: skip
        found = log_of(folder)
        exact = folder.name == "c"
        np.testing.assert_allclose(found.delta[1:], expected.delta[1:], rtol=0, atol=1e-9 if exact else 2e-4)
        np.testing.assert_allclose(found.delta_cov[1:], expected.delta_cov[1:], rtol=0 if exact else 0.2, atol=1e-9)
        assert found.remarks == []


def test_counters_that_wrap_are_unwrapped_each_by_itself(tmp_path: Path) -> None:
    for name, wheel in (("left", 0), ("right", 1)):
        (tmp_path / f"{name}.csv").write_text(table("t,count", T + 0.01 * wheel, (COUNTS[:, wheel] + 250) % 256))
    found = read_readings(tmp_path, 8, [])
    assert isinstance(found, Ticks)
    np.testing.assert_allclose(np.interp(T[1:], found.t, found.counts[:, 0]), COUNTS[1:, 0] + 250, atol=1e-9)


def test_noise_that_nobody_measured_is_a_default_and_said(tmp_path: Path) -> None:
    ticks = table("t,left,right", T, COUNTS)
    log = log_of(drive(tmp_path / "a", WHEELS, ticks=ticks))
    stated = log_of(drive(tmp_path / "b", WHEELS + 'k = 0.02\nnoise = "distance"\n', ticks=ticks))
    np.testing.assert_array_equal(log.delta_cov[1:], stated.delta_cov[1:])
    assert stated.remarks == []
    (remark,) = log.remarks
    assert remark.endswith("stated as k = 0.02 m for a wheel that rolls 1 m by default; bench noise measures it")
    assert log_of(drive(tmp_path / "c", WHEELS, odometry=table("t,x,y,heading", T, T, 0 * T, 0 * T))).remarks == []


def test_commands_and_counters_apart_are_written_as_logs_of_the_same_factors(tmp_path: Path) -> None:
    sides = {"left": table("t,count", T, COUNTS[:, 0]), "right": table("t,count", T + 0.01, COUNTS[:, 1])}
    for name, words, files in (("a", "", {"commands": RATES}), ("b", WHEELS + "k = 0.01\n", sides)):
        opened = open_recording(drive(tmp_path / name, words, **files))
        log = build(opened).log
        write.write({tmp_path / f"{name}-again": "frames"}, open_recording(tmp_path / name).recording, None)
        found = log_of(tmp_path / f"{name}-again")
        np.testing.assert_allclose(found.delta[1:], log.delta[1:], atol=1e-9)
        np.testing.assert_allclose(found.delta_cov[1:], log.delta_cov[1:], rtol=1e-6, atol=1e-12)


MS = 10**6
PIXELS = np.full((12, 16), 99, np.uint8)


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_commands_of_a_bag_count_where_robot_toml_asks_for_them(tmp_path: Path, kind: str, stamped: bool) -> None:
    said = [bags.image(100 * k * MS, PIXELS) for k in range(1, 8)]
    said += [bags.twist(50 * k * MS, 0.5, 0.4, stamped=stamped) for k in range(1, 16)]
    said += [bags.twist(800 * MS, np.nan, 0.0, stamped=stamped)]
    path = bags.write(tmp_path, kind, sorted(said, key=lambda one: one.stamp))
    assert read(path, Topics()).readings is None
    found = read(path, Topics(commands="/cmd_vel")).readings
    assert isinstance(found, Speeds)
    np.testing.assert_allclose(found.t, np.arange(1, 16) / 20)
    np.testing.assert_array_equal(found.speeds, np.tile([0.5, 0.4], (15, 1)))
    (tmp_path / "calibration.yaml").write_text(CALIBRATION)
    (tmp_path / "robot.toml").write_text(CAMERA + MARKERS + "[commands]\n[drift]\nposition = 1\nturning = 1\n")
    opened = open_recording(path, read_robot(tmp_path / "robot.toml"))
    assert isinstance(opened.recording.motion, Commanded)
    log = build(opened).log
    np.testing.assert_allclose(log.delta[1:], np.tile([0.05, 0.001, 0.04], (6, 1)), atol=2e-5)
    assert any("has the speeds [nan, 0.0], expected m/s and rad/s" in one for one in log.remarks)
    refused(r"\[topics\] names both encoder and commands", read, path, Topics(encoder="/a", commands="/cmd_vel"))


def test_what_was_measured_counts_before_commands(tmp_path: Path) -> None:
    said = [bags.image(100 * MS, PIXELS), *(bags.counts(k * MS, k, k, k, k) for k in range(1, 9))]
    path = bags.write(tmp_path, "ros1", [*said, bags.twist(50 * MS, 0.5, 0.4)])
    measured, commanded = read(path, Topics(), commands=True).readings, read(path, Topics(commands="/cmd_vel")).readings
    assert isinstance(measured, Ticks)
    np.testing.assert_array_equal(measured.counts, np.repeat(np.arange(1, 9)[:, None], measured.counts.shape[1], 1))
    assert isinstance(commanded, Speeds)
    np.testing.assert_array_equal(commanded.speeds, [[0.5, 0.4]])
