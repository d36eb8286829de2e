"""Calibrations in the formats of other programs, as the entries that a file of OpenCV's has.

    Kalibr            cam0: {camera_model, intrinsics, distortion_model, distortion_coeffs, resolution}
    EuRoC             the same keys, but distortion_coefficients, of one camera (ASL's sensor.yaml)
    ORB-SLAM          Camera.fx or Camera1.fx, ..., Camera.k1, ..., Camera.type, Camera.width
    aruco_ekf_slam    camera: {fx, ..., k1, ...}, as ORB-SLAM without a size
    MRPT              [section] resolution, cx, cy, fx, fy, dist, distortion_model
    camera_calibration    ost.txt: [image] width, height; [name] camera matrix, distortion

Of several cameras in a file one has to be named.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError

Entries = dict[str, Any]


class Format(NamedTuple):
    """A format of calibrations."""

    cameras: Callable[[Entries], Entries]  # those of a parsed file by their names; none if it is of another format
    entries: Callable[[str, Any], Entries]  # of one of them, in OpenCV's keys; InputError begins with the given text


def as_opencv(path: Path, found: Entries, which: str | None = None) -> Entries:
    """The entries of a calibration with OpenCV's keys; as they are where no other format is recognised.

    `which` names a camera of several. InputError where it is missing or unknown, and for a lens without counterpart.
    """
    for form in FORMATS:
        cameras = form.cameras(found)
        if not cameras:
            continue
        names = ", ".join(cameras)
        if which is not None and which not in cameras:
            raise InputError(f"{path}: found no camera {which!r}, expected one of {names}")
        if which is None and len(cameras) > 1:
            first = next(iter(cameras))
            raise InputError(f'{path}: found the cameras {names}, expected the one to use: "{path.name}#{first}"')
        name = which or next(iter(cameras))
        return form.entries(f"{path}: {name}" if name else str(path), cameras[name])
    if which is not None:
        raise InputError(f"{path}: found a single camera, expected several where {which!r} is named")
    return found


def _of_kalibr(found: Entries) -> Entries:
    return {str(name): one for name, one in found.items() if isinstance(one, Mapping) and "intrinsics" in one}


def _of_euroc(found: Entries) -> Entries:
    known = {"camera_matrix", "K", "k"} & set(found)
    return {"": found} if isinstance(found.get("intrinsics"), list) and not known else {}


def _kalibr(where: str, camera: Entries) -> Entries:
    model = str(camera.get("camera_model", "pinhole"))
    if model.lower() != "pinhole":
        raise InputError(f"{where}: camera_model: found {model!r}, expected pinhole: no lens of OpenCV is like it")
    numbers = camera["intrinsics"]
    if not isinstance(numbers, list) or len(numbers) != 4:
        raise InputError(f"{where}: intrinsics: found {str(numbers)[:60]}, expected fx, fy, cx, cy")
    coefficients = camera.get("distortion_coeffs", camera.get("distortion_coefficients"))
    size = camera.get("resolution", [None, None])
    size = [size.get("width"), size.get("height")] if isinstance(size, Mapping) else size
    return _entries(numbers, coefficients, camera.get("distortion_model", "none"), size)


def _of_orb_slam(found: Entries) -> Entries:
    flat = dict(found)
    for name, one in found.items():
        if isinstance(one, Mapping):
            flat |= {f"{name}.{key}": value for key, value in one.items()}
    names = [match[1] for key in flat if (match := re.fullmatch(r"([Cc]amera\d*)\.fx", key))]
    return {name: flat | {"": name} for name in names}


def _orb_slam(where: str, given: Entries) -> Entries:
    name = given[""]

    def of(key: str) -> Any:
        return given.get(f"{name}.{key}")

    kind = str(given.get("Camera.type", given.get("Camera.model", "PinHole"))).lower()
    lenses = {"pinhole": _BROWN, "perspective": _BROWN, "rectified": (), "kannalabrandt8": _ANGLES, "fisheye": _ANGLES}
    if kind not in lenses:
        raise InputError(f"{where}: Camera.type: found {kind!r}, expected PinHole, Rectified or KannalaBrandt8")
    missing = [key for key in ("fy", "cx", "cy") if of(key) is None]
    if missing:
        raise InputError(f"{where}: found no {missing[0]}, expected fx, fy, cx and cy")
    keys = lenses[kind]
    while keys and of(keys[-1]) is None:
        keys = keys[:-1]
    coefficients = [of(key) or 0.0 for key in keys]
    if lenses[kind] == _BROWN and 0 < len(keys) < 8:
        coefficients += [0.0] * ((4 if len(keys) < 5 else 5 if len(keys) == 5 else 8) - len(keys))
    sizes = [[given.get(f"Camera.{side}") for side in sides] for sides in (("width", "height"), ("cols", "rows"))]
    size = next((one for one in sizes if None not in one), None)
    fisheye = lenses[kind] == _ANGLES
    return _entries([of(key) for key in ("fx", "fy", "cx", "cy")], coefficients, "fisheye" if fisheye else "", size)


_BROWN, _ANGLES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), ("k1", "k2", "k3", "k4")
"""Coefficients in OpenCV's order: of its pinhole lens, and of its fisheye."""


