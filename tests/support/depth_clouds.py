"""A depth camera's exact clouds of a plain room with boxes, whose walls and floor have colours of their own."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from slamduel.core.beside import Clouds
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.boxes import Box
from slamduel.datasets.rendering.cameras import MOUNTING
from slamduel.datasets.rendering.depth import true_depth
from slamduel.datasets.rendering.disturbances import raised
from slamduel.datasets.rendering.lens import through
from slamduel.datasets.rendering.room import Room
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.maps.cloud import Cloud, cloud_of
from slamduel.frontend.maps.spool import Spool

CAMERA = Camera(320, 240, (288.0, 288.0), (159.5, 119.5), (), MOUNTING)
HALF = (2.5, 2.0)
"""m from the middle of the room to its walls."""

BOX = Box(np.array([0.9, -0.7, 0.4]), (0.4, 0.5, 0.5))
"""At 0.9, -0.7 m, turned by 0.4 rad; 0.4 m long, 0.5 m wide and high."""

ROOM = Room(2 * HALF[0], 2 * HALF[1], 2.5, 0.16, (), (BOX,))

FLOOR, WALLS, BOXES = (0, 160, 0), (160, 0, 0), (0, 0, 200)
"""Colours: red, green, blue."""

PATH = np.array([[x, y, turn] for x, y in ((-1.0, 0.3), (0.0, 0.0), (1.6, 0.8)) for turn in np.arange(0, 6.2, 0.4)])
"""Poses (n, 3), all around at three places."""


def seen(pose: Array) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Depth (h, w), m, and colours (h, w, 3) blue, green, red, of a level robot at `pose` (3,)."""
    T = raised(pose[None])[0] @ CAMERA.mounting
    depth = true_depth(ROOM, through(CAMERA), T)
    rays = np.concatenate((CAMERA.rays, np.ones((*CAMERA.rays.shape[:2], 1))), axis=2)
    points = (rays * depth[:, :, None]) @ T[:3, :3].T + T[:3, 3]
    colours = np.empty((*depth.shape, 3), np.uint8)
    colours[:] = BOXES[::-1]
    colours[(np.abs(points[:, :, :2]) > np.array(HALF) - 1e-3).any(axis=2)] = WALLS[::-1]
    colours[np.abs(points[:, :, 2]) < 1e-3] = FLOOR[::-1]
    return depth.astype(np.float32), colours


@cache
def room_clouds() -> Clouds:
    """The clouds along PATH."""
    found = list[Cloud]()
    for pose in PATH:
        depth, colours = seen(pose)
        found.append(cloud_of(CAMERA, CAMERA.mounting, depth, colours, (0.4, 2.8)))
    return spooled(found)


def spooled(found: list[Cloud]) -> Clouds:
    """Clouds as a log has them."""
    spool = Spool()
    for one in found:
        spool.add(one)
    return spool.clouds(CAMERA)


def on_box(points: Array, margin: float) -> NDArray[np.bool]:
    """(n,) points (n, 2) in the box's footprint, enlarged by `margin`, m."""
    c, s = np.cos(BOX.place[2]), np.sin(BOX.place[2])
    off = (points - BOX.place[:2]) @ np.array([[c, -s], [s, c]])
    return np.all(np.abs(off) <= np.array(BOX.size[:2]) / 2 + margin, axis=1, keepdims=True)[:, 0]
