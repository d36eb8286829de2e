"""Calibrations of other programs: each is the camera that the same numbers are in OpenCV's form, or is refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refusals import refused
from slamduel.datasets.recordings.robot import read_robot
from slamduel.frontend.camera.calibration import read
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting

MOUNTING = mounting(0.1, 0.0, 0.3, 0.2)
FOUR = Camera(752, 480, (458.654, 457.296), (367.215, 248.375), (-0.283, 0.0739, 0.00019, 1.76e-05), MOUNTING)
FIVE = replace(FOUR, distortion=(*FOUR.distortion, 0.011))
EIGHT = replace(FOUR, distortion=(*FIVE.distortion, 0.1, 0.2, 0.3))
NONE = replace(FOUR, distortion=())
FISHEYE = replace(FOUR, distortion=(-0.0053, 0.0423, -0.0395, 0.00682), model="fisheye")
RIGHT = replace(FISHEYE, focal=(300.0, 301.0))

KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.283, 0.0739, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
"""
SECOND = """cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.0053, 0.0423, -0.0395, 0.00682]
  distortion_model: equidistant
  intrinsics: [300, 301, 367.215, 248.375]
  resolution: [752, 480]
"""
EUROC = """%YAML:1.0
# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.283, 0.0739, 0.00019, 1.76e-05]
"""
ORB = """%YAML:1.0

#---- Camera Parameters. Adjust them!
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: 458.654
Camera1.fy: 457.296
Camera1.cx: 367.215
Camera1.cy: 248.375
Camera1.k1: -0.283
Camera1.k2: 0.0739
Camera1.p1: 0.00019
Camera1.p2: 1.76e-05
Camera.width: 752
Camera.height: 480
Camera.newWidth: 600
Camera.fps: 20
IMU.T_b_c1: !!opencv-matrix
   rows: 1
   cols: 2
   dt: f
   data: [0.1, 0.2]
ORBextractor.nFeatures: 1200
"""
OLD_ORB = "".join(
    line + "\n"
    for line in ORB.replace("Camera1.", "Camera.").split("\n")
    if not line.startswith(("File", "Camera.type"))
)
ANGLES = "Camera1.k1: -0.0053\nCamera1.k2: 0.0423\nCamera1.k3: -0.0395\nCamera1.k4: 0.00682\n"
FISHEYE_ORB = (
    "\n".join(line for line in ORB.split("\n") if not line.startswith(("Camera1.k", "Camera1.p"))).replace(
        "PinHole", "KannalaBrandt8"
    )
    + ANGLES
)
NESTED = """Camera:
  name: "a camera"
  setup: "monocular"
  model: "perspective"
  fx: 458.654
  fy: 457.296
  cx: 367.215
  cy: 248.375
  k1: -0.283
  k2: 0.0739
  p1: 0.00019
  p2: 1.76e-05
  k3: 0.011
  cols: 752
  rows: 480
"""
MRPT = """// Camera calibration
[CAMERA_PARAMS]
resolution = [752 480]
cx         = 367.215
cy         = 248.375
fx         = 458.654   // px
fy         = 457.296
dist       = [-2.83e-01 7.39e-02 1.9e-04 1.76e-05 1.1e-02]
camera_name = left
focal_length = 0.0037 ; m
"""
OST = """# oST version 5.0 parameters


[image]

width
752

height
480

[narrow_stereo]

camera matrix
458.654000 0.000000 367.215000
0.000000 457.296000 248.375000
0.000000 0.000000 1.000000

distortion
-0.283000 0.073900 0.000190 0.0000176 0.011000

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
430.1 0.000000 369.3 0.000000
0.000000 440.1 247.3 0.000000
0.000000 0.000000 1.000000 0.000000
"""
EIGHT_TEXT = "[-2.83e-01 7.39e-02 1.9e-04 1.76e-05 1.1e-02 0.1 0.2 0.3]"
SHARES = MRPT.replace("= 367.215", f"= {367.215 / 752!r}").replace("= 457.296", f"= {457.296 / 480!r}")
KB = "[-0.0053 0.0423 -0.0395 0.00682]\ndistortion_model = kannala_brandt"
OF_MRPT = "[-2.83e-01 7.39e-02 1.9e-04 1.76e-05 1.1e-02]"

