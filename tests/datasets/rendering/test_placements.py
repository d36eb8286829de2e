"""Placed markers are where they are said to be, and clutter holds none."""

import cv2
import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.clutter import clutter, drawn, is_marker
from slamduel.datasets.rendering.marker_shots import ADVANCE, LEAST, RIM, Studio, crowds, placements
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.frontend.markers.aruco import Detector, square
from slamduel.frontend.markers.markers import Markers

CAMERA = CAMERAS["pinhole"]
DETECTOR = Detector(Markers("4X4_50", 0.16), CAMERA)


def corners_of(pose: Array, side: float = 0.16) -> Array:
    return CAMERA.project(square(side) @ pose[:3, :3].T + pose[:3, 3])


def test_a_marker_hangs_at_its_distance_in_view_and_within_its_tilt() -> None:
    studio, rng = Studio(CAMERA, tilt=0.6), np.random.default_rng(1)
    cosines, middles = [], []
    for _ in range(300):
        pose, sheet = studio.hang(1.7, rng)
        centre = pose[:3, 3]
        assert np.linalg.norm(centre) == pytest.approx(1.7, rel=1e-12)
        np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) > 0
        np.testing.assert_allclose(sheet, corners_of(pose, 0.16 * 8 / 6))
        assert (sheet >= RIM).all()
        assert (sheet <= np.array([639, 479]) - RIM).all()
        cosines.append(-pose[:3, 2] @ centre / 1.7)
        middles.append(sheet.mean(axis=0))
    least = np.cos(0.6)
    assert min(cosines) >= least
    # even over the cap: the cosine is uniform, its mean known to (1 - least) / sqrt(12 n)
    assert np.mean(cosines) == pytest.approx((1 + least) / 2, abs=5 * (1 - least) / np.sqrt(12 * 300))
    assert (np.ptp(middles, axis=0) > [450, 300]).all()


def test_the_frame_shows_what_is_said() -> None:
    for shot in placements(CAMERA, 1.2, 4, np.random.default_rng(2), samples=4):
        ((sighting,), _) = DETECTOR.detect(shot.image)
        assert sighting.id == shot.id
        np.testing.assert_allclose(sighting.corners, corners_of(shot.pose), atol=0.15)


def test_motion_has_the_streak_asked_for_and_the_truth_in_its_middle() -> None:
    studio, rng = Studio(CAMERA), np.random.default_rng(3)
    for streak in (0.5, 4.0):
        pose, _ = studio.hang(2.0, rng)
        motion, _ = studio.sway(pose, streak, rng)
        assert len(motion) == np.ceil(streak) + 1
        seen = np.array([corners_of(np.linalg.inv(camera) @ pose) for camera in motion])
        np.testing.assert_allclose(seen.mean(axis=0), corners_of(pose), atol=0.01)
        # from the middle of the first part to that of the last are all parts but one
        drawn_out = np.linalg.norm(seen[-1] - seen[0], axis=1).mean() * len(motion) / (len(motion) - 1)
        assert drawn_out == pytest.approx(streak, rel=0.02)


def test_a_moving_cameras_frame_is_blurred_about_the_truth() -> None:
    (still,) = placements(CAMERA, 1.0, 1, np.random.default_rng(4), samples=4)
    (moved,) = placements(CAMERA, 1.0, 1, np.random.default_rng(4), samples=4, streak=8.0)
    np.testing.assert_array_equal(still.pose, moved.pose)
    edges = [np.abs(np.diff(shot.image.astype(float), axis=1)).max() for shot in (still, moved)]
    assert edges[1] < edges[0]
    ((sighting,), _) = DETECTOR.detect(moved.image)
    np.testing.assert_allclose(sighting.corners, corners_of(moved.pose), atol=0.3)


def test_a_crowd_is_apart_and_all_of_it_is_there() -> None:
    for crowd in crowds(CAMERA, (0.8, 3.0), 6, 3, np.random.default_rng(5), samples=4):
        assert len(set(crowd.ids)) == 6
        assert {s.id for s in DETECTOR.detect(crowd.image)[0]} <= set(crowd.ids)
        middles = np.array([corners_of(pose).mean(axis=0) for pose in crowd.poses])
        reaches = [np.linalg.norm(corners_of(p) - m, axis=1).max() for p, m in zip(crowd.poses, middles, strict=True)]
        for i in range(6):
            for j in range(i):
                assert np.linalg.norm(middles[i] - middles[j]) > reaches[i] + reaches[j]


def test_what_does_not_fit_is_refused() -> None:
    refused(r"a marker 0\.2 m away does not fit into the", next, placements(CAMERA, 0.2, 1, np.random.default_rng(6)))
    refused("found no room in the frame for 9", next, crowds(CAMERA, (0.6, 0.7), 9, 1, np.random.default_rng(7)))


