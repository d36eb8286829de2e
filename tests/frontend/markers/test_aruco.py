"""Markers in frames: ids, corners, poses, range and bearing; on drawn images and on a real photograph."""

import cv2
import numpy as np
import pytest

from recorded import at_hand
from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Detector, Image, Sighting, range_bearing, square
from slamduel.frontend.markers.markers import Markers, find
from slamduel.frontend.markers.noise import ProportionalNoise

CAMERA = Camera(640, 480, (576.0, 574.0), (321.7, 238.4), (-0.21, 0.06, 8e-4, -6e-4, 0), mounting(0.1, 0.05, 0.7, 0.3))
DETECTOR = Detector(Markers("4X4_50", 0.16), CAMERA)


def sheet(name: int, module: int) -> Image:
    """Marker `name` on white paper, modules of that many pixels."""
    drawn = np.asarray(find("4X4_50").generateImageMarker(name, 6 * module), np.uint8)
    return np.pad(drawn, module, constant_values=255)


def frame(*sheets: tuple[Image, int, int]) -> Image:
    """A grey frame with sheets at (row, column)."""
    image = np.full((480, 640), 128, np.uint8)
    for paper, row, column in sheets:
        image[row : row + len(paper), column : column + len(paper)] = paper
    return image


def marker_pose(rng: np.random.Generator) -> Array:
    """T_camera_marker of a marker in view, turned to the camera by up to 50 degrees."""
    axis = np.append(rng.normal(size=2), 0.0)
    lean = np.asarray(cv2.Rodrigues(axis / np.linalg.norm(axis) * rng.uniform(0.2, 0.9))[0])
    roll = np.asarray(cv2.Rodrigues(np.array([0, 0, rng.uniform(-3, 3)]))[0])
    pose = np.eye(4)
    pose[:3, :3] = lean @ np.diag([1.0, -1.0, -1.0]) @ roll
    depth = rng.uniform(0.5, 2)
    pose[:3, 3] = depth * np.array([rng.uniform(-0.35, 0.35), rng.uniform(-0.25, 0.25), 1.0])
    return pose


def test_exact_corners_give_the_exact_pose() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        pose = marker_pose(rng)
        corners = CAMERA.project(square(0.16) @ pose[:3, :3].T + pose[:3, 3])
        found = DETECTOR.locate(7, CAMERA.undistort(corners), 1e-12 * np.eye(8))
        np.testing.assert_allclose(found.pose, pose, atol=2e-5)
        assert found.error < 1e-3
        assert found.ambiguity < 0.1


def test_corners_come_in_the_markers_own_order() -> None:
    paper = sheet(7, 12)
    found, rejected = DETECTOR.detect(frame((np.rot90(paper, -1).copy(), 100, 200)))
    assert [s.id for s in found] == [7]
    assert not rejected
    # A quarter turn clockwise takes the first corner to the top right. The black square begins 12 px in.
    top, left, right = 100 + 11.5, 200 + 11.5, 200 + 83.5
    np.testing.assert_allclose(found[0].corners[0], [right, top], atol=0.7)
    np.testing.assert_allclose(found[0].corners[3], [left, top], atol=0.7)


def test_of_two_with_one_id_none_stays_and_both_are_counted() -> None:
    image = frame((sheet(3, 8), 20, 20), (sheet(3, 14), 200, 300), (sheet(5, 10), 30, 400))
    found, rejected = DETECTOR.detect(image)
    assert [s.id for s in found] == [5]
    assert dict(rejected) == {"same id twice in a frame": 2}


def test_colour_and_grey_are_the_same() -> None:
    grey = frame((sheet(3, 12), 100, 200))
    (one,), _ = DETECTOR.detect(grey)
    (other,), _ = DETECTOR.detect(np.repeat(grey[:, :, None], 3, axis=2))
    np.testing.assert_array_equal(one.corners, other.corners)


def test_an_empty_frame() -> None:
    found, rejected = DETECTOR.detect(frame())
    assert found == []
    assert not rejected
    assert range_bearing(found, CAMERA.mounting).shape == (0, 2)
    assert ProportionalNoise().cov(np.zeros((0, 2))).shape == (0, 2, 2)


def test_a_frame_of_another_size_is_refused() -> None:
    refused("frame: found 320x240 pixels, expected the camera's 640", DETECTOR.detect, np.zeros((240, 320), np.uint8))


def test_an_unknown_dictionary_is_refused() -> None:
    refused("there is no '4X4'; the nearest is 4X4_50", Detector(Markers("4X4", 0.16), CAMERA).detect, frame())


def seen_at(point: Array) -> Sighting:
    """A marker whose centre is at `point` (3,) of the camera frame."""
    pose = np.eye(4)
    pose[:3, 3] = point
    return Sighting(0, np.zeros((4, 2)), np.eye(8), pose, pose[:3, 3], np.eye(6), 0.0, 0.0)


def test_range_and_bearing_are_of_the_robots_plane() -> None:
    centre = np.array([1.2, 0.9, 0.4, 1.0])  # on the robot: ahead, left and up
    in_camera = np.asarray(np.linalg.inv(CAMERA.mounting) @ centre, np.float64)
    ((r, phi),) = range_bearing([seen_at(in_camera[:3])], CAMERA.mounting)
    assert r == pytest.approx(1.5)
    assert phi == pytest.approx(np.arctan2(0.9, 1.2))


def test_bearing_is_minus_the_reports_equation_3_8() -> None:
    t1, t3 = 0.5, 2.0  # to the right of, and ahead of, a camera at the robot's middle
    ((d, phi),) = range_bearing([seen_at(np.array([t1, -0.3, t3], float))], mounting(0, 0, 0, 0))
    assert d == pytest.approx(np.sqrt(t1**2 + t3**2))
    assert phi == pytest.approx(-np.arctan(t1 / t3))


PHOTOGRAPH = {  # marked by hand, px, clockwise from the marker's own first corner
    40: [[359, 310], [404, 310], [410, 350], [362, 350]],
    98: [[427, 255], [469, 256], [477, 289], [434, 288]],
    62: [[233, 273], [190, 273], [196, 241], [237, 241]],
    23: [[298, 185], [334, 186], [335, 212], [297, 211]],
    124: [[425, 163], [430, 186], [394, 186], [390, 162]],
    203: [[195, 155], [230, 155], [227, 178], [190, 178]],
}


def test_a_real_photograph() -> None:
    image = cv2.imread(str(at_hand("aruco/singlemarkersoriginal.jpg")))
    lens = (0.0995485, -0.206384, 0.00754589, 0.00336531, 0.0)
    camera = Camera(640, 480, (628.158, 628.156), (324.099, 260.908), lens, mounting(0, 0, 0, 0))
    found, rejected = Detector(Markers("6X6_250", 0.05), camera).detect(np.asarray(image, np.uint8))
    assert [s.id for s in found] == sorted(PHOTOGRAPH)
    assert not rejected
    for sighting in found:
        np.testing.assert_allclose(sighting.corners, PHOTOGRAPH[sighting.id], atol=1.5)
        assert sighting.error < 0.3
    # All six lie on one table top: their normals agree, and their centres are in one plane.
    normals = np.array([s.pose[:3, 2] for s in found])
    assert (normals @ normals.mean(axis=0) > np.cos(np.deg2rad(8))).all()
