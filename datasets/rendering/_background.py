"""Inner loops of `render`: where rays meet the floor, walls and people, compiled."""

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


@compiled
def meet_all(
    rays: Singles,
    eye: NDArray[np.float64],
    walls: NDArray[np.float64],
    people: NDArray[np.float64],
    size: tuple[float, float, float, float],
    at: Singles,
    reach: Singles,
    grey: Singles,
) -> None:
    """Writes what `meet` does, in a building: `reach` (n,) is how far along a ray, in its lengths, the surface is.

    `size` has half_x, half_y, top and density, as `meet` does. `walls` (w, 5) are x0, y0, x1, y1 and where on the
    image's walls they begin, m. `people` (c, 6) are upright cylinders: x, y, radius, bottom and top, m, and grey level.
    `grey` (n,) is that of a cylinder that is met, else -1.
    """
    half_x, half_y, top, density = size
    for k in range(rays.shape[1]):
        dx, dy, dz = float(rays[0, k]), float(rays[1, k]), float(rays[2, k])
        best = eye[2] / max(-dz, 1e-9)
        wall, share = -1, 0.0
        for i in range(len(walls)):
            ax, ay = walls[i, 0] - eye[0], walls[i, 1] - eye[1]
            bx, by = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
            across = dy * bx - dx * by
            if abs(across) < 1e-12:
                continue
            r, along = (ay * bx - ax * by) / across, (dx * ay - dy * ax) / across
            if 0.0 < r < best and 0.0 <= along <= 1.0:
                best, wall, share = r, i, along
        shade, flat = -1.0, dx * dx + dy * dy
        for i in range(len(people)):
            ax, ay, radius = people[i, 0] - eye[0], people[i, 1] - eye[1], people[i, 2]
            along = dx * ax + dy * ay
            inside = along * along - flat * (ax * ax + ay * ay - radius * radius)
            if along > 0.0 and inside > 0.0 and flat > 0.0:
                r = (along - math.sqrt(inside)) / flat
                z = eye[2] + r * dz
                if 0.0 < r < best and people[i, 3] <= z <= people[i, 4]:
                    best = r
                    side = ((r * dx - ax) * 0.6 + (r * dy - ay) * 0.8) / radius  # 1 where it faces the light
                    shade = people[i, 5] * (0.85 + 0.15 * side)
        x, y, z = eye[0] + best * dx, eye[1] + best * dy, eye[2] + best * dz
        if wall < 0:
            column, row = x + half_x, y + half_y
        else:
            bx, by = walls[wall, 2] - walls[wall, 0], walls[wall, 3] - walls[wall, 1]
            column, row = walls[wall, 4] + share * math.sqrt(bx * bx + by * by), top - z
        at[0, k] = density * column - 0.5
        at[1, k] = density * row - 0.5
        at[2, k] = z
        reach[k] = best
        grey[k] = shade
