"""Calibration files: those that others write are read, those written here others read, and bad ones are refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from recorded import at_hand
from refusals import refused
from slamduel.frontend.camera.calibration import from_camera_info, read, write_camera_info, write_opencv
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting

MOUNTING = mounting(0.1, 0.0, 0.3, 0.2)
PINHOLE = Camera(640, 480, (1000 / 3, 331.25), (320.1, 1e-05), (-0.2, 6e-07, 0.001, -2e-3, 1.5e-10), MOUNTING)
CAMERAS = {
    "5": PINHOLE,
    "8": replace(PINHOLE, distortion=(0.7, 0.07, 1e-4, 1e-5, 0.001, 1.1, 0.24, 0.0031)),
    "14": replace(PINHOLE, distortion=tuple(float(k) for k in np.linspace(-0.01, 0.02, 14))),
    "fisheye": replace(PINHOLE, distortion=(0.1, -0.02, 1e-7, 0.3), model="fisheye"),
}


def same(found: Camera, expected: Camera) -> bool:
    names = ("width", "height", "focal", "centre", "distortion", "model")
    alike = all(getattr(found, name) == getattr(expected, name) for name in names)
    return alike and np.array_equal(found.mounting, expected.mounting)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("name", ["a.yaml", "a.yml", "a.xml", "a.json"])
def test_opencvs_form_comes_back(tmp_path: Path, camera: Camera, name: str) -> None:
    write_opencv(tmp_path / name, camera)
    assert same(read(tmp_path / name, MOUNTING), camera)
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), camera.matrix)
    np.testing.assert_array_equal(np.ravel(storage.getNode("distortion_coefficients").mat()), camera.distortion)
    assert storage.getNode("image_width").real() == 640


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_camera_info_comes_back(tmp_path: Path, camera: Camera) -> None:
    write_camera_info(tmp_path / "info.yaml", camera)
    assert same(read(tmp_path / "info.yaml", MOUNTING), camera)
    text = (tmp_path / "info.yaml").read_text()
    assert "e-" not in text.replace(".0e-", "").replace("5e-10", "")  # YAML 1.1's 1.0e-5


def test_camera_info_has_five_coefficients_at_least(tmp_path: Path) -> None:
    write_camera_info(tmp_path / "info.yaml", replace(PINHOLE, distortion=()))
    assert read(tmp_path / "info.yaml", MOUNTING).distortion == (0.0,) * 5


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_what_opencvs_own_storage_writes_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"calibration.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Mon 05: it rained")
    for key, value in {"image_Width": 640, "image_Height": 480}.items():
        storage.write(key, value)
    storage.write("Camera_Matrix", PINHOLE.matrix)
    storage.write("Distortion_Coefficients", PINHOLE.coefficients[:, None])
    storage.release()
    assert same(read(path, MOUNTING), PINHOLE)


MESSAGE = """header:
  seq: 12
  frame_id: "camera"
