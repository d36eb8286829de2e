"""A gyro that is late, or another's, beside odometry and ground truth in CSV files, and rows that are repeated."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inertial_drives import drive
from slamduel.bench.cli import main
from slamduel.bench.systematic.delays import told_delays
from slamduel.core.errors import InputError
from slamduel.core.factors import Log
from slamduel.core.se2 import Array, summed, wrap
from slamduel.datasets.tables.csv_options import Options
from slamduel.datasets.tables.csv_tables import make

SEEDS = range(8)
IMU = "t,gyro_x,gyro_y,gyro_z"


def written(path: Path, header: str, rows: Array) -> str:
    np.savetxt(path, rows, "%.9g", delimiter=",", header=header, comments="")
    return str(path)


class Files:
    """A drive of 90 s: odometry with noise at 20 Hz, headings at 1 Hz as what is seen, a gyro at 50 Hz, the truth."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng = folder, np.random.default_rng(seed)
        self.drive = drive(seed, 90.0, 100.0, hills=0.0)
        t, right = self.drive.t, self.drive.odometry.poses
        way = np.diff(np.cumsum(self.drive.speed)[::5]) / 100
        turn = np.diff(self.drive.heading[::5]) + 0.03 * np.sqrt(way) * self.rng.standard_normal(len(way))
        self.odometry = np.column_stack((t[::5], summed(right[0], np.column_stack((way, 0 * way, turn)))))
        self.truth = np.column_stack((t[::5], right[::5, :2], wrap(right[::5, 2])))
        self.headings = np.column_stack((t[::100], wrap(right[::100, 2] + 0.05 * self.rng.standard_normal(90))))
        self.imu = np.column_stack((t, self.drive.imu.gyro))[::2]

    def log(self, *, truth: bool = True, delay: float = 0.0) -> Log:
        given: dict[str, Any] = {
            "odometry": written(self.folder / "odometry.csv", "t,x,y,heading", self.odometry),
            "headings": written(self.folder / "headings.csv", "t,heading", self.headings),
            "imu": written(self.folder / "imu.csv", IMU, self.imu),
        }
        if truth:
            given["truth"] = written(self.folder / "truth.csv", "t,x,y,heading", self.truth)
        start: dict[str, Any] = {"start_x": 0.0, "start_y": 0.0, "start_heading": 0.0}
        return make(Options(**given, **start, imu_delay=delay), np.random.default_rng(0)).log


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("truth", [True, False])
def test_a_late_gyro_is_left_out_and_its_delay_puts_it_back(seed: int, *, truth: bool, tmp_path: Path) -> None:
    files = Files(tmp_path, seed)
    right = files.log(truth=truth)
    assert right.remarks == []
    assert right.gyro is not None
    (told,) = told_delays(right)
    assert told.late is not None
    assert told.late.value == pytest.approx(0.0, abs=0.03)
    assert "takes that off" not in told.sentence
    files.imu[:, 0] += 2.0
    late = files.log(truth=truth)
    assert late.gyro is None
    (remark,) = late.remarks
    assert remark.endswith("; its turns are not in the log")
    (told,) = told_delays(late)
    assert told.late is not None
    assert told.late.value == pytest.approx(2.0, abs=0.03)
    delay = told.off.removeprefix("option imu_delay=")
    assert f"{told.off} takes that off" in remark
    assert f": {told.off} takes that off, and puts its turns into the log." in told.sentence
    again = files.log(truth=truth, delay=float(delay))
    assert again.gyro is not None
    assert again.remarks == []
    assert len(again.gyro) == pytest.approx(len(right.gyro), abs=60)


def test_odometry_that_is_late_leaves_the_gyro_in_the_log_if_a_truth_says_so(tmp_path: Path) -> None:
    files = Files(tmp_path, 0)
    files.odometry[:, 0] += 1.0
    log = files.log()
    assert log.gyro is not None
    assert any(one.endswith("the odometry is wrong, and the gyro's turns are in the log") for one in log.remarks)
    alone = files.log(truth=False)
    assert alone.gyro is None
    assert any("takes that off, if the odometry is in time" in one for one in alone.remarks)


def test_the_gyro_of_another_drive_is_left_out(tmp_path: Path) -> None:
    files = Files(tmp_path, 0)
    files.imu = Files(tmp_path, 1).imu
    log = files.log()
    assert log.gyro is None
    (remark,) = log.remarks
    assert "perhaps it is of another drive" in remark


@pytest.mark.parametrize("name", ["odometry", "headings", "imu"])
def test_a_row_that_repeats_the_one_before_is_left_out_of_every_table(name: str, tmp_path: Path) -> None:
    files = Files(tmp_path, 2)
    right, rows = files.log(), getattr(files, name)
    setattr(files, name, np.insert(rows, [51, 51, 61], rows[[50, 50, 60]], axis=0))
    log = files.log()
    path = tmp_path / f"{name}.csv"
    assert log.remarks == [f"{path}, line 53: repeats line 52, its time, too, and so do 2 more rows: they are left out"]
    assert log.digest == right.digest


@pytest.mark.parametrize("name", ["odometry", "imu"])
def test_other_values_at_the_time_of_the_row_before_are_refused(name: str, tmp_path: Path) -> None:
    files = Files(tmp_path, 2)
    rows = getattr(files, name)
    rows[50:] += np.arange(rows.shape[1]) > 0  # another reading than the one before
    rows[50, 0] = rows[49, 0]
    with pytest.raises(InputError, match=rf"{name}\.csv, line 52: t is "):
        files.log()


def test_explain_says_how_late_the_gyro_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = Files(tmp_path, 0)
    files.imu[:, 0] += 2.0
    files.log()
    given = ",".join(f"{name}={tmp_path / name}.csv" for name in ("odometry", "headings", "imu", "truth"))
    assert main(["validate", f"csv[{given}]", "--explain"]) == 0
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "the stamps of the gyro are" in one]
    assert "By the turns of the ground truth the stamps of the gyro are " in line
    assert line.endswith("takes that off, and puts its turns into the log.")
