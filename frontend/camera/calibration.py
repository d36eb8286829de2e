"""Reads and writes calibration files: OpenCV's YAML, XML and JSON, and ROS's camera_info YAML.

Accepts OpenCV's key names as its samples of several years spell them, as JSON and .npz of scripts, too, and camera_info
both as ROS's calibrator saves it and as a printed message. `other_calibrations` has the formats of other programs. The
format is recognised by the content.

A camera's response is a mapping of its own, `camera_response`, which other readers of these files leave out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.files import write_whole
from ...core.se2 import Array
from .calibration_text import contents
from .camera import DISTORTION_LENGTHS, Camera, Model
from .other_calibrations import as_opencv
from .response import read_response

MODELS: dict[str, Model] = {
    "": "pinhole",
    "none": "pinhole",
    "pinhole": "pinhole",
    "plumb_bob": "pinhole",
    "radtan": "pinhole",
    "radial-tangential": "pinhole",
    "radial_tangential": "pinhole",
    "rational_polynomial": "pinhole",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
    "equi": "fisheye",
    "kannala_brandt": "fisheye",
    "kannalabrandt8": "fisheye",
}
"""Names of lens models in files and ROS messages -> the model."""

SHORTEST, LONGEST = 0.1, 100.0
"""Focal lengths over the image's side: a fisheye lens of 220 degrees has 0.26, a telescope of half a degree 100."""

RESPONSE = "camera_response"

_MATRIX = ("cameramatrix", "k", "m1", "intrinsicmatrix", "mtx", "cameramtx")
_LENS = (
    *("distortioncoefficients", "distcoeffs", "distortion", "d", "d1"),
    *("dist", "distcoeff", "distcoefs", "distcoef", "distortioncoeffs"),
)
_WIDTH, _HEIGHT, _SIZE = ("imagewidth", "width"), ("imageheight", "height"), ("imagesize", "size", "resolution")
_MODEL, _FISHEYE = ("distortionmodel", "cameramodel", "model"), ("fisheyemodel", "fisheye")
_PROJECTION = ("projectionmatrix", "p", "p1")
_RESPONSE = ("cameraresponse",)  # accepted keys, in lower case and without underscores


class _Entry(NamedTuple):
    """A value and the key it was found under."""

    key: str
    value: Any


def read(path: Path, mounting: Array, size: tuple[int, int] | None = None, which: str | None = None) -> Camera:
    """Reads a camera from a calibration file; `mounting` is (4, 4) T_robot_camera.

    `size`, width and height in px, is used where the file has none, as some of OpenCV's do not; `which` names one of
    several cameras. InputError names the file and key of what is missing or unusable.
    """
    found = as_opencv(path, contents(path), which)
    entries = {key.lower().replace("_", ""): _Entry(key, value) for key, value in found.items()}

    def find(names: Sequence[str], what: str | None = None) -> _Entry | None:
        entry = next((entries[name] for name in names if name in entries), None)
        if entry is None and what is not None:
            raise InputError(f"{path}: found no {what}, expected the keys of a calibration")
        return entry

    matrix = find(_MATRIX, "camera_matrix")
    assert matrix is not None
    # a matrix alone is that of a lens without distortion, or of rectified images
    about_lens = any(part in name for name in entries for part in ("dist", "coef", "fisheye"))
    lens = find(_LENS, "distortion_coefficients" if about_lens else None) or _Entry("distortion_coefficients", [])
    whole = find(_SIZE)
    if whole is not None and isinstance(whole.value, list | tuple) and len(whole.value) == 2:
        width, height = (_Entry(whole.key, side) for side in whole.value)
    else:
        width, height = find(_WIDTH), find(_HEIGHT)
    if width is None or height is None:
        if size is None:
            raise InputError(
                f"{path}: found no image_width and image_height, expected the size of its images, px: "
                "[camera] size = [640, 480] in robot.toml states it"
            )
        width, height = (_Entry("size", side) for side in size)
    model, flag = find(_MODEL), find(_FISHEYE)
    if model is None:
        fisheye = flag is not None and str(flag.value).strip().lower() in ("1", "true", "yes")
        model = _Entry("distortion_model", "fisheye" if fisheye else "pinhole")
    camera, response = _camera(str(path), (width, height), model, matrix, lens, mounting), find(_RESPONSE)
    projection = find(_PROJECTION)
    if projection is not None:
        camera = replace(camera, projection=_projection(str(path), projection))
    if response is None:
        return camera
    if not isinstance(response.value, Mapping):
        raise InputError(f"{path}: {response.key}: found {str(response.value)[:60]!r}, expected gamma, sharpening ...")
    return replace(camera, response=read_response(response.value, f"{path}: {response.key}"))


