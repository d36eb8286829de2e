"""Renders frames of a room with markers and boxes through a camera with lens distortion.

The background is sampled by one ray per pixel to the floor or a wall; the markers' sheets of paper and the edges of
boxes by many, so that edges are accurate to a few thousandths of a pixel. Grey levels are linear in light, on which
lens and exposure act.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Image
from ._background import meet, meet_all
from .boxes import Box, Face
from .lattice import jitter, lattice
from .lens import Lens, Part, Patch, Singles, bands, dispersed, through
from .people import NOBODY
from .room import Marker, Room
from .sensor import IDEAL, LINES, Sensor
from .sheet import PERFECT, Print, Sheet, printed_sheets
from .surfaces import DENSITY, Surfaces

BAND = 30  # rows of a frame processed at a time: as much as fits a core's cache
CEILING = 188.0  # grey level above the walls
BEHIND = 0.01  # share of its distance by which a marker may be behind a surface and still be on it


class Cover(NamedTuple):
    """An occluder close to the lens."""

    share: Singles  # (height, width) share of each pixel's light that it blocks
    grey: float  # its own grey level


class Conditions(NamedTuple):
    """Conditions that vary between frames."""

    light: float | Singles = 1.0  # times the light of the scene, or (height, width)
    cover: Cover | None = None
    people: Array = NOBODY  # (c, 6) cylinders, as in `people`, of a building; they stand still while it is exposed


CLEAR = Conditions()


@dataclass(frozen=True, eq=False)
class Renderer:
    """Takes pictures of one room with one camera.

    Markers that are on no box must be behind every box, as those on floor and walls are. In a building, which has no
    boxes, walls and people hide what is behind them; their own edges are of one ray per pixel.
    """

    room: Room
    camera: Camera
    dictionary: str
    surfaces: Surfaces
    blur: float = 0.6  # px, standard deviation of the lens blur
    sensor: Sensor = IDEAL
    prints: Print = PERFECT  # of all markers
    samples: int = 6  # its square is the number of rays per pixel, for the markers and the boxes' edges
    vignetting: float = 0.4  # strength of the light's falloff towards the corners; 1: the fourth power of the cosine
    printed: Mapping[int, NDArray[np.bool_]] = field(default_factory=dict[int, NDArray[np.bool_]])  # id -> bits (n, n),
    # True is white, of markers that are not as in the dictionary

    def frame(self, poses: Array, rng: np.random.Generator, conditions: Conditions = CLEAR) -> Image:
        """(height, width) grey, seen from `poses` as in `light`. Grey levels saturate at 255."""
        return self.exposed(self.light(poses, conditions.people), rng, conditions)

    def light(self, poses: Array, people: Array = NOBODY) -> Singles:
        """(height, width) the grey levels seen from `poses` T_world_camera, before lens and sensor.

        `poses` are one, (4, 4); or (n, 4, 4), and the light is their mean; or (b, n, 4, 4), those of each of the bands
        of rows that a rolling shutter reads. With chromatic aberration the light is (3, height, width).
        """
        if poses.ndim == 4:
            of_bands = [band.light(own, people) for band, own in zip(self.bands, poses, strict=True)]
            return np.concatenate(of_bands, axis=-2)
        if self._dispersed:
            return np.stack([colour.light(poses, people) for colour in self._dispersed])
        first, *others = poses.reshape(-1, 4, 4)
        image = self.scene(first, people)
        for other in others:
            image += self.scene(other, people)
        if others:
            image /= 1 + len(others)
        return image

    def exposed(self, image: Singles, rng: np.random.Generator, conditions: Conditions = CLEAR) -> Image:
        """The picture that lens and sensor make of `image`, grey levels as `light` has them, which are overwritten."""
        image *= self._transmission
        image *= conditions.light
        if conditions.cover is not None:
            image += conditions.cover.share * (np.float32(conditions.cover.grey) * self._transmission - image)
        if self.blur > 0:
            planes = [cv2.GaussianBlur(plane, (0, 0), self.blur) for plane in image.reshape(-1, *image.shape[-2:])]
            image = np.asarray(planes[0] if len(planes) == 1 else np.stack(planes), np.float32)
        return self.sensor.picture(image, rng)

    def scene(self, pose: Array, people: Array = NOBODY) -> Singles:
        """(height, width) the grey levels seen from `pose` (4, 4), before lens and sensor."""
        if self.room.walls is not None:
            return self._building(pose, people)
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

    def _building(self, pose: Array, people: Array) -> Singles:
        """(height, width) a building as `scene` has it."""
        rays, room = self.lens.rays.reshape(3, -1), self.room
        turn, eye = pose[:3, :3].astype(np.float32), pose[:3, 3]
        turned = turn @ rays
        at, reach, shade = np.empty_like(turned), np.empty_like(turned[0]), np.empty_like(turned[0])
        top = self.surfaces.wall_row / DENSITY + room.height
        size = room.length / 2, room.width / 2, top, float(DENSITY)
        meet_all(turned, eye, self._walls, people, size, at, reach, shade)
        shape = self.lens.rays.shape[1:]
        column, row, z = at.reshape(3, *shape)
        grey = shade.reshape(shape)
        image = np.asarray(
            cv2.remap(self.surfaces.image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32
        )
        image[z > room.height] = CEILING
        image = np.where(grey >= 0, grey, image)
        for marker in sorted(room.markers, key=lambda m: -float(np.linalg.norm(m.pose[:3, 3] - eye))):
            normal, off = marker.pose[:3, 2], marker.pose[:3, 3] - eye
            with np.errstate(divide="ignore", invalid="ignore"):
                own = (normal @ off).astype(np.float32) / (normal.astype(np.float32) @ turned)
            self._draw(image, marker, pose, (own <= (1 + BEHIND) * reach).reshape(shape))
        return image

    @cached_property
    def _walls(self) -> Array:
        """(w, 5) the building's walls, and where on the painted walls each begins, m."""
        walls = self.room.outlines
        long = np.hypot(*(walls[:, 2:] - walls[:, :2]).T)
        start = np.mod(np.cumsum(long) - long, np.maximum(self.room.perimeter - long, 1 / DENSITY))
        return np.column_stack((walls, start))

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
    def bands(self) -> list["Renderer"]:
        """A renderer for each band of rows that a rolling shutter reads."""
        return [replace(self, camera=camera) for camera in bands(self.camera, LINES)]

    @cached_property
    def _dispersed(self) -> list["Renderer"]:
        """A renderer for red, green and blue each, where the lens images them at different sizes; else none."""
        if not self.sensor.aberration:
            return []
        sensor, share = replace(self.sensor, aberration=0.0), self.sensor.aberration
        return [replace(self, camera=camera, sensor=sensor) for camera in dispersed(self.camera, share)]

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
    def _sheets(self) -> dict[int, Sheet]:
        ids = [marker.id for marker in self.room.markers]
        return printed_sheets(self.dictionary, ids, self.room.side, self.printed, self.prints)

    def _draw(self, image: Singles, marker: Marker, pose: Array, seen_at: NDArray[np.bool_] | None = None) -> None:
        """Draws the marker's sheet into `image`, if the camera is in front of it, and where nothing hides it."""
        sheet = self._sheets[marker.id]
        patch = self._patch(pose, marker.pose, sheet.outline, sheet.to_sheet)
        if patch is None:
            return
        height, width = patch.at.shape[1:]
        at, by_u, by_v = (field.reshape(2, -1) for field in (patch.at, patch.by_u, patch.by_v))
        column, row = self._spread(at, by_u, by_v, self._jitter[:, *patch.part])
        turn, place = marker.pose[:3, :3], marker.pose[:3, 3]
        eye = (pose[:3, 3] - place) @ turn
        seen = sheet.grey(column.reshape(-1, width), row.reshape(-1, width), eye)
        grey, hit = cv2.split(seen.reshape(-1, height, width, 2).mean(axis=0))
        if seen_at is not None:
            grey, hit = grey * seen_at[patch.part], hit * seen_at[patch.part]
        image[patch.part] += grey - hit * image[patch.part]
        if self.prints.gloss:
            image[patch.part] += hit * sheet.highlight(patch.at, eye, (self.room.lamp_at - place) @ turn)

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
