"""Converts images in ROS messages to grey or BGR frames.

The encodings are those of sensor_msgs/image_encodings.h. Of 16-bit values the upper 8 bits are kept, as by cv_bridge.
"""

from typing import Any, NamedTuple

import cv2
import numpy as np

from ...frontend.camera.quiet_decoders import silenced
from ...frontend.markers.aruco import Image


class _Layout(NamedTuple):
    """Memory layout of an encoding, and its conversion to grey or BGR."""

    depth: int  # bytes per value
    values: int  # values per pixel
    conversion: int | None = None  # OpenCV's; None: not needed


# OpenCV's older names of Bayer patterns refer to the second row; these are its newer names, which match ROS's.
_BAYER = {
    "rggb": cv2.COLOR_BayerRGGB2BGR,
    "bggr": cv2.COLOR_BayerBGGR2BGR,
    "gbrg": cv2.COLOR_BayerGBRG2BGR,
    "grbg": cv2.COLOR_BayerGRBG2BGR,
}

_LAYOUTS = {
    "mono8": _Layout(1, 1),
    "8UC1": _Layout(1, 1),
    "mono16": _Layout(2, 1),
    "16UC1": _Layout(2, 1),
    "bgr8": _Layout(1, 3),
    "8UC3": _Layout(1, 3),
    "rgb8": _Layout(1, 3, cv2.COLOR_RGB2BGR),
    "bgr16": _Layout(2, 3),
    "rgb16": _Layout(2, 3, cv2.COLOR_RGB2BGR),
    "bgra8": _Layout(1, 4, cv2.COLOR_BGRA2BGR),
    "8UC4": _Layout(1, 4, cv2.COLOR_BGRA2BGR),
    "rgba8": _Layout(1, 4, cv2.COLOR_RGBA2BGR),
    **{f"bayer_{pattern}8": _Layout(1, 1, code) for pattern, code in _BAYER.items()},
    **{f"bayer_{pattern}16": _Layout(2, 1, code) for pattern, code in _BAYER.items()},
    "yuv422": _Layout(1, 2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": _Layout(1, 2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": _Layout(1, 2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": _Layout(1, 2, cv2.COLOR_YUV2BGR_YUY2),
}

_PLANAR = {"nv21": cv2.COLOR_YUV2BGR_NV21, "nv12": cv2.COLOR_YUV2BGR_NV12}
"""Encodings with a plane of brightness and below it one of colours, of half as many rows and columns."""

ENCODINGS = (*_LAYOUTS, *_PLANAR)  # supported encodings of sensor_msgs/Image


def raw(message: Any) -> Image | None:
    """The (height, width) grey or (height, width, 3) BGR image of a sensor_msgs/Image; None if undecodable."""
    if message.encoding.lower() in _PLANAR:
        return _planar(message, _PLANAR[message.encoding.lower()])
    layout = _LAYOUTS.get(message.encoding)
    height, width, content = message.height, message.width, message.data
    if layout is None or height == 0 or width == 0:
        return None
    row = width * layout.values * layout.depth
    step = message.step or row
    if step < row or len(content) < step * (height - 1) + row:
        return None
    kind = np.dtype("u1" if layout.depth == 1 else ">u2" if message.is_bigendian else "<u2")
    strides = (step, layout.values * layout.depth, layout.depth)
    pixels = np.ndarray((height, width, layout.values), kind, content, 0, strides)
    return _frame(pixels, layout.conversion)


def compressed(message: Any) -> Image | None:
    """The image of a sensor_msgs/CompressedImage in any format that OpenCV reads; None if undecodable.

    The part before the format's semicolon, as in `bayer_rggb8; png compressed`, is the encoding of the pixels, unless
    the rest says that they were converted.
    """
    meant, _, how = message.format.partition(";")
    try:
        with silenced():
            pixels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    if pixels is None or pixels.dtype.str[1:] not in ("u1", "u2"):
        return None
    mosaic = _LAYOUTS.get(meant.strip()) if pixels.ndim == 2 and how.strip().endswith("compressed") else None
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    conversion = {1: mosaic.conversion if mosaic else None, 4: cv2.COLOR_BGRA2BGR}.get(pixels.shape[2])
    return _frame(pixels, conversion)


def _planar(message: Any, conversion: int) -> Image | None:
    """The image of two planes; None if undecodable.

    Drivers do not agree on what `step` and `height` mean: rows may be those of the image, or of both planes.
    """
    width, content = message.width, np.asarray(message.data, np.uint8)
    for height in (message.height, message.height * 2 // 3):
        if not width or not height or width % 2 or height % 2:
            continue
        for step in (message.step, width):
            rows = height + height // 2
            if step >= width and len(content) == step * rows:
                return _frame(content.reshape(rows, step, 1)[:, :width], conversion)
    return None


def _frame(pixels: np.ndarray, conversion: int | None) -> Image | None:
    """Converts pixels (height, width, values) of 8 or 16 bits to an 8-bit grey or BGR image; None if OpenCV cannot."""
    if pixels.dtype.itemsize == 2:
        pixels = pixels >> 8
    image = np.ascontiguousarray(pixels, np.uint8)
    if image.shape[2] == 1:
        image = image[:, :, 0]
    try:
        # Patterns that need even numbers of rows or columns may fail.
        return image if conversion is None else np.asarray(cv2.cvtColor(image, conversion), np.uint8)
    except cv2.error:
        return None