def from_camera_info(
    where: str,
    width: int,
    height: int,
    model: str,
    k: Sequence[float] | Array,
    d: Sequence[float] | Array,
    p: Sequence[float] | Array,
    mounting: Array,
) -> Camera:
    """Builds the camera of a ROS sensor_msgs/CameraInfo, `k` and `p` row-major; InputError begins with `where`."""
    size = _Entry("width", width), _Entry("height", height)
    camera = _camera(where, size, _Entry("distortion_model", model), _Entry("k", k), _Entry("d", d), mounting)
    return replace(camera, projection=_projection(where, _Entry("p", p)))


def write_opencv(path: Path, camera: Camera) -> None:
    """Writes the file OpenCV's own calibration sample would: XML or JSON if `path` ends so, otherwise YAML."""
    suffix = path.suffix.lower() if path.suffix.lower() in (".xml", ".json") else ".yml"
    storage = cv2.FileStorage(f"calibration{suffix}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width)
    storage.write("image_height", camera.height)
    storage.write("fisheye_model", int(camera.model == "fisheye"))
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_coefficients", camera.coefficients[None] if len(camera.distortion) else np.zeros((1, 5)))
    if camera.response is not None:
        storage.startWriteStruct(RESPONSE, cv2.FileNode_MAP)
        for name, value in camera.response.entries.items():
            storage.write(name, value)
        storage.endWriteStruct()
    write_whole(path, storage.releaseAndGetString())


def write_camera_info(path: Path, camera: Camera) -> None:
    """Writes the YAML file that ROS's camera_info_manager loads.

    ROS's plumb_bob has five coefficients: fewer are padded with zeros. Twelve and fourteen are written under
    rational_polynomial, as OpenCV's users in ROS expect.
    """
    (fx, fy), (cx, cy) = camera.focal, camera.centre
    lens = [*camera.coefficients.tolist(), *[0.0] * (5 - len(camera.distortion))]
    model = "plumb_bob" if len(lens) <= 5 else "rational_polynomial"
    if camera.model == "fisheye":
        lens, model = camera.coefficients.tolist(), "equidistant"
    lines = [
        f"image_width: {camera.width}",
        f"image_height: {camera.height}",
        'camera_name: "camera"',
        *_matrix("camera_matrix", 3, [fx, 0, cx, 0, fy, cy, 0, 0, 1]),
        f"distortion_model: {model}",
        *_matrix("distortion_coefficients", 1, lens),
        *_matrix("rectification_matrix", 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]),
        *_matrix("projection_matrix", 3, [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]),
    ]
    if camera.response is not None:
        lines += [f"{RESPONSE}:", *(f"  {name}: {_text(value)}" for name, value in camera.response.entries.items())]
    write_whole(path, "\n".join(lines) + "\n")


def _text(number: float) -> str:
    """The number as readers of YAML 1.1 know it for one: with a point, and a sign in its exponent."""
    text = repr(float(number))
    return text if "." in text else text.replace("e", ".0e")


def _matrix(name: str, rows: int, numbers: Sequence[float]) -> list[str]:
    texts = [_text(number) for number in numbers]
    return [f"{name}:", f"  rows: {rows}", f"  cols: {len(texts) // rows}", f"  data: [{', '.join(texts)}]"]


