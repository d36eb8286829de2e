"""The camera that a bag's camera_info, or a calibration beside it, gives to raw and to rectified images."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import bags
from refusals import refused
from slamduel.core.factors import Log
from slamduel.core.se2 import Array
from slamduel.datasets.bags.camera_info import is_rectified
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import Robot, read_robot, write_robot
from slamduel.frontend.camera.calibration import write_camera_info, write_opencv
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.markers import Markers, find
from slamduel.frontend.wheels.motion import Drift

PLACE = mounting(0, 0, 0.3, 0)
FLAT = Camera(160, 120, (150.0, 151.0), (79.5, 60.5), (0.0,) * 5, PLACE)
"""The camera of rectified images."""
RAW = Camera(160, 120, (125.0, 127.0), (81.0, 58.0), (-0.3, 0.1, 0.001, 0.0, 0.0), PLACE)
ROBOT = Robot("cart", Markers("4X4_50", 0.1), None, PLACE, drift=Drift(0.4, 0.6))


def picture(number: int) -> Image:
    image = np.full((120, 160), 128, np.uint8)
    paper = np.pad(np.asarray(find("4X4_50").generateImageMarker(4, 30), np.uint8), 6, constant_values=255)
    left = 30 + 8 * number
    image[40 : 40 + len(paper), left : left + len(paper)] = paper
    return image


def projection(camera: Camera, shift: float = 0.0) -> Array:
    return np.column_stack((camera.matrix, (shift, 0.0, 0.0))).ravel()


def info(k: Any, d: Any, p: Any, topic: str = "/camera/camera_info", stamp: int = 1, **other: Any) -> bags.Said:
    plain = bags.camera_info(stamp, k, d, topic)
    size = {"width": 160, "height": 120}
    return plain._replace(build=lambda new: plain.build(new) | size | {"p": np.asarray(p, float)} | other)


def raw_info(**other: Any) -> bags.Said:
    given: dict[str, Any] = {"k": RAW.matrix.ravel(), "d": RAW.distortion, "p": projection(FLAT)}
    return info(**(given | other))


def logged(folder: Path, topic: str, infos: Sequence[bags.Said], camera: Path | None = None, kind: str = "mcap") -> Log:
    """The log of three frames of `topic`, with the calibration in the file `camera`, if any."""
    folder.mkdir(exist_ok=True)
    write_robot(folder / "robot.toml", ROBOT)
    if camera is not None:
        words = (folder / "robot.toml").read_text()
        (folder / "robot.toml").write_text(words.replace("[camera]", f'[camera]\ncalibration = "{camera}"'))
    if topic.endswith("compressed"):
        content = [cv2.imencode(".png", picture(k))[1].tobytes() for k in range(3)]
        frames = [bags.compressed(10**8 * (k + 1), content[k], "mono8; png compressed ", topic) for k in range(3)]
    else:
        frames = [bags.image(10**8 * (k + 1), picture(k), topic=topic) for k in range(3)]
    said = sorted([*infos, *frames], key=lambda one: one.stamp)
    robot = read_robot(folder / "robot.toml")
    return build(open_recording(bags.write(folder, kind, said), robot)).log


RECTIFIED = [
    "/camera/image_rect",
    "/camera/image_rect_color",
    "/camera/image_rect_mono",
    "/left/image_rect_raw",
    "/camera/image_rect/compressed",
    "/stereo/right/image_rect_color/compressed",
    "/kinect2/qhd/image_color_rect",
    "/zed/left/color/rect/image",
    "/camera/rectified/image",
    "/camera/image_undistorted",
]


def test_names_of_rectified_images() -> None:
    for name in RECTIFIED:
        assert is_rectified(name), name
    for name in ("/camera/image_raw", "/direct/image", "/camera/image_color", "/rectangle/image", "/corrected/image"):
        assert not is_rectified(name), name


@pytest.mark.parametrize("topic", RECTIFIED[:1] + RECTIFIED[4:6])
@pytest.mark.parametrize("shift", [0.0, -18.0])
def test_the_camera_of_rectified_images_is_p_without_distortion(tmp_path: Path, topic: str, shift: float) -> None:
    """The last column of a stereo camera's P is about the other one: the images' own place is [camera] mounting."""
    plain = logged(tmp_path / "a", "/camera/image_raw", [info(FLAT.matrix.ravel(), [0.0] * 5, projection(FLAT))])
    beside = topic.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"
    found = logged(tmp_path / "b", topic, [raw_info(p=projection(FLAT, shift), topic=beside)])
    np.testing.assert_array_equal(found.z, plain.z)
    assert found.remarks == plain.remarks == []
    raw = logged(tmp_path / "c", "/camera/image_raw", [raw_info()])
    assert np.abs(raw.z[:, 0] / plain.z[:, 0] - 1).min() > 0.05


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_rectified_images_in_other_bags(tmp_path: Path, kind: str) -> None:
    found = logged(tmp_path, "/camera/image_rect", [raw_info()], kind=kind)
    assert found.notes["camera"]["focal"] == FLAT.focal


def test_a_calibration_beside_rectified_images_is_that_of_its_projection(tmp_path: Path) -> None:
    write_camera_info(tmp_path / "ros.yaml", RAW)
    words = (tmp_path / "ros.yaml").read_text()
    before = ", ".join(map(str, projection(RAW).tolist()))
    after = ", ".join(map(str, projection(FLAT).tolist()))
    assert before in words
    (tmp_path / "ros.yaml").write_text(words.replace(before, after))
    write_opencv(tmp_path / "cv.yaml", RAW)
    write_opencv(tmp_path / "flat.yaml", FLAT)
    topic = "/camera/image_rect"
    for name, infos in (("ros", []), ("ros", [raw_info()]), ("flat", []), ("flat", [raw_info()])):
        log = logged(tmp_path / f"{name}{len(infos)}", topic, infos, tmp_path / f"{name}.yaml")
        assert (log.notes["camera"]["focal"], log.remarks) == (FLAT.focal, [])
    unknown = logged(tmp_path / "cv", topic, [], tmp_path / "cv.yaml")
    assert unknown.notes["camera"]["focal"] == RAW.focal
    (remark,) = unknown.remarks
    assert "the images of topic /camera/image_rect are rectified, but the calibration beside it is of dis" in remark
    known = logged(tmp_path / "cv2", topic, [raw_info()], tmp_path / "cv.yaml")
    assert known.notes["camera"]["focal"] == FLAT.focal
    (remark,) = known.remarks
    assert remark.endswith("without a projection_matrix: P of camera_info is used")
    raw = logged(tmp_path / "raw", "/camera/image_raw", [], tmp_path / "ros.yaml")
    assert raw.notes["camera"]["focal"] == RAW.focal


def test_a_simulated_camera_without_p_has_k(tmp_path: Path) -> None:
    log = logged(tmp_path, "/camera/image_rect", [info(FLAT.matrix.ravel(), [0.0] * 5, np.zeros(12))])
    assert (log.notes["camera"]["focal"], log.remarks) == (FLAT.focal, [])


@pytest.mark.parametrize(
    ("topic", "given", "message"),
    [
        ("/camera/image_raw", {"k": np.zeros(9), "d": [], "p": np.zeros(12)}, "is there, but is all zero, of an unc"),
        ("/camera/image_raw", {"k": np.zeros(9), "d": []}, "is there, but has only P, the camera of rectified images"),
        ("/camera/image_rect", {"p": np.zeros(12)}, "P of topic .*, the camera of rectified images, is zero, and"),
    ],
)
def test_a_camera_info_that_lacks_what_is_needed_is_said_to_be_there(
    tmp_path: Path, topic: str, given: dict[str, Any], message: str
) -> None:
    refused(f"calibration is unknown .*{message}", logged, tmp_path, topic, [raw_info(**given)])


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_messages_from_before_the_driver_had_its_calibration_are_passed_over(tmp_path: Path, kind: str) -> None:
    zero = [raw_info(k=np.zeros(9), d=[], p=np.zeros(12), stamp=k + 1) for k in range(2)]
    log = logged(tmp_path, "/camera/image_raw", [*zero, raw_info(stamp=3), raw_info(stamp=4)], kind=kind)
    assert log.notes["camera"]["focal"] == RAW.focal
    (remark,) = log.remarks
    assert remark.endswith("topic /camera/camera_info is zero until message 3, which is used")


def test_p_alone_is_enough_for_rectified_images(tmp_path: Path) -> None:
    log = logged(tmp_path, "/camera/image_rect", [raw_info(k=np.zeros(9), d=[])])
    assert log.notes["camera"]["focal"] == FLAT.focal


def test_a_bare_bag_of_other_sensors_is_told_what_it_has(tmp_path: Path) -> None:
    path = bags.write(tmp_path, "ros2", [bags.counts(k, 1, 1, 1, 1) for k in (1, 2)])
    refused(
        r"found no robot\.toml, expected one, or --robot FILE; without one a bag is of a laser scanner "
        r"\(sensor_msgs/LaserScan\) or a depth camera .*; found /encoder \(geometry_msgs/Quat.* 2 messages\)\.",
        open_recording, path,
    )  # fmt: skip


EQUIDISTANT = {"distortion_model": "equidistant", "d": np.array([-0.3, 0.1, 0.0, 0.0])}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, []),
        ({"d": np.array([-0.301, 0.102, 0.001, 0.0, 0.0])}, []),
        ({"distortion_model": "rational_polynomial", "d": np.array([*RAW.distortion, 0, 0, 0])}, []),
        (EQUIDISTANT, [r"camera_info has another lens \(fisheye, .* than the calibration in robot.toml, which is us"]),
        ({"d": np.zeros(5)}, ["another lens"]),
        ({"d": -np.array(RAW.distortion)}, ["another lens"]),
        ({"k": replace(RAW, centre=(81.0, 68.0)).matrix.ravel()}, ["cy = 68 px, .* 58 px: bearings and heights"]),
        ({"k": replace(RAW, focal=(150.0, 127.0)).matrix.ravel()}, ["fx = 150 px, .* 125 px: ranges differ"]),
    ],
)
def test_a_camera_info_of_another_lens_than_the_calibration_is_a_remark(
    tmp_path: Path, changes: dict[str, Any], said: list[str]
) -> None:
    write_opencv(tmp_path / "cv.yaml", RAW)
    log = logged(tmp_path / "a", "/camera/image_raw", [raw_info(**changes)], tmp_path / "cv.yaml")
    assert log.notes["camera"]["distortion"] == RAW.distortion
    assert len(log.remarks) == len(said)
    for found, expected in zip(log.remarks, said, strict=True):
        assert re.search(expected, found)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"k": RAW.matrix.ravel() * np.r_[1.001, 1, 1, 1, 1.001, 1, 1, 1, 1]}, None),
        ({"k": replace(RAW, focal=(150.0, 152.4)).matrix.ravel()}, "has fx = 150 px and the distortion [-0.3, 0.1"),
        ({"d": np.array([-0.2, 0.1, 0.001, 0.0, 0.0])}, "perhaps the camera zooms"),
        (EQUIDISTANT, "is of a camera of 160x120 'equidistant', the first, which is used, of 160x120 'plumb_bob'"),
        ({"width": 320, "height": 240}, "is of a camera of 320x240 'plumb_bob'"),
    ],
)
def test_a_camera_info_that_changes_is_a_remark(tmp_path: Path, changes: dict[str, Any], said: str | None) -> None:
    infos = [raw_info(stamp=k + 1) for k in range(4)] + [raw_info(stamp=5, **changes), raw_info(stamp=6)]
    log = logged(tmp_path, "/camera/image_raw", infos)
    assert log.notes["camera"]["focal"] == RAW.focal
    if said is None:
        assert log.remarks == []
    else:
        (remark,) = log.remarks
        assert "message 5 of topic /camera/camera_info" in remark
        assert said in remark
