"""`bench detect`, `validate` and `show` say a line about inertial readings, whose turns are beside the log's rest."""

import json
from pathlib import Path

import numpy as np
import pytest

import bags
import floor_drives as floor
from slamduel.bench.cli import main
from slamduel.bench.plan.load import load
from slamduel.frontend.inertial.imu import GRAVITY

LINE = "gyro, accelerometer at 50 Hz for "
BIAS = 0.01  # rad/s


def readings() -> list[bags.Said]:
    """A gyro with a bias on a robot that is level."""
    drive, rng = floor.floor_drive(), np.random.default_rng(0)
    wheels = drive.odometry
    assert wheels is not None
    t = np.arange(drive.t[0], drive.t[-1], 0.02)
    rate = np.interp(t, drive.t, np.gradient(np.unwrap(wheels[:, 2]), drive.t))
    return [
        bags.imu(
            floor.BEGIN * floor.NS + round(at * floor.NS),
            rng.normal((0, 0, one + BIAS), 0.003),
            rng.normal((0, 0, GRAVITY), 0.1),
            frame="base_link",
        )
        for at, one in zip(t.tolist(), rate.tolist(), strict=True)
    ]


@pytest.mark.usefixtures("no_report")
def test_a_bag_with_readings_has_a_line_about_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = floor.floor_drive()
    streams = floor.scans(drive), floor.odometry(drive), floor.mounting()
    plain = floor.bag(tmp_path / "plain", "ros2", *streams)
    path = floor.bag(tmp_path / "bag", "ros2", *streams, readings())
    assert main(["validate", str(path)]) == 0
    assert f"IMU: {LINE}" in capsys.readouterr().out
    assert main(["detect", str(path), "--out", str(tmp_path / "log")]) == 0
    assert f"IMU: {LINE}" in " ".join(capsys.readouterr().out.split())
    assert LINE in (tmp_path / "log" / "detection.html").read_text(encoding="utf-8")
    assert main(["detect", str(path), "--out", str(tmp_path / "log"), "--quiet"]) == 0  # in place of the one before
    assert main(["show", str(tmp_path / "log"), "--json", "--no-solve"]) == 0
    assert json.loads(capsys.readouterr().out)["remarks"]
    assert main(["show", str(tmp_path / "log"), "--no-solve", "--out", str(tmp_path / "x.png")]) == 0
    assert LINE in " ".join(capsys.readouterr().out.split())
    with_readings, without = load(str(path)), load(str(plain))
    gyro = with_readings.log.gyro
    assert gyro is not None
    assert gyro.prior.mean == pytest.approx(BIAS, abs=4 * gyro.prior.sd)
    np.testing.assert_allclose(with_readings.log.delta, without.log.delta)
    assert with_readings.log.without_gyro().digest == without.log.digest
    assert load(str(tmp_path / "log")).log.digest == with_readings.log.digest
    assert load(f"recording[path={path},imu=false]").log.digest == without.log.digest
    assert "imu" not in without.log.notes
