"""Inner loop of `render`: where rays meet the floor and the walls, compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled

Singles = NDArray[np.float32]


@compiled
def meet(
    rays: Singles,
    eye: Singles,
    half_x: np.float32,
    half_y: np.float32,
    top: np.float32,
    density: np.float32,
    at: Singles,
) -> np.float32:
    """Writes to `at` (3, n), for each ray, the column and row of the surfaces' image that it hits, and the height z, m.

    Returns the largest z, that of the eye included.

    `rays` (3, n) and `eye` (3,) are in the room's frame, m. `top` is the walls' height, m, and the row of their upper
    edge, in metres of the image; `density` is in pixels per metre. All is single precision.
    """
    one, two, three = np.float32(1), np.float32(2), np.float32(3)
    middle = half_x + half_y
    highest = eye[2]
    for k in range(rays.shape[1]):
        dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
        side_x, side_y = math.copysign(half_x, dx), math.copysign(half_y, dy)
        to_x, to_y = (side_x - eye[0]) / dx, (side_y - eye[1]) / dy  # infinite where parallel to a wall
        to_floor = eye[2] / max(-dz, np.float32(1e-9))
        to_wall = min(to_x, to_y)
        reach = min(to_wall, to_floor)
        x, y, z = eye[0] + reach * dx, eye[1] + reach * dy, eye[2] + reach * dz
        highest = max(highest, z)
        # Counter-clockwise along the walls, as in `room.wall_point`; the signs pick the wall of each pair.
        if to_floor < to_wall:
            column, row = x + half_x, y + half_y
        else:
            row = top - z
            if to_x < to_y:
                column = three * half_x + two * half_y + side_x / half_x * (y - middle)
            else:
                column = two * half_x + half_y - side_y / half_y * (x - middle)
        at[0, k] = density * column - one / two
        at[1, k] = density * row - one / two
        at[2, k] = z
    return highest
