"""The camera of raw and of rectified images: by a bag's camera_info, and by a calibration beside the bag."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...frontend.camera.camera import Camera
from .bag import Bag, Topic

REZOOMED = 0.005
"""Share of the focal length, and of a coefficient of 1, by which a camera_info may change without a remark."""


class Recorded(NamedTuple):
    """A camera as its camera_info tells, mounted at the robot's origin."""

    camera: Camera | None
    lacking: str = ""  # where there is none: why


def is_rectified(images: str) -> bool:
    """Tells by the name of a topic if its images are rectified: image_rect, image_rect_color, rect/image ... (REP 104).

    The camera of such images is P of its camera_info, without distortion.
    """
    return re.search(r"(?<![a-z0-9])(rect|rectified|undistorted)(?![a-z0-9])", images.lower()) is not None


def camera_of(bag: Bag, topic: Topic, images: Topic, remarks: list[str]) -> Recorded:
    """The camera of the topic of `images`, by its `topic` of camera_info; `remarks` grows where that changes."""
    from ...frontend.camera.calibration import from_camera_info

    messages = enumerate(bag.contents(topic.name), start=1)
    number, first = next(messages)
    if first is None:
        raise InputError(f"{bag.path}: message 1 of topic {topic.name} cannot be read.")
    if not _filled_in(first):  # as drivers send it before they have read their calibration
        number, first = next(((k, one) for k, one in messages if one is not None and _filled_in(one)), (1, first))
    if number > 1:
        remarks.append(f"{bag.path}: topic {topic.name} is zero until message {number}, which is used")
    remarks += _changed(bag, topic, first, messages)
    k, d, p = _matrices(first)
    rectified = is_rectified(images.name)
    if k[0] == 0:
        if not (p[0] and rectified):
            other = "has only P, the camera of rectified images" if p[0] else "is all zero, of an uncalibrated camera"
            return Recorded(None, f"topic {topic.name} is there, but {other}")
        k, d = p.reshape(3, 4)[:, :3].ravel(), np.zeros(5)
    where = f"{bag.path}: topic {topic.name}"
    camera = from_camera_info(where, first.width, first.height, first.distortion_model, k, d, p, np.eye(4))
    if not rectified:
        return Recorded(camera)
    lacking = f"P of topic {topic.name}, the camera of rectified images, is zero, and those of {images.name} are such"
    return Recorded(camera.rectified, lacking if camera.rectified is None else "")


def of_images(given: Camera, recorded: Camera | None, images: str, where: str, remarks: list[str]) -> Camera:
    """The camera of the topic `images` by a calibration that was `given` beside the bag, where they are rectified.

    Where that does not tell, it is the `recorded` one, if any; `remarks` grows by that.
    """
    if not is_rectified(images) or given.rectified is not None:
        return (given.rectified if is_rectified(images) else None) or given
    odd = f"{where}: the images of topic {images} are rectified, but the calibration beside it is of distorted ones"
    if recorded is None:
        remarks.append(f"{odd}, without the projection_matrix of rectified ones: ranges may be wrong by a tenth")
        return given
    remarks.append(f"{odd}, without a projection_matrix: P of camera_info is used")
    return replace(given, focal=recorded.focal, centre=recorded.centre, distortion=recorded.distortion, model="pinhole")


def _filled_in(message: Any) -> bool:
    k, _, p = _matrices(message)
    return bool(k[0] or p[0])


def _changed(bag: Bag, topic: Topic, first: Any, others: Iterator[tuple[int, Any]]) -> Iterator[str]:
    """Compares later messages of a camera_info, with their numbers, with the first, which counts."""
    begin = _matrices(first)
    for number, message in others:
        if message is None:
            continue
        k, d, p = _matrices(message)
        where = f"{bag.path}: message {number} of topic {topic.name}"
        size, before = (f"{one.width}x{one.height}" for one in (message, first))
        if size != before or message.distortion_model != first.distortion_model or len(d) != len(begin[1]):
            kinds = (f"{s} {one.distortion_model!r}" for s, one in ((size, message), (before, first)))
            yield "{} is of a camera of {}, the first, which is used, of {}".format(where, *kinds)
            return
        moved = np.abs(k - begin[0]).max(), np.abs(p - begin[2]).max()
        if max(moved) > REZOOMED * max(begin[0][0], begin[2][0]) or (np.abs(d - begin[1]) > REZOOMED).any():
            yield (
                f"{where} has fx = {k[0] or p[0]:.6g} px and the distortion {_shown(d)}, the first, which is used, "
                f"{begin[0][0] or begin[2][0]:.6g} px and {_shown(begin[1])}: perhaps the camera zooms"
            )
            return


def _shown(coefficients: np.ndarray) -> str:
    return f"[{', '.join(f'{one:.3g}' for one in coefficients)}]"


def _matrices(message: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K (9,), the distortion (d,) and P (12,) of a camera_info."""
    names = "KDP" if hasattr(message, "K") else "kdp"
    k, d, p = (np.asarray(getattr(message, name), float) for name in names)
    return k, d, p