READ = {
    "kalibr": ("camchain.yaml", KALIBR, FOUR),
    "kalibr, equidistant": ("camchain.yaml", SECOND, RIGHT),
    "kalibr, none": (
        "c.yaml",
        KALIBR.replace("radtan", "none").replace("[-0.283, 0.0739, 0.00019, 1.76e-05]", "[]"),
        NONE,
    ),
    "euroc": ("sensor.yaml", EUROC, FOUR),
    "euroc, size by name": ("sensor.yaml", EUROC.replace("[752, 480]", "\n  width: 752\n  height: 480"), FOUR),
    "orb-slam3": ("a.yaml", ORB, FOUR),
    "orb-slam3, k3": ("a.yaml", ORB + "Camera1.k3: 0.011\n", FIVE),
    "orb-slam2": ("a.yaml", OLD_ORB, FOUR),
    "orb-slam3, fisheye": ("a.yaml", FISHEYE_ORB, FISHEYE),
    "orb-slam3, rectified": ("a.yaml", ORB.replace("PinHole", "Rectified"), NONE),
    "stella": ("a.yaml", NESTED, FIVE),
    "mrpt": ("camera.ini", MRPT, FIVE),
    "mrpt, eight": ("camera.ini", MRPT.replace(OF_MRPT, EIGHT_TEXT), EIGHT),
    "mrpt, fisheye": ("camera.ini", MRPT.replace(OF_MRPT, KB), FISHEYE),
    "mrpt, shares": ("camera.ini", SHARES, FIVE),
    "ost": ("ost.txt", OST, FIVE),
    "json": (
        "calib.json",
        json.dumps({"mtx": FIVE.matrix.tolist(), "dist": [list(FIVE.distortion)], "image_size": [752, 480]}),
        FIVE,
    ),
    "yaml": (
        "calib.yaml",
        f"mtx: {FIVE.matrix.tolist()}\ndist:\n- {list(FIVE.distortion)}\nimage_width: 752\nimage_height: 480\n",
        FIVE,
    ),
}


def same(found: Camera, expected: Camera) -> None:
    assert (found.width, found.height, found.model) == (expected.width, expected.height, expected.model)
    np.testing.assert_allclose([*found.focal, *found.centre], [*expected.focal, *expected.centre], rtol=1e-12)
    np.testing.assert_allclose(found.distortion, expected.distortion, rtol=1e-12)
    np.testing.assert_array_equal(found.mounting, expected.mounting)


