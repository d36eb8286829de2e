"""Writes what a recording in files has beside frames: tables, [imu] of robot.toml, and depth as PNG files."""

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...frontend.depth.recording import DepthFrame
from ...frontend.inertial.imu import Imu
from ...frontend.wheels.track import Track
from ..depth.folder import MM
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


@contextmanager
def depth_files(folder: Path) -> Generator[Callable[[DepthFrame], None]]:
    """Two files for each frame, and their table."""
    rows = list[tuple[str, str, float]]()

    def add(frame: DepthFrame) -> None:
        names = f"frames/{len(rows):06}.png", f"frames/{len(rows):06}-depth.png"
        write_png(folder / names[0], pixels_of(frame))
        write_png(folder / names[1], in_units(frame, MM))
        rows.append((*names, frame.seconds))

    (folder / "frames").mkdir()
    yield add
    write_rows(folder / "frames.csv", "image,depth,t", rows)


def pixels_of(frame: DepthFrame) -> NDArray[np.uint8]:
    """The image, in colour if it is."""
    return frame.grey if frame.colour is None else frame.colour


def in_units(frame: DepthFrame, units: float) -> NDArray[np.uint16]:
    """The depth in units, rounded to whole millimetres."""
    mm = np.rint(1000 * frame.depth.astype(np.float64))
    return (mm * (units / 1000)).astype(np.uint16)


def write_png(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """A PNG file."""
    _, content = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    path.write_bytes(content.tobytes())