height: 480
width: 640
distortion_model: "plumb_bob"
D: [-0.2, 0.1, 0.001, -0.002, 0.0]
K: [500.0, 0.0, 320.5, 0.0, 501.0, 240.5, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [500.0, 0.0, 320.5, 0.0, 0.0, 501.0, 240.5, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
---
"""


@pytest.mark.parametrize("text", [MESSAGE, MESSAGE.replace("D:", "d:").replace("K:", "k:")], ids=["ROS 1", "ROS 2"])
def test_a_printed_message_is_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "info.yaml").write_text(text + text)  # as a topic goes on printing
    found = read(tmp_path / "info.yaml", MOUNTING)
    assert found.focal == (500.0, 501.0)
    assert found.centre == (320.5, 240.5)
    assert found.distortion == (-0.2, 0.1, 0.001, -0.002, 0.0)


def test_names_of_a_stereo_calibration_and_a_size_from_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "intrinsics.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("M1", PINHOLE.matrix)
    storage.write("D1", PINHOLE.coefficients)
    storage.release()
    refused(r"intrinsics.yml: found no image_width and image_height, expected the size", read, path, MOUNTING)
    assert same(read(path, MOUNTING, (640, 480)), PINHOLE)


@pytest.mark.parametrize(
    ("model", "d", "expected"),
    [
        ("plumb_bob", [0.1, 0.2, 0.0, 0.0, 0.3], "pinhole"),
        ("rational_polynomial", [0.1] * 8, "pinhole"),
        ("", [], "pinhole"),
        ("equidistant", [0.1, 0.2, 0.3, 0.4], "fisheye"),
        ("fisheye", np.array([0.1, 0.2, 0.3, 0.4]), "fisheye"),
    ],
)
def test_models_of_camera_info(model: str, d: Any, expected: str) -> None:
    found = from_camera_info("drive.bag: /info", 640, 480, model, PINHOLE.matrix.ravel(), d, np.zeros(12), MOUNTING)
    assert (found.model, found.distortion) == (expected, tuple(d))


def changed(old: str, new: str) -> str:
    assert old in MESSAGE
    return MESSAGE.replace(old, new)


SHAPED = changed("D: [-0.2", "D: {rows: 1, cols: 4, data: [-0.2").replace("0.0]\nK", "0.0]}\nK")
BAD = {
    "empty": ("", "found no keys"),
    "a number": ("42\n", "found no keys"),
    "bytes": (b"\xff\xd8\xff\xe0\x00", "not a text file"),
    "not YAML": ("K: [1, 2\nD: {", "line [0-9]+: not valid YAML"),
    "unknown tag": ("K: !!python/object:os.system [1]\n", "line 1: not valid YAML"),
    "deep": ("[" * 400, "line 1: not valid YAML"),
    "XML cut off": ("<?xml version='1.0'?>\n<opencv_storage>\n<K>", "line 3: not valid XML"),
    "JSON cut off": ('{"K": [1, 2', "line 1: not valid JSON"),
    "large": ("# " + "x" * 1_000_001, "found 1000003 bytes, expected a calibration of a few hundred"),
    "cut off": (MESSAGE[: MESSAGE.index("K:")], "found no camera_matrix, expected"),
    "no lens": (changed("D:", "E:"), "found no distortion_coefficients, expected"),
    "no size": (changed("width:", "w:"), "found no image_width and image_height"),
    "no width": (changed("640", "0"), "width: found 0, expected a whole number of px"),
    "odd height": (changed("480", "wide"), "height: found 'wide', expected a whole number of px"),
    "infinite": (changed("480", ".inf"), "height: found inf, expected a whole number of px"),
    "model": (changed("plumb_bob", "mirror"), "distortion_model: found 'mirror', expected one of none, pinhole"),
    "short": (changed("0.0, 0.0, 1.0]\nR", "0.0]\nR"), "K: found 7 numbers, expected 9"),
    "ragged": (changed("K: [500.0,", "K: [[500.0],"), "K: found .*, expected numbers"),
    "words": (changed("-0.2,", "a lot,"), "D: found .*'a lot'.*, expected numbers"),
    "NaN": (changed("K: [500.0,", "K: [.nan,"), "K: found a number that is not finite"),
    "focal": (changed("K: [500.0,", "K: [-500.0,"), "K: found the focal lengths -500 and 501 px, expected both above"),
    "shares": (
        changed("K: [500.0,", "K: [0.9,"),
        "K: found a focal length of 0.9 px, expected 64 to .* .576 if",
    ),
    "in mm": (
        changed("K: [500.0,", "K: [4.0,"),
        "K: found a focal length of 4 px, expected 64 to 64000 by the",
    ),
    "centre": (
        changed("320.5, 0.0, 501", "1321.7, 0.0, 501"),
        "K: found the centre 1321.7, 240.5, expected px within",
    ),
    "skewed": (changed("K: [500.0, 0.0,", "K: [500.0, 2.0,"), "K: found .*2.0.*, expected fx 0 cx, 0 fy cy, 0 0 1"),
    "lens": (changed("-0.2, ", "0.1, -0.2, "), "D: found 6 coefficients, expected 0 or 4"),
    "fisheye": (changed("plumb_bob", "equidistant"), "D: found 5 coefficients, expected 4 of a fisheye"),
    "shape": (SHAPED, "D: found 5 numbers, expected 1 x 4"),
    "no data": (changed("D: [-0.2, 0.1, 0.001, -0.002, 0.0]", "D: {rows: 1}"), "D: found no data, expected a matrix"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD.keys())
def test_a_bad_file_is_a_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], content: Any, message: str
) -> None:
    path = tmp_path / "calibration.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    refused(f"^{path}(, |: ){message}", read, path, MOUNTING)
    assert capfd.readouterr().err == ""


def test_a_missing_file_and_a_folder_are_sentences(tmp_path: Path) -> None:
    refused(r"none\.yml: No such file or directory; expected a calibration file", read, tmp_path / "none.yml", MOUNTING)
    refused(f"^{tmp_path}: Is a directory; expected a calibration file", read, tmp_path, MOUNTING)


def test_published_files() -> None:
    charuco = read(at_hand("aruco/tutorial_camera_charuco.yml"), MOUNTING)
    assert charuco.focal == (4.5251072219637672e02, 4.5676707935146891e02)
    assert (charuco.width, charuco.height, charuco.distortion[4]) == (640, 480, 2.9542589406810080e00)
    single = read(at_hand("aruco/tutorial_camera_params.yml"), MOUNTING, (640, 480))
    assert (single.focal, len(single.distortion)) == ((628.158, 628.156), 5)