def _camera(
    where: str, size: tuple[_Entry, _Entry], model: _Entry, matrix: _Entry, lens: _Entry, mounting: Array
) -> Camera:
    width, height = (_side(where, entry) for entry in size)
    known = MODELS.get(str(model.value).strip(' "').lower())
    if known is None:
        names = ", ".join(name for name in MODELS if name)
        raise InputError(f"{where}: {model.key}: found {model.value!r}, expected one of {names}")
    k = _numbers(where, matrix)
    if k.size != 9:
        raise InputError(f"{where}: {matrix.key}: found {k.size} numbers, expected 9")
    (fx, skew, cx), (low, fy, cy), last = k.reshape(3, 3)
    if not (fx > 0 and fy > 0):
        raise InputError(f"{where}: {matrix.key}: found the focal lengths {fx:g} and {fy:g} px, expected both above 0")
    _check_intrinsics(f"{where}: {matrix.key}", (width, height), (fx, fy), (cx, cy))
    if skew or low or last.tolist() != [0, 0, 1]:
        raise InputError(f"{where}: {matrix.key}: found {k.reshape(3, 3).tolist()}, expected fx 0 cx, 0 fy cy, 0 0 1")
    d = _numbers(where, lens)
    lengths = DISTORTION_LENGTHS[known]
    if d.size not in lengths:
        expected = f"{' or '.join(map(str, lengths))} of a {known}"
        raise InputError(f"{where}: {lens.key}: found {d.size} coefficients, expected {expected}")
    centre, focal = (float(cx), float(cy)), (float(fx), float(fy))
    return Camera(width, height, focal, centre, tuple(d.tolist()), mounting, known)


def _check_intrinsics(
    where: str, size: tuple[int, int], focal: tuple[float, float], centre: tuple[float, float]
) -> None:
    """Raises InputError, after `where`, for what no lens has: numbers in other units, or of images of another size."""
    of = f"the image's {size[0]}x{size[1]} px"
    for side, found in zip(size, focal, strict=True):
        if not SHORTEST <= found / side <= LONGEST:
            meant = f" ({found * side:.4g} if this is a share of that)" if SHORTEST <= found <= LONGEST else ""
            raise InputError(
                f"{where}: found a focal length of {found:g} px, expected {SHORTEST * side:g} to {LONGEST * side:g} by "
                f"{of}{meant}"
            )
    if not all(-0.5 <= found <= side - 0.5 for side, found in zip(size, centre, strict=True)):
        raise InputError(
            f"{where}: found the centre {centre[0]:g}, {centre[1]:g}, expected px within {of}: perhaps it is of images "
            "of another size"
        )


def _projection(where: str, entry: _Entry) -> tuple[float, float, float, float] | None:
    """fx, fy, cx, cy, px, of P (3, 4), the projection of rectified images (REP 104); None where it is not filled in.

    The last column of a stereo camera is about the other one: that of the images is at the origin of its mounting.
    """
    try:
        numbers = _numbers(where, entry)
    except InputError:  # of images that are not rectified it does not matter
        return None
    if numbers.size != 12 or not (numbers[0] > 0 and numbers[5] > 0):
        return None
    fx, _, cx, _, _, fy, cy, *_ = numbers.tolist()
    return fx, fy, cx, cy


def _side(where: str, entry: _Entry) -> int:
    try:
        side = float(entry.value)
    except (TypeError, ValueError, OverflowError):
        side = math.nan
    if not (side >= 1 and side.is_integer()):
        raise InputError(f"{where}: {entry.key}: found {entry.value!r}, expected a whole number of px, at least 1")
    return int(side)


def _numbers(where: str, entry: _Entry) -> Array:
    """The numbers of a matrix in either notation, flattened; InputError for entries that are not finite numbers."""
    value, rows, cols = entry.value, None, None
    if isinstance(value, Mapping):
        if "data" not in value:
            raise InputError(f"{where}: {entry.key}: found no data, expected a matrix with rows, cols and data")
        value, rows, cols = value["data"], value.get("rows"), value.get("cols")
    try:
        numbers = np.array([] if value is None else value, float).ravel()
        count = numbers.size if rows is None or cols is None else int(rows) * int(cols)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{where}: {entry.key}: found {str(value)[:60]!r}, expected numbers") from None
    if numbers.size != count:
        raise InputError(f"{where}: {entry.key}: found {numbers.size} numbers, expected {rows} x {cols}")
    if not np.isfinite(numbers).all():
        raise InputError(f"{where}: {entry.key}: found a number that is not finite, expected finite ones")
    return numbers
