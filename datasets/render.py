"""Frames of a room with markers, as a camera with a curved lens would take them.

Rays are followed, one a pixel, to the floor or a wall for the background, and several a pixel to the planes of the
markers' sheets of paper, so that their edges fall where they belong to a few hundredths of a pixel.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ..frontend.aruco import Image, square
from ..frontend.camera import Camera
from ..frontend.markers import find
from ..frontend.se2 import Array
from .surfaces import DENSITY, Surfaces
from .world import Marker, Room

Singles = NDArray[np.float32]

NEAR = 0.02
"""m before the lens; a sheet that reaches nearer, or behind it, is not drawn."""

BAND = 30
"""rows of a frame that are worked on at a time: as much as stays in a core's cache."""

INK, PAPER = 34.0, 222.0
"""Grey levels of a marker."""


@dataclass(frozen=True, eq=False)
class Renderer:
    """Takes pictures of one room through one camera."""

    room: Room
    camera: Camera
    dictionary: str
    surfaces: Surfaces
    blur: float = 0.6  # px, standard deviation of the lens blur
    grain: float = 2.0  # grey levels, standard deviation of the sensor's noise
    samples: int = 4  # rays along each side of a pixel, for the markers

    def frame(self, pose: Array, rng: np.random.Generator) -> Image:
        """(height, width) grey, seen from `pose` (4, 4) T_world_camera."""
        image = np.vstack([self._background(pose, self._rays[:, row : row + BAND]) for row in self._bands])
        for marker in sorted(self.room.markers, key=lambda m: -float(np.linalg.norm(m.pose[:3, 3] - pose[:3, 3]))):
            self._draw(image, marker, pose)
        image *= self._vignette
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), self.blur), np.float32)
        image += cv2.LUT(np.frombuffer(rng.bytes(image.size), np.uint8).reshape(image.shape), self._grains)
        return np.asarray(cv2.convertScaleAbs(np.maximum(image, 0, out=image)), np.uint8)

    @property
    def _bands(self) -> range:
        return range(0, self.camera.height, BAND)

    @cached_property
    def _rays(self) -> Singles:
        """(3, height, width) the direction of each pixel's ray in the camera frame, with z = 1."""
        v, u = np.mgrid[: self.camera.height, : self.camera.width]
        rays = self.camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1).astype(float))
        return np.vstack((rays.T, np.ones(len(rays)))).reshape(3, *u.shape).astype(np.float32)

    @cached_property
    def _slopes(self) -> tuple[Singles, Singles]:
        """(3, height, width) d ray / du and d ray / dv: within a pixel the lens is straight."""
        by_v, by_u = (np.asarray(slope) for slope in np.gradient(self._rays, axis=(1, 2)))
        return by_u, by_v

    @cached_property
    def _view(self) -> Array:
        """(2, 2) the smallest and the largest x and y of the rays."""
        flat = self._rays[:2].reshape(2, -1)
        return np.stack((flat.min(axis=1), flat.max(axis=1))).astype(float)

    @cached_property
    def _vignette(self) -> Singles:
        """(height, width) what the lens lets through: the fourth power of the cosine, softened."""
        return (1 + (self._rays[:2] ** 2).sum(axis=0)) ** np.float32(-0.8)

    @cached_property
    def _grains(self) -> Singles:
        """(256,) the normal distribution of the sensor's noise as its quantiles: a random byte each pixel draws one."""
        quantiles = ndtri((np.arange(256) + 0.5) / 256)
        return (self.grain * quantiles / quantiles.std()).astype(np.float32)

    def _background(self, pose: Array, rays: Singles) -> Singles:
        """(h, w) the floor and the walls along `rays` (3, h, w)."""
        half_x, half_y = np.float32(self.room.length / 2), np.float32(self.room.width / 2)
        turn, (ox, oy, oz) = pose[:3, :3].astype(np.float32), pose[:3, 3].astype(np.float32)
        dx, dy, dz = (turn @ rays.reshape(3, -1)).reshape(rays.shape)
        side_x, side_y = np.copysign(half_x, dx), np.copysign(half_y, dy)
        with np.errstate(divide="ignore"):  # along a wall, and never to meet it
            to_x, to_y = (side_x - ox) / dx, (side_y - oy) / dy
        to_floor = oz / np.maximum(-dz, np.float32(1e-9))
        to_wall = np.minimum(to_x, to_y)
        reach = np.minimum(to_wall, to_floor)
        x, y, z = ox + reach * dx, oy + reach * dy, oz + reach * dz
        # Counter-clockwise along the walls, as `world.wall_point` has it; the signs pick the wall of each pair.
        middle = half_x + half_y
        on_x = 3 * half_x + 2 * half_y + side_x / half_x * (y - middle)
        on_y = 2 * half_x + half_y - side_y / half_y * (x - middle)
        column = np.where(to_floor < to_wall, x + half_x, np.where(to_x < to_y, on_x, on_y))
        wall_row = np.float32(self.surfaces.wall_row / DENSITY + self.room.height) - z
        row = np.where(to_floor < to_wall, y + half_y, wall_row)
        column, row = (np.float32(DENSITY) * metres - np.float32(0.5) for metres in (column, row))
        seen = cv2.remap(self.surfaces.image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(seen, np.float32)

    @cached_property
    def _sheets(self) -> dict[int, Singles]:
        """Each marker's sheet, a pixel a module, white rim included: (m, m, 2) of its grey level and 1."""
        dictionary = find(self.dictionary)
        modules = dictionary.markerSize + 2
        sheets: dict[int, Singles] = {}
        for marker in self.room.markers:
            drawn = np.asarray(dictionary.generateImageMarker(marker.id, modules, borderBits=1), float)
            grey = np.pad(np.where(drawn > 0, PAPER, INK), 1, constant_values=PAPER)
            sheets[marker.id] = np.stack((grey, np.ones_like(grey)), axis=-1).astype(np.float32)
        return sheets

    def _draw(self, image: Singles, marker: Marker, pose: Array) -> None:
        """Lay the marker's sheet over `image`, if the camera is in front of it."""
        to_camera = np.linalg.inv(pose) @ marker.pose
        if to_camera[:3, 2] @ to_camera[:3, 3] >= 0:
            return
        sheet = self._sheets[marker.id]
        modules = len(sheet) - 2
        outline = square(self.room.side * (modules + 2) / modules) @ to_camera[:3, :3].T + to_camera[:3, 3]
        box = self._box(outline)
        if box is None:
            return
        # From a ray to the sheet's pixels: the plane's homography, then the middle of the top left module as origin.
        module, middle = self.room.side / modules, (len(sheet) - 1) / 2
        to_sheet = np.array([[1 / module, 0, middle], [0, -1 / module, middle], [0, 0, 1]])
        homography = (to_sheet @ np.linalg.inv(to_camera[:3, [0, 1, 3]])).astype(np.float32)
        at, by_u, by_v = (np.tensordot(homography, field[:, *box], axes=1) for field in (self._rays, *self._slopes))
        n = self.samples
        offsets = (((np.arange(n) + 0.5) / n - 0.5).astype(np.float32)).reshape(-1, 1, 1, 1)
        along_u = at + offsets * by_u
        along_v = offsets * by_v
        x, y, w = (along_u[:, None, i] + along_v[None, :, i] for i in range(3))
        height, width = at.shape[1:]
        x /= w
        y /= w
        column, row = (c.reshape(-1, width) for c in (x, y))
        seen = cv2.remap(sheet, column, row, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT)
        seen = np.asarray(seen, np.float32).reshape(n * n, height, width, 2)
        grey, hit = cv2.split(seen.mean(axis=0))
        image[box] += grey - hit * image[box]

    def _box(self, outline: Array) -> tuple[slice, slice] | None:
        """The rows and columns in which the convex `outline` (n, 3), in the camera frame, can show; None: nowhere."""
        if (outline[:, 2] < NEAR).any():
            return None
        rays = outline[:, :2] / outline[:, 2:]
        low, high = self._view
        corner, other = np.maximum(rays.min(axis=0), low), np.minimum(rays.max(axis=0), high)
        if (corner >= other).any():
            return None
        (x0, y0), (x1, y1) = corner, other
        along = np.linspace(0, 1, 9)[:, None]
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        rim = np.vstack([p + along * (q - p) for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
        pixels = self.camera.project(np.column_stack((rim, np.ones(len(rim)))))
        (u0, v0), (u1, v1) = np.floor(pixels.min(axis=0)).astype(int) - 1, np.ceil(pixels.max(axis=0)).astype(int) + 2
        rows = slice(max(v0, 0), min(v1, self.camera.height))
        columns = slice(max(u0, 0), min(u1, self.camera.width))
        return (rows, columns) if rows.start < rows.stop and columns.start < columns.stop else None