@pytest.mark.parametrize("which", READ)
def test_every_format_is_the_same_camera(which: str, tmp_path: Path) -> None:
    name, text, expected = READ[which]
    (tmp_path / name).write_text(text)
    same(read(tmp_path / name, MOUNTING), expected)
    (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    same(read(tmp_path / name, MOUNTING), expected)


def test_numpys_arrays_are_read_without_what_else_is_there(tmp_path: Path) -> None:
    views = np.array([np.zeros(3), None], object)
    np.savez(tmp_path / "calib.npz", mtx=FIVE.matrix, dist=np.array([FIVE.distortion]), rvecs=views)
    same(read(tmp_path / "calib.npz", MOUNTING, (752, 480)), FIVE)
    refused("found no image_width and image_height, expected the size", read, tmp_path / "calib.npz", MOUNTING)
    np.savez(tmp_path / "calib.npz", ret=0.2, rvecs=views)
    refused(r"calib\.npz: found no camera_matrix", read, tmp_path / "calib.npz", MOUNTING)
    np.savez(tmp_path / "calib.npz", rvecs=views)
    refused("found no arrays of numbers, expected those of a calib", read, tmp_path / "calib.npz", MOUNTING)


def test_one_of_several_cameras_is_named(tmp_path: Path) -> None:
    (tmp_path / "camchain.yaml").write_text(KALIBR + SECOND)
    refused(
        r'found the cameras cam0, cam1, expected the one to use: "camchain\.yaml#cam0"',
        read, tmp_path / "camchain.yaml", MOUNTING,
    )  # fmt: skip
    same(read(tmp_path / "camchain.yaml", MOUNTING, which="cam1"), RIGHT)
    refused(
        "found no camera 'cam2', expected one of cam0, cam1", read, tmp_path / "camchain.yaml", MOUNTING, None, "cam2"
    )
    (tmp_path / "robot.toml").write_text(
        '[camera]\ncalibration = "camchain.yaml#cam1"\n[markers]\ndictionary = "4X4_50"\nside = 0.1\n'
    )
    camera = read_robot(tmp_path / "robot.toml").camera
    assert camera is not None
    same(replace(camera, mounting=MOUNTING), RIGHT)
    two = MRPT.replace("CAMERA_PARAMS", "LEFT") + MRPT.partition("\n")[2].replace("CAMERA_PARAMS", "RIGHT")
    (tmp_path / "stereo.ini").write_text(two)
    refused("found the cameras LEFT, RIGHT, expected the one to use", read, tmp_path / "stereo.ini", MOUNTING)
    stereo = OST.replace("narrow_stereo", "narrow_stereo/left") + OST.replace("narrow_stereo", "narrow_stereo/right")
    (tmp_path / "ost.txt").write_text(stereo.replace("458.654000", "300.0", 1))
    same(read(tmp_path / "ost.txt", MOUNTING, which="narrow_stereo/right"), FIVE)
    assert read(tmp_path / "ost.txt", MOUNTING, which="narrow_stereo/left").focal[0] == 300.0
    (tmp_path / "a.yaml").write_text(ORB + "Camera2.fx: 300\nCamera2.fy: 300\nCamera2.cx: 320\nCamera2.cy: 240\n")
    refused("Camera1, Camera2", read, tmp_path / "a.yaml", MOUNTING)
    (tmp_path / "sensor.yaml").write_text(EUROC.partition("\n")[2].replace("intrinsics", "camera_matrix"))
    refused(
        "found a single camera, expected several where 'cam0' is",
        read,
        tmp_path / "sensor.yaml",
        MOUNTING,
        None,
        "cam0",
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (KALIBR.replace("pinhole", "omni"), "cam0: camera_model: found 'omni', expected pinhole: no lens of OpenCV is"),
        (KALIBR.replace("pinhole", "ds"), "camera_model: found 'ds', expected pinhole"),
        (KALIBR.replace("radtan", "fov"), "distortion_model: found 'fov', expected one of none, pinhole, plumb_bob"),
        (KALIBR.replace("458.654, ", ""), r"cam0: intrinsics: found \[457.296, .*expected fx, fy, cx, cy"),
        (KALIBR.replace("458.654", "-1"), "found the focal lengths -1 and 457.296 px, expected both above 0"),
        (KALIBR.replace("0.0739, ", ""), "distortion_coefficients: found 3 coefficients, expected 0 or 4 or 5"),
        (SECOND.replace("-0.0395, ", ""), "found 3 coefficients, expected 4 of a fisheye"),
        (EUROC.replace("[752, 480]", "752"), "found no image_width and image_height"),
        (
            ORB.replace("PinHole", "Equirectangular"),
            "Camera1: Camera.type: found 'equirectangular', expected PinHole, Re",
        ),
        (ORB.replace("Camera1.fy", "Camera1.f"), "Camera1: found no fy, expected fx, fy, cx and cy"),
        (ORB.replace("458.654", "x"), "expected numbers"),
        (MRPT.replace("[752 480]", "[752]"), r"CAMERA_PARAMS: resolution: found '\[752\]', expected 2 numbers"),
        (MRPT.replace("458.654 ", "fx "), "CAMERA_PARAMS: fx: found 'fx', expected 1 numbers"),
        (MRPT.replace("focal", "distortion_model = mei\nfocal"), "distortion_model: found 'mei', expected one of"),
        (
            OST.replace(" 0.011000", ""),
            "narrow_stereo: distortion: found 4 coefficients, expected 5 or 8: of which lens",
        ),
        (OST.replace("0.000000 0.000000 1.000000\n\ndist", "\ndist"), "camera_matrix: found 6 numbers, expected 9"),
        ("[section]\nname = 3\n", "found no camera_matrix"),
    ],
)
def test_what_cannot_be_mapped_is_refused_with_the_reason(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "file.txt").write_text(text)
    refused(f"file.txt.*{message}", read, tmp_path / "file.txt", MOUNTING)


