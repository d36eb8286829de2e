"""The floor in a depth image: pitch, roll and height of a body that rocks, and with them a levelled frame.

Where a frame shows no floor, gravity tells pitch and roll, as an inertial measurement unit has it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.elementary import arctan2, hypot
from ...core.se2 import Array
from ..camera.camera import Camera
from ..inertial.tilts import Tilts
from ._depth_image import floor_plane, floor_points
from .settings import Settings

EVERY = 8  # pixels from one that is looked at to the next, in rows and columns
FAR = 3.0  # m; floors farther away are measured too badly to help

HEIGHT, SLOPE = 0.08, 0.06
"""m, and m a metre, around the floor that the mounting tells, in which its points are."""

LEAST = 80  # points of a floor
STEEPEST = 0.15  # m a metre; a steeper plane is no floor

UP = 0.1
"""m a radian; sd of the height by that of pitch and roll, where no floor is found.

Chosen, not measured: in the rendered rooms there always is a floor.
"""

DRAWS = 300
"""Planes through three points that are tried. Where a quarter of the points are of the floor, one plane in 64 is."""


class Level(NamedTuple):
    """The transform from a camera's frame to the robot's, upright on the floor."""

    T: Array  # (4, 4)
    cov: Array  # (3, 3) of the turns about x and y (rad) and of the height (m), which a frame's points share
    found: bool  # by the floor; False: by gravity, or the mounting as it is stated
    by_gravity: bool = False


class Leveller:
    """Levels the frames of one camera."""

    def __init__(self, camera: Camera, settings: Settings, tilts: Tilts | None = None) -> None:
        self._camera, self._settings, self._tilts = camera, settings, tilts
        self._draws = np.random.default_rng(0).random((DRAWS, 3))  # the same for every frame

    def level(self, depth: NDArray[np.float32], t: float | None = None) -> Level:
        """Levels a frame at `t`, s, by its `depth` (h, w), m."""
        s, camera = self._settings, self._camera
        plane, cov = np.empty(3), np.empty((3, 3))
        if s.level and floor_plane(
            floor_points(
                depth, camera.rays, camera.mounting, EVERY, s.near, min(s.far, FAR), s.constant_sd, s.depth_sd, HEIGHT,
                SLOPE,
            ),
            self._draws, STEEPEST, HEIGHT, SLOPE, LEAST, plane, cov,
        ):  # fmt: skip
            T = levelling(plane) @ camera.mounting
            # z = a x + b y + c: a turn about y by t tilts by a = -t, one about x by b = t
            J = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            return Level(T, J @ cov @ J.T, True)
        if self._tilts is not None and t is not None and (tilt := self._tilts.at(t, s.sway)) is not None:
            turns = tilt.leaning[:, :2].T @ tilt.leaning[:, :2]
            cov = np.zeros((3, 3))
            cov[:2, :2], cov[2, 2] = turns, UP**2 * np.trace(turns) / 2
            return Level(tilt.turn @ camera.mounting, cov, found=False, by_gravity=True)
        up = s.sway * UP
        return Level(camera.mounting, np.diag([s.sway**2, s.sway**2, up**2]), False)


class Tilt(NamedTuple):
    """The body's attitude, as a level has it."""

    pitch: float  # rad, forward
    roll: float  # rad, to the right
    up: float  # m, of the robot's origin above the floor


def tilt_of(level: Level, camera: Camera) -> Tilt:
    """The attitude of a body whose camera, mounted as stated, has this level."""
    R, t = camera.mounting[:3, :3], camera.mounting[:3, 3]
    up = R @ level.T[2, :3]  # the last row of the body's turn: (-sin pitch, cos pitch sin roll, cos pitch cos roll)
    pitch, roll = arctan2(-up[0], hypot(up[1], up[2])), arctan2(up[1], up[2])
    return Tilt(float(pitch), float(roll), float(level.T[2, 3] - up @ t))


def levelling(plane: Array) -> Array:
    """(4, 4) the turn and the shift that take the plane z = a x + b y + c, `plane` (3,), to z = 0.

    The x axis stays above its projection on the plane: the heading of a body that is tilted is where that points to.
    """
    a, b, c = plane
    z = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x /= np.sqrt(x @ x)
    T = np.eye(4)
    T[:3, :3] = [x, np.cross(z, x), z]
    T[2, 3] = -c * z[2]
    return T
