"""Reads the settings of the original ArUco EKF system, its settings/default.yaml, as a robot.

    covariance    k of eq. (1), k_r and k_phi of eq. (10)
    topic         image, encoder
    camera        fx, fy, cx, cy, k1, k2, p1, p2, k3    in px, without the images' size
    odom          kl, kr, b                             m per count, m
    extrinsic     Trc                                   three rows of four: T_robot_camera without its last row
    aruco         n_markers, marker_size, marker_length of a custom dictionary: count, bits along a side, m

The program (ydsf16/aruco_ekf_slam) leaves out markers beyond 3 m from the camera, in space. Its noise has no floors.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...frontend.camera.calibration import read
from ...frontend.camera.calibration_text import contents
from ...frontend.camera.camera import Camera
from ...frontend.camera.mounting import from_matrix
from ...frontend.markers.markers import LARGEST, MOST, SMALLEST, Markers
from ...frontend.markers.noise import ProportionalNoise
from ...frontend.plausible import SIDE, Measure
from ...frontend.wheels.encoder import Encoder
from ..robot_files import is_settings
from ..robot_limits import LIMITS
from .robot import Robot, read_robot
from .rosbag import Topics

FARTHEST = 3.0  # m from the camera

TABLES = ("covariance", "topic", "camera", "odom", "extrinsic", "aruco")


def read_described(path: Path) -> Robot:
    """The robot in `path`, a robot.toml or settings of the original system; InputError names the key of a fault."""
    return read_settings(path) if is_settings(path) else read_robot(path)


def read_settings(path: Path) -> Robot:
    """The robot in `path`, a settings/default.yaml. InputError for a number that is missing or of no robot."""
    found = contents(path)
    for name in TABLES:
        if not isinstance(found.get(name), Mapping):
            have = ", ".join(found)[:60]
            raise InputError(f"{path}: found no {name}: among {have}, expected {', '.join(TABLES)}.")
    given = _Settings(path, found)
    placed = from_matrix([*given.rows("extrinsic", "Trc"), [0.0, 0.0, 0.0, 1.0]], f"{path}: extrinsic: Trc")
    for k, metres in enumerate(placed[:3, 3].tolist()):
        given.check("extrinsic", f"Trc[{4 * k + 3}]", metres, LIMITS["camera.mounting.matrix"][0])
    bits = given.whole("aruco", "marker_size", SMALLEST, LARGEST)
    count = given.whole("aruco", "n_markers", 1, MOST)
    noise = ProportionalNoise(
        given.number("covariance", "k_r", LIMITS["noise.k_range"][0]),
        given.number("covariance", "k_phi", LIMITS["noise.k_bearing"][0]),
    )
    encoder = Encoder(
        given.number("odom", "kl", LIMITS["encoder.left"][0]),
        given.number("odom", "kr", LIMITS["encoder.right"][0]),
        given.number("odom", "b", LIMITS["encoder.base"][0]),
        given.number("covariance", "k", LIMITS["encoder.k"][0]),
    )
    for key, value in (("kl", encoder.left), ("kr", encoder.right)):
        if value == 0:
            raise InputError(f"{path}: odom: {key}: found 0, expected metres per count, a number other than 0.")
    for key in ("fx", "fy", "cx", "cy"):
        given.number("camera", key)

    def lens(width: int, height: int) -> Camera:
        return read(path, placed, (width, height))

    folder = path.absolute().parent
    return Robot(
        name=(folder.parent if folder.name == "settings" else folder).name,
        markers=Markers(f"custom[count={count},size={bits},seed=0]", given.number("aruco", "marker_length", SIDE)),
        mounting=placed,
        max_range=math.inf,
        max_distance=FARTHEST,
        encoder=encoder,
        noise=noise,
        topics=Topics(image=given.text("topic", "image"), encoder=given.text("topic", "encoder")),
        lens=lens,
        assumed={
            "": f"{path}: the original system's settings: kl, kr, b and k became [encoder] left = {encoder.left:.6g}, "
            f"right = {encoder.right:.6g}, base = {encoder.base:.6g}, k = {encoder.k:g} of each reading, Trc [camera] "
            f"mounting, at {placed[0, 3]:g}, {placed[1, 3]:g}, {placed[2, 3]:g} m, marker_length side, k_r and k_phi "
            f"[noise] k_range = {noise.k_range:g} and k_bearing = {noise.k_bearing:g} with the floors of a "
            f"{noise.floor_range:g} m and {noise.floor_bearing:g} rad that they lack; markers beyond {FARTHEST:g} m "
            "from the camera are left out, as by its program"
        },
    )


class _Settings:
    """The numbers and texts of the settings, checked."""

    def __init__(self, path: Path, found: Mapping[str, Any]) -> None:
        """Stores both."""
        self.path, self.found = path, found

    def number(self, table: str, key: str, measure: Measure | None = None) -> float:
        """A finite number that a robot may have."""
        value = self._given(table, key, "a number")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{self.path}: {table}: {key}: found {str(value)[:60]!r}, expected a number.")
        if measure is not None:
            self.check(table, key, float(value), measure)
        return float(value)

    def check(self, table: str, key: str, value: float, measure: Measure) -> None:
        """InputError for a number that no robot has."""
        if (odd := measure.odd(value)) is not None:
            raise InputError(f"{self.path}: {table}: {key}: {odd}.")

    def whole(self, table: str, key: str, least: int, most: int) -> int:
        """A whole number in bounds."""
        value = self.number(table, key)
        if value != int(value) or not least <= value <= most:
            expected = f"expected a whole number from {least} to {most}"
            raise InputError(f"{self.path}: {table}: {key}: found {value:g}, {expected}.")
        return int(value)

    def rows(self, table: str, key: str) -> list[list[float]]:
        """Three rows of four numbers."""
        value = self._given(table, key, "twelve numbers, three rows of four")
        numbers = value if isinstance(value, list) else []
        if len(numbers) != 12 or not all(isinstance(one, int | float) for one in numbers):
            raise InputError(
                f"{self.path}: {table}: {key}: found {str(value)[:60]}, expected twelve numbers, three rows of four."
            )
        return np.reshape(numbers, (3, 4)).astype(float).tolist()

    def text(self, table: str, key: str) -> str:
        """A text."""
        value = self._given(table, key, "a topic's name")
        if not isinstance(value, str):
            raise InputError(f"{self.path}: {table}: {key}: found {str(value)[:60]!r}, expected a topic's name.")
        return value

    def _given(self, table: str, key: str, expected: str) -> Any:
        if self.found[table].get(key) is None:
            raise InputError(f"{self.path}: {table}: found no {key}, expected {expected}.")
        return self.found[table][key]