ROWS = "525.0 0 319.5\n0 524.0 239.5\n0 0 1\n"
K = np.array([[525.0, 0, 319.5], [0, 524.0, 239.5], [0, 0, 1]])


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("K.txt", ROWS),
        ("K.csv", "# K\n" + ROWS.replace(" ", ", ")),
        ("K.yaml", "K: [525.0, 0, 319.5, 0, 524.0, 239.5, 0, 0, 1]\n"),
        ("rows.yaml", "camera_matrix: [[525.0, 0, 319.5], [0, 524.0, 239.5], [0, 0, 1]]\n"),
        ("K.npy", K),
        ("K.npz", K),
    ],
)
def test_a_matrix_alone_is_that_of_a_lens_without_distortion(tmp_path: Path, name: str, content: Any) -> None:
    path = tmp_path / name
    if isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif path.suffix == ".npy":
        np.save(path, content)
    else:
        np.savez(path, K=content)
    camera = read(path, np.eye(4), (640, 480))
    assert (camera.focal, camera.centre, camera.distorted) == ((525.0, 524.0), (319.5, 239.5), False)
    refused("found no image_width and image_height, expected the size of its images", read, path, np.eye(4))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("k.txt", "525 525 319.5 239.5\n", "found 1 x 4 of numbers, expected three rows of a matrix: fx 0 cx"),
        ("k.txt", "525 0 319.5\n0 525\n0 0 1\n", "found 3 uneven rows of numbers"),
        ("k.txt", "525 9 319.5\n0 525 239.5\n0 0 1\n", "camera_matrix: found .* expected fx 0 cx, 0 fy cy, 0 0 1"),
        ("k.yaml", "K: [525.0, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\ndistortion: x\n", "distortion: found 'x'"),
        ("k.yaml", "K: [525.0, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\ndist_5: [1]\n", "found no distortion_coefficients"),
    ],
)
def test_a_matrix_that_is_none_is_refused(tmp_path: Path, name: str, content: str, message: str) -> None:
    (tmp_path / name).write_text(content, encoding="utf-8")
    refused(message, read, tmp_path / name, np.eye(4), (640, 480))


def test_an_array_that_is_no_matrix_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "k.npy", np.eye(4))
    refused("found 4 x 4 of numbers, expected three rows of a matrix", read, tmp_path / "k.npy", np.eye(4), (640, 480))
    np.save(tmp_path / "k.npy", np.array({"K": 1}, dtype=object), allow_pickle=True)
    refused("k.npy: not an array of numbers", read, tmp_path / "k.npy", np.eye(4), (640, 480))


@pytest.mark.parametrize("model", ["omni", "ds", "eucm"])
def test_kalibrs_other_lenses_are_refused(tmp_path: Path, model: str) -> None:
    words = f"camera_model: {model}, intrinsics: [1.7, 460, 460, 320, 240], resolution: [640, 480]"
    (tmp_path / "chain.yaml").write_text(f"cam0: {{{words}}}\n", encoding="utf-8")
    refused(f"cam0: camera_model: found '{model}', expected pinhole", read, tmp_path / "chain.yaml", np.eye(4))