def test_a_marker_is_known_in_every_orientation_and_only_whole() -> None:
    bits = drawn("4X4_50", 11)
    for turns in range(4):
        assert is_marker(np.rot90(bits, turns))
    assert not is_marker(bits[:, ::-1])  # 11 is no other's mirror image
    for row, column in ((0, 2), (2, 2), (5, 5)):
        broken = bits.copy()
        broken[row, column] ^= True
        assert not is_marker(broken)
    assert not is_marker(drawn("6X6_250", 3))


def test_clutter_is_full_and_without_a_marker() -> None:
    frames = list(clutter(CAMERA, 6, np.random.default_rng(8)))
    for image in frames:
        assert image.shape == (480, 640)
        assert image.dtype == np.uint8
        assert DETECTOR.detect(image)[0] == []
    assert len({image.tobytes() for image in frames}) == 6
    # another dictionary's markers are among it: so what is in it can be found by who looks for it
    strangers = [Detector(Markers(name, 0.16), CAMERA) for name in ("6X6_250", "APRILTAG_36H11", "5X5_100")]
    assert sum(len(detector.detect(image)[0]) for detector in strangers for image in frames) > 0


def test_the_same_seed_is_the_same_clutter() -> None:
    first, second = (next(clutter(CAMERA, 1, np.random.default_rng(9))) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_rolling_shutter_sees_every_band_later_and_the_truth_in_the_middle_row() -> None:
    studio, rng = Studio(CAMERA, sensor=Sensor(readout=0.03)), np.random.default_rng(10)
    pose, _ = studio.hang(2.0, rng)
    motion, exact = studio.sway(pose, 0.0, rng, skew=6.0)
    assert motion.shape == (48, 1, 4, 4)
    seen = np.array([corners_of(np.linalg.inv(camera[0]) @ pose) for camera in motion])
    np.testing.assert_allclose(seen[23:25].mean(axis=0), corners_of(pose), atol=0.01)
    # from the middle of the first band of ten rows to that of the last are 470 rows of 480
    passed = np.linalg.norm(seen[-1] - seen[0], axis=1).mean() * 480 / 470
    assert passed == pytest.approx(6.0, rel=0.02)
    both, _ = studio.sway(pose, 2.0, rng, skew=6.0)
    assert both.shape == (48, 3, 4, 4)
    # The motion that is handed on is that of the bands: 470 rows of 480 between the middles of the first and the last.
    passed_m = motion[-1, 0, :3, 3] - motion[0, 0, :3, 3]
    turn = np.ravel(cv2.Rodrigues(motion[0, 0, :3, :3].T @ motion[-1, 0, :3, :3])[0])
    np.testing.assert_allclose(exact.rates * 0.03 * 470 / 480, [*turn, *passed_m], atol=1e-12)
    assert not exact.cov.any()


def test_a_markers_image_leans_as_far_as_the_shutter_takes() -> None:
    """Corners of a rendered frame against their places at the times of their own rows."""
    studio, rng = Studio(CAMERA, samples=4, sensor=Sensor(readout=0.03)), np.random.default_rng(12)
    pose, _ = studio.hang(0.8, rng)
    motion, _ = studio.sway(pose, 0.0, rng, skew=40.0)
    image = studio.take({7: pose}, rng, motion)
    ((sighting,), _) = Detector(Markers("4X4_50", 0.16), CAMERA, "subpix").detect(image)
    corners = np.array([corners_of(np.linalg.inv(camera[0]) @ pose) for camera in motion])
    own = [np.abs(corners[:, k, 1] - (np.arange(48) * 10 + 4.5)).argmin() for k in range(4)]
    expected = np.array([corners[own[k], k] for k in range(4)])
    assert np.abs(expected - corners_of(pose)).max() > 2
    np.testing.assert_allclose(sighting.corners, expected, atol=0.9)  # half a band, and the refinement


def test_no_camera_has_to_be_unrealistically_fast() -> None:
    """It shifts by ADVANCE times the distance per radian and standard deviation, of which five are enough."""
    rng, skew, readout = np.random.default_rng(3), 7.5, 0.03
    studio = Studio(CAMERAS["pinhole"], sensor=Sensor(readout=readout))
    fastest = skew / readout / LEAST * ADVANCE * 4.0 * 5
    for _ in range(300):
        pose, _ = studio.hang(4.0, rng)
        motion = studio.sway(pose, 0.0, rng, skew).motion
        assert np.linalg.norm(motion.rates[3:]) < fastest
