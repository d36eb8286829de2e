"""Frames of markers in mid-air in a room, at exact distances, with their true poses.

Results on them evaluate the front end alone: there is no drive, and no marker is favoured by the path.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.camera.camera import Camera
from ...frontend.camera.shutter import CameraMotion
from ...frontend.markers.aruco import Image, square
from ...frontend.markers.markers import find
from .clutter import BLUR, DICTIONARY
from .render import Renderer
from .room import Marker, Room
from .sensor import IDEAL, Sensor
from .sheet import PERFECT, Print
from .surfaces import Surfaces, paint

SIDE = 0.16  # m, side of a marker

HALL = Room(14.0, 5.0, 2.5, SIDE, (), lamp=(-6.0, 0.0, 2.4))
"""The room around the markers, its lamp above the camera."""

EYE = np.array([[0.0, 0.0, 1.0, -6.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.8], [0.0, 0.0, 0.0, 1.0]])
"""T_world_camera: at one end of the hall, level, looking along it."""

RIM = 2.0  # px of the frame around a sheet of paper

TRIES = 2000

SWAY = np.array([1.0, 1.0, 0.3])
"""Mean turn rates of the camera about its x, y and z axes, relative to each other."""

ADVANCE = 0.3
"""Distance moved by the camera while it turns by a radian, on average, in distances to the marker."""


LEAST = 100.0
"""px, at least, by which a marker moves per radian of a motion: where turn and shift nearly cancel, a camera would have
to move at tens of metres per second to draw it out."""


class Placement(NamedTuple):
    """A frame with one marker."""

    id: int
    pose: Array  # (4, 4) T_camera_marker, in the middle of the exposure
    image: Image
    motion: CameraMotion | None = None  # exact, of a camera with a rolling shutter; None: of others


class Swayed(NamedTuple):
    """A motion of the camera around the middle of a frame."""

    parts: Array  # T_middle_camera: (n, 4, 4) of the exposure's parts; (b, n, 4, 4) of each band's of a rolling shutter
    motion: CameraMotion | None  # of a rolling shutter


class Crowd(NamedTuple):
    """A frame with several markers, none in front of another."""

    ids: tuple[int, ...]
    poses: tuple[Array, ...]  # (4, 4) T_camera_marker each
    image: Image


@dataclass(frozen=True, eq=False)
class Studio:
    """A camera in the hall, and the markers in front of it."""

    camera: Camera
    samples: int = 8
    tilt: float = np.pi / 4  # rad, largest angle between a marker's normal and the line of sight
    sensor: Sensor = IDEAL  # its exposure is unused: `sway` says how far the camera moves in pixels
    prints: Print = PERFECT

    def place(self, distance: float, rng: np.random.Generator, streak: float = 0.0, skew: float = 0.0) -> Placement:
        """A frame with one marker of random id and place in view, `distance` m from the camera.

        With a `streak` the camera moves during the exposure, and draws the marker out to between 0 and that many px;
        with a `skew`, its sensor has to have a time of readout, between the first row and the last of which the marker
        moves by between 0 and that many px. With both it is the same share of both.
        """
        pose, _ = self.hang(distance, rng)
        (name,) = self.any_id(rng)
        if not (streak or skew):
            return Placement(name, pose, self.take({name: pose}, rng))
        share = rng.uniform(0, 1)
        swayed = self.sway(pose, share * streak, rng, share * skew)
        return Placement(name, pose, self.take({name: pose}, rng, swayed.parts), swayed.motion)

    def hang(self, distance: float, rng: np.random.Generator) -> tuple[Array, Array]:
        """T_camera_marker of a marker at a random place in view, randomly turned, and its sheet's corners (4, 2) px.

        Its centre is `distance` m from the camera, and its normal uniformly distributed within `tilt` of the line of
        sight. InputError if no sheet fits into the frame.
        """
        size = np.array([self.camera.width, self.camera.height])
        modules = find(DICTIONARY).markerSize + 2
        outline = square(SIDE * (modules + 2) / modules)
        for _ in range(TRIES):
            ray = np.append(self.camera.undistort(rng.uniform(0, size - 1)[None])[0], 1.0)
            toward, lean, roll = rng.uniform(-np.pi, np.pi), np.arccos(rng.uniform(np.cos(self.tilt), 1)), rng.uniform()
            if not np.isfinite(ray).all():
                continue
            sight = ray / np.linalg.norm(ray)
            across = np.cross([0.0, 1.0, 0.0], -sight)
            across /= np.linalg.norm(across)
            facing = np.column_stack((across, np.cross(-sight, across), -sight))
            pose = np.eye(4)
            axis = np.array([np.cos(toward), np.sin(toward), 0.0])
            pose[:3, :3] = facing @ _turn(lean * axis) @ _turn(np.array([0, 0, 2 * np.pi * roll]))
            pose[:3, 3] = distance * sight
            corners = outline @ pose[:3, :3].T + pose[:3, 3]
            if (np.hypot(*corners[:, :2].T) < self.camera.reach * corners[:, 2]).all():
                seen = self.camera.project(corners)
                if (seen >= RIM).all() and (seen <= size - 1 - RIM).all():
                    return pose, seen
        raise InputError(f"placements: a marker {distance:g} m away does not fit into the frame")

    def take(self, markers: dict[int, Array], rng: np.random.Generator, motion: Array | None = None) -> Image:
        """A frame of the markers (id -> T_camera_marker), while the camera moves through `motion`, if given.

        That is (n, 4, 4), T_start_camera of each part of the exposure, or (b, n, 4, 4), of each band of rows.
        """
        hung = tuple(Marker(name, EYE @ pose) for name, pose in markers.items())
        renderer = replace(self._empty, room=replace(self._empty.room, markers=hung))
        return renderer.frame(EYE if motion is None else EYE @ motion, rng)

    def sway(self, pose: Array, streak: float, rng: np.random.Generator, skew: float = 0.0) -> Swayed:
        """An even random motion that draws a marker out to `streak` px: the mean of its corners' streaks.

        With a `skew`, that many px pass between the first row and the last of the sensor's readout.
        """
        corners = square(SIDE) @ pose[:3, :3].T + pose[:3, 3]
        little = 1e-4
        while True:
            turn, shift = SWAY * rng.normal(size=3), ADVANCE * np.linalg.norm(pose[:3, 3]) * rng.normal(size=3)
            ends = [self.camera.project((corners - by * shift) @ _turn(by * turn)) for by in (-little, little)]
            by_amount = np.linalg.norm(ends[1] - ends[0], axis=1).mean() / (2 * little)
            if by_amount >= LEAST:
                break
        parts = int(np.ceil(streak)) + 1
        within = streak / by_amount * ((np.arange(parts) + 0.5) / parts - 0.5)
        if not skew:
            return Swayed(_moved(within, turn, shift), None)
        pace = skew / by_amount / self.sensor.readout
        rows = pace * self.sensor.delays(self.camera.height)
        rates = pace * np.concatenate((turn, shift))
        return Swayed(
            np.array([_moved(later + within, turn, shift) for later in rows]), CameraMotion(rates, np.zeros((6, 6)))
        )

    def any_id(self, rng: np.random.Generator, count: int = 1) -> tuple[int, ...]:
        """That many different ids of the dictionary."""
        return tuple(int(name) for name in rng.choice(len(find(DICTIONARY).bytesList), count, replace=False))

    @cached_property
    def _empty(self) -> Renderer:
        return Renderer(
            HALL,
            self.camera,
            DICTIONARY,
            _walls(),
            blur=BLUR,
            sensor=self.sensor,
            prints=self.prints,
            samples=self.samples,
        )


def placements(
    camera: Camera,
    distance: float,
    count: int,
    rng: np.random.Generator,
    samples: int = 8,
    streak: float = 0.0,
    skew: float = 0.0,
    sensor: Sensor = IDEAL,
    prints: Print = PERFECT,
) -> Iterator[Placement]:
    """Yields `count` frames, each with a marker of random id and place in view, `distance` m from the camera.

    `streak` and `skew` are those of `Studio.place`.
    """
    studio = Studio(camera, samples=samples, sensor=sensor, prints=prints)
    for _ in range(count):
        yield studio.place(distance, rng, streak, skew)


def crowds(
    camera: Camera,
    distances: tuple[float, float],
    markers: int,
    count: int,
    rng: np.random.Generator,
    samples: int = 8,
    sensor: Sensor = IDEAL,
    prints: Print = PERFECT,
) -> Iterator[Crowd]:
    """Yields `count` frames with that many markers of different ids, each between two distances, m, from the camera.

    Their sheets' circles in the frame do not overlap. InputError if there is no room.
    """
    studio = Studio(camera, samples=samples, sensor=sensor, prints=prints)
    for _ in range(count):
        ids = studio.any_id(rng, markers)
        poses = _apart(studio, distances, markers, rng)
        yield Crowd(ids, poses, studio.take(dict(zip(ids, poses, strict=True)), rng))


def _apart(studio: Studio, distances: tuple[float, float], markers: int, rng: np.random.Generator) -> tuple[Array, ...]:
    """Poses whose sheets do not cover each other."""
    poses, circles = list[Array](), list[Array]()
    for _ in range(TRIES):
        pose, corners = studio.hang(rng.uniform(*distances), rng)
        middle = corners.mean(axis=0)
        circle = np.append(middle, np.linalg.norm(corners - middle, axis=1).max())
        if all(np.linalg.norm(circle[:2] - other[:2]) > circle[2] + other[2] for other in circles):
            poses.append(pose)
            circles.append(circle)
        if len(poses) == markers:
            return tuple(poses)
    raise InputError(
        f"placements: found no room in the frame for {markers} markers, expected fewer or {distances[0]:g} m and more"
    )


@cache
def _walls() -> Surfaces:
    return paint(HALL, np.random.default_rng(1))


def _moved(amounts: Array, turn: Array, shift: Array) -> Array:
    """(n, 4, 4) the motion by `turn` (3,) rad and `shift` (3,) m, times each of the `amounts` (n,)."""
    motion = np.tile(np.eye(4), (len(amounts), 1, 1))
    for part, by in zip(motion, amounts, strict=True):
        part[:3, :3], part[:3, 3] = _turn(by * turn), by * shift
    return motion


def _turn(vector: Array) -> Array:
    """(3, 3) the rotation about `vector` (3,) by its length, rad."""
    return np.asarray(cv2.Rodrigues(np.asarray(vector, float))[0], float)