def _of_mrpt(found: Entries) -> Entries:
    return {name: one for name, one in found.items() if isinstance(one, Mapping) and {"fx", "fy", "dist"} <= set(one)}


def _mrpt(where: str, camera: Entries) -> Entries:
    size = _numbers(where, camera, "resolution", 2)
    model = camera.get("distortion_model", camera.get("distortion", "plumb_bob")).strip()
    intrinsics = [_numbers(where, camera, key, 1)[0] for key in ("fx", "fy", "cx", "cy")]
    # as MRPT reads it: numbers below 2 are shares of the width and height
    intrinsics = [value * side if value < 2 else value for value, side in zip(intrinsics, 2 * size, strict=True)]
    return _entries(intrinsics, [] if model == "none" else _numbers(where, camera, "dist"), model, size)


def _of_ost(found: Entries) -> Entries:
    sizes = [one for one in found.values() if isinstance(one, Mapping) and "width" in one]
    cameras = [(name, one) for name, one in found.items() if isinstance(one, Mapping) and "camera matrix" in one]
    if len(sizes) != len(cameras):
        return {}
    return {name: {**size, **one} for (name, one), size in zip(cameras, sizes, strict=True)}


def _ost(where: str, camera: Entries) -> Entries:
    size = [_numbers(where, camera, key, 1)[0] for key in ("width", "height")]
    matrix, coefficients = (_numbers(where, camera, key) for key in ("camera matrix", "distortion"))
    if len(coefficients) == 4:
        raise InputError(
            f"{where}: distortion: found 4 coefficients, expected 5 or 8: of which lens they are, only ost.yaml tells"
        )
    entries = _entries([0] * 4, coefficients, "plumb_bob", size)
    return entries | {"camera_matrix": matrix}


FORMATS = (
    Format(_of_kalibr, _kalibr),
    Format(_of_euroc, _kalibr),
    Format(_of_orb_slam, _orb_slam),
    Format(_of_mrpt, _mrpt),
    Format(_of_ost, _ost),
)


def _entries(intrinsics: Any, coefficients: Any, model: Any, size: Any) -> Entries:
    """The entries of a camera with fx, fy, cx, cy; a size of which None is part is left out."""
    fx, fy, cx, cy = intrinsics
    entries = {
        "camera_matrix": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
        "distortion_coefficients": [] if coefficients is None else coefficients,
        "distortion_model": model,
    }
    if not isinstance(size, list | tuple) or len(size) != 2 or None in size:
        return entries
    return entries | {"image_width": size[0], "image_height": size[1]}


def _numbers(where: str, camera: Entries, key: str, count: int | None = None) -> list[float]:
    """The numbers of a text, with or without brackets and commas."""
    text = str(camera.get(key, ""))
    try:
        numbers = [float(word) for word in re.sub(r"[\[\],]", " ", text).split()]
    except ValueError:
        numbers = []
    if not numbers or (count is not None and len(numbers) != count):
        raise InputError(f"{where}: {key}: found {text[:60]!r}, expected {count or 'some'} numbers")
    return numbers
