"""Writes the tables of a recording in files: odometry.csv, imu.csv, gps.csv and [imu] of robot.toml."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ...frontend.inertial.imu import Imu
from ...frontend.wheels.track import Track
from ..fixes.gps_csv import FILE as GPS
from ..inertial.imu_csv import AXES, IMU
from ..inertial.robot import ImuTable
from .write_bag import IMU_TOPIC, Positions


def write_track(folder: Path, track: Track) -> None:
    """odometry.csv."""
    rows = zip(track.t.tolist(), *track.poses.T.tolist(), strict=True)
    write_rows(folder / "odometry.csv", "t,x,y,heading", rows)


def write_imu(folder: Path, imu: Imu) -> None:
    """imu.csv."""
    sensors = {"gyro": imu.gyro} | ({} if imu.accel is None else {"accel": imu.accel})
    sensors |= {} if imu.mag is None else {"mag": imu.mag}
    names = [f"{name}_{axis}" for name in sensors for axis in AXES]
    rows = np.column_stack((imu.t, *sensors.values())).tolist()
    write_rows(folder / IMU, ",".join(("t", *names)), [["" if np.isnan(one) else one for one in row] for row in rows])


def write_positions(folder: Path, found: Positions) -> None:
    """gps.csv."""
    write_rows(folder / GPS, "t,lat,lon,sd", np.column_stack((found.t, found.degrees, found.sd)).tolist())


def imu_table(imu: Imu, *, bag: bool) -> ImuTable:
    """[imu] of a robot.toml beside imu.csv or a bag."""
    if bag:
        return ImuTable(topic=IMU_TOPIC, mounting=np.eye(4))
    return ImuTable(
        mounting=np.eye(4),
        gyro="rad/s",
        accelerometer=None if imu.accel is None else "m/s^2",
        magnetometer=None if imu.mag is None else "T",
    )


def write_rows(path: Path, header: str, rows: Iterable[Sequence[object]]) -> None:
    """A CSV file."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(header + "\n")
        file.writelines(",".join(map(str, row)) + "\n" for row in rows)
