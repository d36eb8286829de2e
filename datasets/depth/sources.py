"""The parts that a depth camera's recording of any kind has: images, cameras and odometry."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from ...core.factors import Truth
from ...frontend.camera.camera import Camera
from ...frontend.wheels.track import Poses
from .registering import Registration
from .shots import Shot


class Sources(NamedTuple):
    """The result of every reader."""

    images: Callable[[], Iterable[Shot]]  # grey or BGR
    depths: Callable[[], Iterable[Shot]]  # m
    camera: Camera  # of the images, with its mounting
    registration: Registration | None  # None: depths are of the images' pixels
    readings: Poses | None  # the odometry
    topics: dict[str, str]  # what was read, for the notes
    length: int | None  # number of images
    remarks: list[str]
    truth: Truth | None = None  # of the recording itself
