"""Renders frames of a room with markers and boxes through a camera with lens distortion.

The background is sampled by one ray per pixel to the floor or a wall; the markers' sheets of paper and the edges of
boxes by many, so that edges are accurate to a few thousandths of a pixel. Grey levels are linear in light, on which
lens and exposure act.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Image, square
from ...frontend.markers.markers import find
from ...frontend.se2 import Array
from ._background import meet
from .boxes import Box, Face
from .lattice import jitter, lattice
from .lens import Lens, Part, Patch, Singles, through
from .room import Marker, Room
from .surfaces import DENSITY, Surfaces

BAND = 30
"""Rows of a frame processed at a time: as much as fits a core's cache."""

INK, PAPER, CEILING = 34.0, 222.0, 188.0
"""Grey levels of a marker, and above the walls."""


class Cover(NamedTuple):
    """An occluder close to the lens."""

    share: Singles  # (height, width) share of each pixel's light that it blocks
    grey: float  # its own grey level


class Conditions(NamedTuple):
    """Conditions that vary between frames."""

    light: float | Singles = 1.0  # times the light of the scene, or (height, width)
    cover: Cover | None = None


CLEAR = Conditions()


@dataclass(frozen=True, eq=False)
class Renderer:
    """Takes pictures of one room with one camera.

    Markers that are on no box must be behind every box, as those on floor and walls are.
    """

    room: Room
    camera: Camera
    dictionary: str
    surfaces: Surfaces
    blur: float = 0.6  # px, standard deviation of the lens blur
    grain: float = 2.0  # grey levels, standard deviation of the sensor's noise
    samples: int = 6  # its square is the number of rays per pixel, for the markers and the boxes' edges
    vignetting: float = 0.4  # strength of the light's falloff towards the corners; 1: the fourth power of the cosine
    printed: Mapping[int, NDArray[np.bool_]] = field(default_factory=dict[int, NDArray[np.bool_]])  # id -> bits (n, n),
    # True is white, of markers that are not as in the dictionary

    def frame(self, pose: Array, rng: np.random.Generator, conditions: Conditions = CLEAR) -> Image:
        """(height, width) grey, seen from `pose` (4, 4) T_world_camera; for poses (n, 4, 4), the mean of their light.

        Grey levels saturate at 255.
        """
        first, *others = pose.reshape(-1, 4, 4)
        image = self.scene(first)
        for other in others:
            image += self.scene(other)
        if others:
            image /= 1 + len(others)
        return self.exposed(image, rng, conditions)

    def exposed(self, image: Singles, rng: np.random.Generator, conditions: Conditions = CLEAR) -> Image:
        """The picture of `image` (height, width), a scene's grey levels, which are overwritten, by lens and sensor."""
        image *= self._transmission
        image *= conditions.light
        if conditions.cover is not None:
            image += conditions.cover.share * (np.float32(conditions.cover.grey) * self._transmission - image)
        if self.blur > 0:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), self.blur), np.float32)
        image += cv2.LUT(np.frombuffer(rng.bytes(image.size), np.uint8).reshape(image.shape), self._grains)
        return np.asarray(cv2.convertScaleAbs(np.maximum(image, 0, out=image)), np.uint8)

    def scene(self, pose: Array) -> Singles:
        """(height, width) the grey levels seen from `pose` (4, 4), before lens and sensor."""
        rays = self.lens.rays
        bands = range(0, self.camera.height, BAND)
        image = np.vstack([self._background(pose, rays[:, row : row + BAND]) for row in bands])
        eye = pose[:3, 3]
        for marker in sorted(self.room.markers, key=lambda m: -float(np.linalg.norm(m.pose[:3, 3] - eye))):
            if marker.box is None:
                self._draw(image, marker, pose)
        # Of two disjoint circles, the one of lesser power is never behind the other.
        power = [float(((box.place[:2] - eye[:2]) ** 2).sum()) - box.radius**2 for box in self.room.boxes]
        for index in np.argsort(power)[::-1]:
            self._put(image, self.room.boxes[index], self.surfaces.boxes[index], pose)
            for marker in self.room.markers:
                if marker.box == index:
                    self._draw(image, marker, pose)
        return image

    @cached_property
    def lens(self) -> Lens:
        """The camera's rays."""
        return through(self.camera)

    @cached_property
    def _transmission(self) -> Singles:
        return self.lens.transmission(self.vignetting)

    @cached_property
    def _lattice(self) -> Singles:
        return lattice(self.samples**2)

    @cached_property
    def _jitter(self) -> Singles:
        return jitter(self.camera.height, self.camera.width) / np.float32(self.samples**2)

    @cached_property
    def _grains(self) -> Singles:
        """(256,) quantiles of the sensor's normal noise, indexed by one random byte per pixel."""
        quantiles = ndtri((np.arange(256) + 0.5) / 256)
        return (self.grain * quantiles / quantiles.std()).astype(np.float32)

    def _background(self, pose: Array, rays: Singles) -> Singles:
        """(h, w) the floor and the walls along `rays` (3, h, w)."""
        turn, eye = pose[:3, :3].astype(np.float32), pose[:3, 3].astype(np.float32)
        half_x, half_y, height = (np.float32(m) for m in (self.room.length / 2, self.room.width / 2, self.room.height))
        top = np.float32(self.surfaces.wall_row / DENSITY + self.room.height)
        at = np.empty((3, *rays.shape[1:]), np.float32)
        turned = turn @ rays.reshape(3, -1)
        highest = meet(turned, eye, half_x, half_y, top, np.float32(DENSITY), at.reshape(3, -1))
        column, row, z = at[0], at[1], at[2]
        seen = cv2.remap(self.surfaces.image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        seen = np.asarray(seen, np.float32)
        if highest > height:
            seen[z > height] = CEILING
        return seen

    @cached_property
    def _sheets(self) -> dict[int, Singles]:
        """Each marker's sheet, one pixel per module, white rim included: (m, m, 2) of its grey level and 1."""
        dictionary = find(self.dictionary)
        modules = dictionary.markerSize + 2
        sheets: dict[int, Singles] = {}
        for marker in self.room.markers:
            drawn = np.asarray(dictionary.generateImageMarker(marker.id, modules, borderBits=1), float)
            if marker.id in self.printed:
                drawn[1:-1, 1:-1] = self.printed[marker.id]
            grey = np.pad(np.where(drawn > 0, PAPER, INK), 1, constant_values=PAPER)
            sheets[marker.id] = np.stack((grey, np.ones_like(grey)), axis=-1).astype(np.float32)
        return sheets

    def _draw(self, image: Singles, marker: Marker, pose: Array) -> None:
        """Draws the marker's sheet into `image`, if the camera is in front of it."""
        sheet = self._sheets[marker.id]
        modules = len(sheet) - 2
        outline = square(self.room.side * (modules + 2) / modules)
        # The middle of the top left module is the origin.
        module, middle = self.room.side / modules, (len(sheet) - 1) / 2
        to_sheet = np.array([[1 / module, 0, middle], [0, -1 / module, middle], [0, 0, 1]])
        patch = self._patch(pose, marker.pose, outline, to_sheet)
        if patch is None:
            return
        height, width = patch.at.shape[1:]
        at, by_u, by_v = (field.reshape(2, -1) for field in (patch.at, patch.by_u, patch.by_v))
        column, row = self._spread(at, by_u, by_v, self._jitter[:, *patch.part])
        seen = cv2.remap(
            sheet,
            column.reshape(-1, width),
            row.reshape(-1, width),
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
        )
        grey, hit = cv2.split(np.asarray(seen, np.float32).reshape(-1, height, width, 2).mean(axis=0))
        image[patch.part] += grey - hit * image[patch.part]

    def _put(self, image: Singles, box: Box, textures: tuple[Image, ...], pose: Array) -> None:
        """Draws the box into `image`: at the edge of two faces, all but one ray in some ten thousand hit either."""
        seen = [self._face(image, face, texture, pose) for face, texture in zip(box.faces, textures, strict=True)]
        for part, change in (found for found in seen if found is not None):
            image[part] += change

    def _face(self, image: Singles, face: Face, texture: Image, pose: Array) -> tuple[Part, Singles] | None:
        """The contribution of a box's face to `image`, and its place; None: invisible."""
        rows, columns = texture.shape
        across, down = columns / face.width, rows / face.height
        to_texture = np.array([[across, 0, (columns - 1) / 2], [0, -down, (rows - 1) / 2], [0, 0, 1]])
        patch = self._patch(pose, face.pose, (face.outline - face.pose[:3, 3]) @ face.pose[:3, :3], to_texture)
        if patch is None:
            return None
        size = np.array([[columns], [rows]]) - np.float32(0.5)
        inside = ((patch.at > -0.5) & (patch.at < size[:, :, None])).all(axis=0)
        hit = np.asarray(inside, np.float32)
        # Only a pixel with a different neighbour can be partly on the face.
        edge = np.nonzero(cv2.morphologyEx(np.asarray(inside, np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)))
        at, by_u, by_v = (field[:, *edge] for field in (patch.at, patch.by_u, patch.by_v))
        at = np.stack(self._spread(at, by_u, by_v, self._jitter[:, *patch.part][:, *edge]))
        hit[edge] = ((at > -0.5) & (at < size[:, None])).all(axis=0).mean(axis=0)
        column, row = patch.at
        grey = cv2.remap(texture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return patch.part, np.asarray(hit * (grey - image[patch.part]), np.float32)

    def _patch(self, pose: Array, plane: Array, outline: Array, to_texture: Array) -> Patch | None:
        """The visible front of a plane of pose `plane` (4, 4) T_world_plane within `outline` (n, 3) m on it."""
        if plane[:3, 2] @ (pose[:3, 3] - plane[:3, 3]) <= 0:
            return None
        turn, shift = pose[:3, :3].T @ plane[:3, :3], (plane[:3, 3] - pose[:3, 3]) @ pose[:3, :3]
        part = self.lens.crop(outline @ turn.T + shift)
        if part is None:
            return None
        return self.lens.patch(part, to_texture @ np.linalg.inv(np.column_stack((turn[:, :2], shift))))

    def _spread(self, at: Singles, by_u: Singles, by_v: Singles, shift: Singles) -> tuple[Singles, Singles]:
        """(samples, n) columns and rows at which the rays of n pixels meet a plane, from the `Patch` of (2, n) each."""
        shift_u, shift_v = shift.reshape(2, -1)
        at = np.asarray(at + shift_u * by_u + shift_v * by_v, np.float32)
        column, row = (self._lattice @ np.stack((by_u[i], by_v[i])) + at[i] for i in range(2))
        return column, row
