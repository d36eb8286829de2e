"""Pictures on the walls and rugs on the floor of a painted room: something to see for a camera without markers."""

import cv2
import numpy as np

from ...frontend.markers.aruco import Image
from .room import Room
from .surfaces import DENSITY, Grey, Surfaces

SIDES = (0.4, 0.8)  # m, range of the posters' widths and heights

MIDDLES = (0.45, 0.95)
"""m, range of the heights of their middles: in view of a low camera that looks down."""

RUG = (0.7, 1.3)  # m, range of the rugs' sides
FADED = (0.6, 20.0)  # contrast of a rug, and the grey level of its black
FINEST = 4  # px, the smallest shapes: 25 mm
SHAPES = 24  # per scale, if each covers no part of another
SPECKLES = 6.0  # grey levels, standard deviation of the print's unevenness


def decorated(
    room: Room, surfaces: Surfaces, posters: int, rugs: int, alike: bool, rng: np.random.Generator
) -> Surfaces:
    """The surfaces with `posters` pictures around the walls, all of them the same one if `alike`, and with `rugs`.

    Posters are spread evenly, each shifted at random as far as it stays clear of the next; rugs may overlap. The
    textures of boxes are left as they are.
    """
    image = surfaces.image.copy()
    hanging, lying = rng.spawn(2)
    walls = image[surfaces.wall_row :, : round(room.perimeter * DENSITY)]
    slot = walls.shape[1] / max(posters, 1)
    one: Grey | None = None
    for number in range(posters):
        height, width = (hanging.uniform(*SIDES, 2) * DENSITY).astype(int)
        width = min(width, int(0.9 * slot))
        if one is None or not alike:
            one = poster(int(height), int(width), hanging)
        height, width = one.shape
        left = int(slot * number + hanging.uniform(0, slot - width))
        middle = round((room.height - hanging.uniform(*MIDDLES)) * DENSITY)
        top = min(max(middle - height // 2, 0), len(walls) - height)
        walls[top : top + height, left : left + width] = np.rint(one)
    rows, columns = round(room.width * DENSITY), round(room.length * DENSITY)
    for _ in range(rugs):
        height, width = (lying.uniform(*RUG, 2) * DENSITY).astype(int)
        top, left = int(lying.integers(0, rows - height)), int(lying.integers(0, columns - width))
        rug = FADED[0] * poster(int(height), int(width), lying) + FADED[1]
        image[top : top + height, left : left + width] = np.rint(rug)
    return surfaces._replace(image=image)


def poster(height: int, width: int, rng: np.random.Generator) -> Grey:
    """A picture (height, width) of grey levels 0 to 255: shapes of every size from half of it down to FINEST px.

    Large ones are drawn first, so that small ones lie on them: from near and far there are corners to find.
    """
    picture = np.full((height, width), rng.uniform(90, 220), np.uint8)
    size = min(height, width) / 4
    while size >= FINEST:
        for _ in range(min(SHAPES, int(0.25 * height * width / size**2)) + 2):
            _draw(picture, size * rng.uniform(0.7, 1.4), rng)
        size /= 2
    cv2.rectangle(picture, (0, 0), (width - 1, height - 1), float(rng.uniform(10, 60)), 2)  # a frame
    return np.clip(picture + SPECKLES * rng.standard_normal(picture.shape, np.float32), 0, 255)


def _draw(picture: Image, size: float, rng: np.random.Generator) -> None:
    """Draws a disc, a polygon of 3 to 5 corners, or a letter of some `size`, px, somewhere."""
    kind, grey = rng.integers(4), float(rng.choice([rng.uniform(5, 90), rng.uniform(150, 250)]))
    place = rng.uniform(0, 1, 2) * picture.shape[::-1]
    if kind == 0:
        cv2.circle(picture, np.rint(place).astype(int).tolist(), int(np.ceil(size / 2)), grey, -1)
    elif kind == 1:
        letter = "AEFHKLMNRTVXYZ2347"[rng.integers(18)]
        thick = max(1, round(size / 8))
        cv2.putText(picture, letter, np.rint(place).astype(int).tolist(), 0, size / 22, grey, thick)
    else:
        corners = int(rng.integers(3, 6))
        angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
        around = np.stack((np.cos(angles), np.sin(angles)), axis=-1) * rng.uniform(0.5, 1.0, (corners, 1))
        cv2.fillPoly(picture, [np.rint(place + size * around).astype(np.int32)], grey)
