"""The part of a camera's pixels that its images have: the region of interest and binning of sensor_msgs/CameraInfo."""

from typing import NamedTuple

from ...core.errors import InputError
from ...frontend.camera.camera import Camera
from .bag import Bag, Topic
from .cameras import IMAGE
from .images import compressed


class Window(NamedTuple):
    """The part of a camera's pixels that its images have, as a camera_info says."""

    whole: tuple[int, int]  # px, width and height of the camera
    corner: tuple[int, int]  # px, of its region of interest
    size: tuple[int, int]  # px
    binning: tuple[int, int]  # pixels that are combined, across and down

    def of(self, camera: Camera) -> Camera:
        """That part of a camera of the whole size."""
        return camera.window(self.corner, self.size, self.binning)


def window_of(bag: Bag, topic: Topic, images: Topic) -> Window | None:
    """The part of the camera whose camera_info is `topic` that the `images` are of; None for all of it.

    Some drivers say so of images that the numbers of camera_info are of already: these have its whole size. InputError
    for a part that is not of the camera.
    """
    message = next(bag.contents(topic.name))
    if message is None:
        return None
    roi, whole = message.roi, (message.width, message.height)
    corner, size = (roi.x_offset, roi.y_offset), (roi.width or whole[0], roi.height or whole[1])
    binning = message.binning_x or 1, message.binning_y or 1
    if not all(whole) or (corner, size, binning) == ((0, 0), whole, (1, 1)) or _size_of(bag, images) == whole:
        return None
    ends = [start + length for start, length in zip(corner, size, strict=True)]
    if any(end > side for end, side in zip(ends, whole, strict=True)) or any(
        part > length for part, length in zip(binning, size, strict=True)
    ):
        raise InputError(
            f"{bag.path}: topic {topic.name}: found a region of interest of {size[0]}x{size[1]} pixels from "
            f"{corner[0]}, {corner[1]} on, binned by {binning[0]}x{binning[1]}, expected a part of the "
            f"{whole[0]}x{whole[1]} of its camera."
        )
    return Window(whole, corner, size, binning)


def _size_of(bag: Bag, topic: Topic) -> tuple[int, int] | None:
    """Width and height of the first image that can be read, px; None if there is none."""
    for message in bag.contents(topic.name):
        if message is None:
            continue
        if topic.type == IMAGE:
            return message.width, message.height
        image = compressed(message)
        if image is not None:
            return image.shape[1], image.shape[0]
    return None
