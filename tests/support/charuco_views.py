"""Views of a ChArUco board through a known lens, for tests of calibration."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.frontend.boards.board import Board
from slamduel.frontend.boards.view import View
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.markers.aruco import Image

BOARD = Board(columns=8, rows=6, square=0.04, marker=0.03, dictionary="4X4_50")
_SHARPNESS = 24
"""px per square of the drawing that views are warped from."""


class Squares(NamedTuple):
    """A chessboard of so many squares, drawn as a ChArUco board is; black first."""

    columns: int
    rows: int
    square: float  # m

    @property
    def opencv(self) -> "Squares":
        return self

    def generateImage(self, size: tuple[int, int]) -> Image:  # noqa: N802 - as OpenCV has it
        """(height, width) of that `size`, without an edge."""
        white = np.indices((self.rows, self.columns)).sum(axis=0) % 2
        sharp = size[0] // self.columns
        return np.kron(255 * white, np.ones((sharp, sharp))).astype(np.uint8)


def poses(
    count: int, rng: np.random.Generator, tilt: float = 35, distance: float = 0.42, board: Board | Squares = BOARD
) -> list[Array]:
    """(4, 4) T_camera_board each: the board's middle ahead of the camera, tilted every way by up to `tilt` degrees."""
    middle = np.array([board.columns, board.rows, 0]) * board.square / 2
    found: list[Array] = []
    for k in range(count):
        direction = 2 * np.pi * k / count
        lean = np.radians(tilt) * np.array([np.cos(direction), np.sin(direction), rng.uniform(-0.4, 0.4)])
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(lean)[0]
        at = np.array([*rng.uniform([-0.07, -0.05], [0.07, 0.05]), distance * rng.uniform(0.85, 1.15)])
        pose[:3, 3] = at - pose[:3, :3] @ middle
        found.append(pose)
    return found


def corners(camera: Camera, pose: Array, name: str, noise: float, rng: np.random.Generator) -> View:
    """The corners inside the image, without an image; `noise` is their standard deviation, px."""
    points = np.asarray(BOARD.opencv.getChessboardCorners(), float)
    seen = camera.project(points @ pose[:3, :3].T + pose[:3, 3])
    inside = ((seen > 2) & (seen < [camera.width - 3, camera.height - 3])).all(axis=1)
    return View(name, np.flatnonzero(inside), (seen + rng.normal(0, noise, seen.shape))[inside], points[inside])


def sensed(
    camera: Camera,
    places: Sequence[Array],
    sensor: Sensor,
    rng: np.random.Generator,
    board: Board = BOARD,
    blur: float = 0.6,
    ink: float = 0.0,
) -> list[Image]:
    """Photographs by a `sensor`, of light from 34 to 222 grey levels; `ink` m of growth of every edge of black.

    The light falls off by up to a tenth towards one side of the board. `blur` px is the lens's standard deviation.
    """
    sharpness, fine = 240, 4
    drawn = board.opencv.generateImage((board.columns * sharpness, board.rows * sharpness))
    grown = round(abs(ink) / board.square * sharpness)
    if grown:
        drawn = (cv2.erode if ink > 0 else cv2.dilate)(drawn, np.ones((2 * grown + 1, 2 * grown + 1), np.uint8))
    drawn = np.pad(drawn, sharpness, constant_values=255)
    v, u = np.mgrid[: fine * camera.height, : fine * camera.width] / fine - 0.5 + 0.5 / fine
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1))
    rays = np.column_stack((rays, np.ones(len(rays)))).T
    pixel = (1 - 1 / fine**2) / 12  # the variance that the mean over the rays of a pixel adds
    taken: list[Image] = []
    for pose in places:
        x, y, w = np.linalg.inv(pose[:3, [0, 1, 3]]) @ rays
        column, row = (np.stack((x, y)) / w * sharpness / board.square + sharpness - 0.5).astype(np.float32)
        shape = u.shape
        seen = cv2.remap(drawn, column.reshape(shape), row.reshape(shape), cv2.INTER_NEAREST, borderValue=255.0)
        light = np.float32(34) + np.float32(188 / 255) * seen
        light *= (1 - 0.1 * np.clip(column / drawn.shape[1], 0, 1)).reshape(shape).astype(np.float32)
        light = cv2.GaussianBlur(light, (0, 0), fine * np.sqrt(blur**2 - pixel))
        taken.append(
            sensor.picture(
                np.asarray(cv2.resize(light, (camera.width, camera.height), interpolation=cv2.INTER_AREA)), rng
            )
        )
    return taken


def photographs(camera: Camera, places: Sequence[Array], board: Board | Squares = BOARD) -> list[Image]:
    """(height, width) grey from each of `places` (4, 4) T_camera_board, by ray casting to the board."""
    drawn = board.opencv.generateImage((board.columns * _SHARPNESS, board.rows * _SHARPNESS))
    drawn = np.pad(drawn, _SHARPNESS, constant_values=255)
    fine = 2  # rays along each side of a pixel
    v, u = np.mgrid[: fine * camera.height, : fine * camera.width] / fine - 0.5 + 0.5 / fine
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1))
    rays = np.column_stack((rays, np.ones(len(rays)))).T
    taken: list[Image] = []
    for pose in places:
        x, y, w = np.linalg.inv(pose[:3, [0, 1, 3]]) @ rays
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.stack((x, y)) / w * _SHARPNESS / board.square + _SHARPNESS - 0.5
        at = np.where(np.isfinite(at) & (w > 0), at, -1e4).astype(np.float32)
        column, row = at.reshape(2, *u.shape)
        seen = cv2.remap(drawn, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=128.0)
        seen = cv2.resize(seen, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        taken.append(np.asarray(cv2.GaussianBlur(seen, (0, 0), 0.6), np.uint8))
    return taken
