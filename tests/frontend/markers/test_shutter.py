"""Markers seen by a rolling shutter of a camera that moves: rendered row by row, with the motion known or nearly so."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from slamduel.bench.front_ends.corners import errors_in
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.marker_shots import Placement, Studio
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.frontend.camera.shutter import CameraMotion, SweptPlane
from slamduel.frontend.markers.aruco import Detector, Refinement
from slamduel.frontend.markers.markers import Markers
from tiers import first_quick

READOUT = 0.03
CAMERA = replace(CAMERAS["pinhole"], readout=READOUT)
MARKERS = Markers("4X4_50", 0.16)
DETECTOR = Detector(MARKERS, CAMERA)
COUNT = 24


@cache
def shots(distance: float, skew: float, count: int) -> list[Placement]:
    # with 4 samples a pixel, edges along the rows are drawn 0.1 px off
    studio = Studio(CAMERA, samples=8, sensor=Sensor(readout=READOUT))
    rngs = [np.random.default_rng([7, round(10 * distance), k]) for k in range(count)]
    return [studio.place(distance, rng, skew=skew) for rng in rngs]


def errors(placements: list[Placement], detector: Detector = DETECTOR) -> Array:
    """(found, 3) errors of distance, m, and bearing, rad, and normalised squared errors."""
    return np.array([row for shot in placements for row in errors_in(detector, shot)[0]])


def honest(found: Array, distance: float, count: int) -> None:
    """Nearly all are found, the distance's bias is below 0.1 %, and NEES within 0.5 to 2."""
    assert len(found) >= 0.9 * count
    assert abs(found[:, 0].mean()) < 1e-3 * distance
    assert 0.5 < found[:, 2].mean() / 2 < 2


@pytest.mark.parametrize(("distance", "skew"), first_quick([(2.0, 17.0), (1.0, 7.5), (3.0, 7.5)]))
def test_sightings_are_as_good_as_stated(distance: float, skew: float) -> None:
    honest(errors(shots(distance, skew, COUNT)), distance, COUNT)


@pytest.mark.slow
@pytest.mark.parametrize("skew", [7.5, 17.0])
@pytest.mark.parametrize("distance", [1.0, 2.0, 3.0, 4.0])
def test_many_sightings_are_as_good_as_stated(distance: float, skew: float) -> None:
    honest(errors(shots(distance, skew, 100)), distance, 100)


def test_without_the_motion_they_are_wrong_by_many_standard_deviations() -> None:
    placements = shots(3.0, 7.5, COUNT)
    for detector, given in (
        (Detector(MARKERS, CAMERAS["pinhole"]), placements),
        (DETECTOR, [shot._replace(motion=None) for shot in placements]),
    ):
        found = errors(given, detector)
        assert len(found) > 0.9 * COUNT
        assert np.median(found[:, 2]) > 100


@pytest.mark.parametrize("refinement", ["none", "subpix"])
def test_other_refinements_are_corrected_too(refinement: Refinement) -> None:
    placements = shots(2.0, 17.0, COUNT)
    corrected = errors(placements, Detector(MARKERS, CAMERA, refinement))
    ignored = errors(placements, Detector(MARKERS, CAMERAS["pinhole"], refinement))
    assert np.abs(corrected[:, 1]).mean() < 0.3 * np.abs(ignored[:, 1]).mean()


def test_the_motions_uncertainty_is_in_the_covariance() -> None:
    """With motions that are wrong as stated, NEES is 1; with the same errors unstated it is far off."""
    rng = np.random.default_rng(5)
    sd = np.repeat([0.05, 0.05], 3)  # rad/s and m/s
    placements = [shot for _ in range(4) for shot in shots(2.0, 17.0, COUNT)]
    wrong = [shot.motion.rates + sd * rng.normal(size=6) for shot in placements if shot.motion is not None]
    assert len(wrong) == len(placements)
    stated, unstated = (
        errors([shot._replace(motion=CameraMotion(r, cov)) for shot, r in zip(placements, wrong, strict=True)])
        for cov in (np.diag(sd**2), np.zeros((6, 6)))
    )
    honest(stated, 2.0, len(placements))
    assert unstated[:, 2].mean() / 2 > 20


def test_a_motion_of_which_only_the_size_is_known_leaves_honest_sightings() -> None:
    """As of a robot without wheels' readings: the marker's own slant tells a part, the covariance has the rest."""
    placements = shots(2.0, 17.0, COUNT)
    rates = np.array([shot.motion.rates for shot in placements if shot.motion is not None])
    unknown = CameraMotion(np.zeros(6), np.diag((rates**2).mean(axis=0)))
    found = errors([shot._replace(motion=unknown) for shot in placements])
    assert len(found) > 0.9 * COUNT
    assert 0.5 < found[:, 2].mean() / 2 < 2


def test_corners_are_where_the_image_has_them() -> None:
    for shot in shots(2.0, 17.0, COUNT)[:6]:
        assert shot.motion is not None
        ((one,), _), ((ignored,), _) = DETECTOR.detect(shot.image, shot.motion), DETECTOR.detect(shot.image)
        np.testing.assert_allclose(one.corners, ignored.corners, atol=0.3)
        outline = MARKERS.side_of(one.id) / 2 * np.array([[-1.0, 1], [1, 1], [1, -1], [-1, -1]])
        points = np.column_stack((outline, np.zeros(4))) @ shot.pose[:3, :3].T + shot.pose[:3, 3]
        expected = SweptPlane(CAMERA, shot.pose, shot.motion).seen(points[:, :2] / points[:, 2:])
        np.testing.assert_allclose(one.corners, expected, atol=17 / 48)  # the frame is rendered in 48 bands of rows


def test_a_motion_of_nothing_is_a_camera_that_stands() -> None:
    (shot,) = shots(2.0, 0.0, 1)
    (still,), _ = DETECTOR.detect(shot.image)
    (moved,), _ = DETECTOR.detect(shot.image, CameraMotion(np.zeros(6), np.zeros((6, 6))))
    np.testing.assert_allclose(moved.centre, still.centre, atol=1e-6)
    np.testing.assert_allclose(moved.corners, still.corners, atol=1e-4)
    np.testing.assert_allclose(moved.centre_cov, still.centre_cov, rtol=1e-3, atol=1e-12)
