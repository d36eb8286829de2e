"""A recording without pictures: its detector returns given sightings, with errors of known size."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from slamduel.core.factors import Map, Prior, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.shutter import CameraMotion
from slamduel.frontend.markers.aruco import Detector, Image, Rejections, Sighting, square
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.markers.noise import ProportionalNoise
from slamduel.frontend.markers.pipeline import Frame, Recording
from slamduel.frontend.wheels.track import Track, TrackNoise

MOUNTING = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.3], [0, 0, 0, 1]])  # at the robot's origin, level
CAMERA = Camera(320, 240, (300.0, 300.0), (159.5, 119.5), (), MOUNTING)
SIDE = 0.16
K, FLOOR = np.array([0.02, 0.05]), np.array([0.01, 0.004])
"""Standard deviations of the true errors, in range and bearing."""


@dataclass(frozen=True, eq=False)
class Told(Detector):
    """Returns the sightings given for the frame whose number is in the image's first two pixels."""

    told: tuple[tuple[list[Sighting], Rejections], ...] = ()

    def detect(self, image: Image, motion: CameraMotion | None = None) -> tuple[list[Sighting], Rejections]:
        """Returns the given sightings."""
        return self.told[256 * int(image[0, 0]) + int(image[0, 1])]


def picture(number: int) -> Image:
    """A grey image that encodes its number."""
    image = np.full((240, 320), 90, np.uint8)
    image[0, :2] = divmod(number, 256)
    return image


def sighting(name: int, range_: float, bearing: float, ambiguity: float = 0.01) -> Sighting:
    """A marker that faces the camera, with its corners as projected."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (-range_ * np.sin(bearing), 0.0, range_ * np.cos(bearing))
    corners = CAMERA.project(square(SIDE) @ pose[:3, :3].T + pose[:3, 3])
    return Sighting(name, corners, 0.01 * np.eye(8), pose, pose[:3, 3], 1e-4 * np.eye(6), 0.1 + 0.01 * name, ambiguity)


def small_recording(rng: np.random.Generator, frames: int = 60, **changes: Any) -> tuple[Recording, Truth]:
    """A drive on a circle around markers 0 to 15; every tenth frame is empty, every 15th has a rejection."""
    t = np.arange(0.0, frames) * 0.2
    around = 0.3 * t
    poses = np.stack((1.5 * np.sin(around), 1.5 - 1.5 * np.cos(around), wrap(around)), axis=-1)
    angle = 2 * np.pi * np.arange(16) / 16
    away = np.where(np.arange(16) % 2, 3.2, 0.4)
    places = np.stack((away * np.cos(angle), 1.5 + away * np.sin(angle)), axis=-1)
    told = [_told(k, pose, places, rng) for k, pose in enumerate(poses)]
    settings: dict[str, Any] = {
        "name": "told <b>",
        "frames": _frames(t),
        "motion": Track(t, poses, TrackNoise()),
        "detector": Told(Markers("4X4_50", SIDE), CAMERA, told=tuple(told)),
        "noise": ProportionalNoise(),
        "prior": Prior(poses[0], 1e-6 * np.eye(3)),
    }
    return Recording(**(settings | changes)), Truth(t, poses, Map(np.arange(16), places, None), None, "truth")


def _frames(t: Array) -> Iterator[Frame]:
    return (Frame(float(time), picture(k)) for k, time in enumerate(t))


def _told(number: int, pose: Array, places: Array, rng: np.random.Generator) -> tuple[list[Sighting], Rejections]:
    away = places - pose[:2]
    true = np.stack((np.hypot(*away.T), wrap(np.arctan2(away[:, 1], away[:, 0]) - pose[2])), axis=-1)
    z = true + np.hypot(K * true, FLOOR) * rng.normal(size=true.shape)
    seen = [] if number % 10 == 9 else np.flatnonzero((np.abs(z[:, 1]) < 0.9) & (z[:, 0] > 0.3)).tolist()
    rejected = Rejections({"same id twice in a frame": 1} if number % 15 == 4 else {})
    rejected.twice = (99,) if rejected else ()
    return [sighting(name, *z[name], ambiguity=0.9 if name == 3 else 0.01) for name in seen], rejected
