"""How far a sighting is trusted: the document's model, what corners propagate to, and whether that is true."""

from functools import cache

import cv2
import numpy as np
import pytest

from slamduel.bench.front_ends.corners import errors_in
from slamduel.core.factors import UNKNOWN, RangeBearing
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.datasets.rendering.marker_shots import placements
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Detector, Sighting, range_bearing, square
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.markers.noise import (
    Measured,
    PropagatedNoise,
    ProportionalNoise,
    leant,
    rocking,
    rocking_slope,
    together,
)
from slamduel.frontend.markers.square_pose import square_poses
from tiers import first_quick

CAMERA = Camera(640, 480, (576.0, 574.0), (321.7, 238.4), (-0.21, 0.06, 8e-4, -6e-4, 0), mounting(0.1, 0.05, 0.7, 0.3))
DETECTOR = Detector(Markers("4X4_50", 0.16), CAMERA)


def corner_rays(distance: float, lean: float) -> Array:
    """(4, 2) of a marker ahead to the right, leaning by so many rad."""
    turn = np.asarray(cv2.Rodrigues(np.array([lean, 0.6 * lean, 0.0]))[0]) @ np.diag([1.0, -1.0, -1.0])
    points = square(0.16) @ turn.T + distance * np.array([0.2, -0.1, 1.0])
    return points[:, :2] / points[:, 2:]


def located(rays: Array, cov: Array) -> Sighting:
    found = DETECTOR.locate(7, rays, cov)
    assert found is not None
    return found


def test_noise_is_equation_10_with_floors() -> None:
    z = np.array([[2.0, -0.3], [1.0, 0.0]])
    noise = ProportionalNoise(k_range=0.05, k_bearing=0.04, floor_range=0.02, floor_bearing=0.01)
    ahead = np.diag([0.05**2 + 0.02**2, 0.01**2])
    aside = np.diag([0.1**2 + 0.02**2, 0.012**2 + 0.01**2])
    np.testing.assert_allclose(noise.cov(z), [aside, ahead], atol=1e-18)
    np.testing.assert_allclose(ProportionalNoise(0.05, 0.05, 0, 0).cov(z)[0], np.diag([0.1**2, 0.015**2]), atol=1e-18)


def test_nothing_seen_has_no_noise() -> None:
    for noise in (ProportionalNoise(), PropagatedNoise()):
        z, cov = noise.measure([], CAMERA.mounting)
        assert z.shape == (0, 2)
        assert cov.shape == (0, 2, 2)


@pytest.mark.parametrize("lean", [0.5, -0.7])
def test_propagation_is_that_of_the_corners_one_by_one(lean: float) -> None:
    """d (range, bearing) / d corners by central differences through the pose and the mounting, for a sure pose.

    The corners are a square's, so the misses that Gauss and Newton's covariance leaves out are none.
    """
    rng = np.random.default_rng(1)
    root = np.eye(8) + 0.3 * rng.normal(size=(8, 8))
    cov = (0.02 / 576) ** 2 * root @ root.T
    rays = corner_rays(0.8, lean)
    sighting = located(rays, cov)
    assert sighting.ambiguity < 1e-6
    h, by_corner = 1e-5, np.zeros((2, 8))
    for k in range(8):
        step = np.zeros(8)
        step[k] = h
        ends = [range_bearing([located(rays + way * step.reshape(4, 2), cov)], CAMERA.mounting)[0] for way in (-1, 1)]
        by_corner[:, k] = (ends[1] - ends[0]) / (2 * h)
    _, (stated,) = PropagatedNoise().measure([sighting], CAMERA.mounting)
    numeric = by_corner @ cov @ by_corner.T
    sd = np.sqrt(np.diag(numeric))
    np.testing.assert_allclose(stated / np.outer(sd, sd), numeric / np.outer(sd, sd), atol=5e-3)
    assert abs(numeric[0, 1]) > 0.05 * sd[0] * sd[1]  # the correlation is there, and of the right sign


def test_where_the_two_poses_cannot_be_told_apart_both_count() -> None:
    """A far marker that leans a little: the centre lies between, and its covariance reaches both."""
    rays, cov = corner_rays(4.0, 0.12), (0.3 / 576) ** 2 * np.eye(8)
    sighting = located(rays, cov)
    assert sighting.ambiguity > 0.5
    weight = sighting.ambiguity / (1 + sighting.ambiguity)
    apart = (sighting.centre - sighting.pose[:3, 3]) / weight  # from the likelier pose's centre to the other's
    likelier, other = square_poses(rays, cov, 0.16)
    np.testing.assert_allclose(apart, other.pose[:3, 3] - likelier.pose[:3, 3], atol=1e-9)
    others = sighting.centre_cov - weight * (1 - weight) * np.outer(apart, apart)
    assert np.linalg.eigvalsh(others).min() > 0  # what is left are the two poses' own
    sure = located(rays, 1e-4 * cov)
    assert sure.ambiguity < sighting.ambiguity


def test_scale_and_floors() -> None:
    sighting = located(corner_rays(1.0, 0.5), (0.1 / 576) ** 2 * np.eye(8))
    _, (plain,) = PropagatedNoise().measure([sighting], CAMERA.mounting)
    z, (more,) = PropagatedNoise(scale=2.0, floor_range=0.03, floor_bearing=0.004).measure([sighting], CAMERA.mounting)
    np.testing.assert_allclose(more, 4 * plain + np.diag([0.03**2, 0.004**2]), rtol=1e-12)
    np.testing.assert_allclose(z, range_bearing([sighting], CAMERA.mounting))
    stated = {"model": "propagated", "scale": 2, "floor_range": 0, "floor_bearing": 0, "sway": 0.01}
    assert PropagatedNoise(2.0, sway=0.01).settings == stated


def test_sway_counts_by_the_height_over_the_robots_plane() -> None:
    sighting = located(corner_rays(1.5, 0.5), (0.1 / 576) ** 2 * np.eye(8))
    height = float(CAMERA.mounting[2, :3] @ sighting.centre + CAMERA.mounting[2, 3])
    assert 0.3 < height < 0.6  # the camera is 0.7 m up and looks down
    for model in (PropagatedNoise, ProportionalNoise):
        z, (plain,) = model().measure([sighting], CAMERA.mounting)
        _, (more,) = model(sway=0.01).measure([sighting], CAMERA.mounting)
        moved = 0.01 * height * np.array([1, 1 / z[0, 0]])
        np.testing.assert_allclose(more - plain, np.diag(moved**2), rtol=0.02, atol=1e-12)


def rocked_sightings(height: float, sway: float, bearing: float) -> tuple[Array, Array, Array]:
    """Errors (n, 2) by rocking alone of points 2 m away, and their measured ranges and heights (n,)."""
    rng = np.random.default_rng(4)
    place = np.array([2 * np.cos(bearing), 2 * np.sin(bearing), height])
    turns = [rocked(*(sway * rng.standard_normal(2)))[:3, :3] for _ in range(4000)]
    x, y, h = np.array([place @ turn for turn in turns]).T
    reach = np.hypot(x, y)
    return np.stack((reach - 2, np.arctan2(y, x) - bearing), axis=-1), reach, h


@pytest.mark.parametrize("sway", [0.005, 0.02, 0.06])
@pytest.mark.parametrize("bearing", [0.0, 0.5, -1.2])
@pytest.mark.parametrize("height", [1.5, 0.6, -0.8])
def test_the_rocking_of_a_body_is_stated_at_every_height(height: float, bearing: float, sway: float) -> None:
    errors, reach, h = rocked_sightings(height, sway, bearing)
    squared = errors**2 / np.einsum("kii->ki", rocking(sway, reach, h))
    # Four standard deviations of a mean of 4,000 squares; the height that is measured is off by 2 m of sway itself.
    np.testing.assert_allclose(squared.mean(axis=0), 1, atol=4 * np.sqrt(2 / 4000) + 7 * (2 * sway / height) ** 2)


@pytest.mark.parametrize("sway", [0.01, 0.05])
@pytest.mark.parametrize("bearing", [0.0, 0.5, -1.2])
def test_on_the_floor_rocking_is_stated_to_within_its_order(bearing: float, sway: float) -> None:
    """There the first order vanishes: what is left is of the size of sway^2, in the mean and not in each sighting.

    Of what a height of zero, measured by a rocking body, adds on average there is 0.48 (sway^2 r)^2, so that 0.75 of
    range is stated as 1.23. Of bearings it is the squared cosine of the bearing, as pitch and roll together turn the
    body, which is 1/2 on average and stated as 0.98.
    """
    errors, reach, h = rocked_sightings(0.0, sway, bearing)
    stated = np.einsum("kii->ki", rocking(sway, reach, h)).mean(axis=0)
    ratio = (errors**2).mean(axis=0) / stated
    assert ratio[0] == pytest.approx(0.75 / 1.23, rel=0.1)
    assert ratio[1] == pytest.approx(np.cos(bearing) ** 2 / 0.98, rel=0.1)


def test_what_levels_leave_is_the_rocking_where_pitch_and_roll_are_alike() -> None:
    z, height = np.array([[2.0, 0.4], [1.0, -1.2], [3.0, 0.0]]), np.array([0.6, -0.5, 1.5])
    both = np.array([[0, 0.01, 0], [0.01, 0, 0]])
    np.testing.assert_allclose(leant(both, z, height), rocking(0.01, z[:, 0], height), rtol=1e-9, atol=1e-12)
    for model in (PropagatedNoise(sway=0.3), ProportionalNoise(sway=0.3)):
        sighting = located(corner_rays(1.5, 0.5), (0.1 / 576) ** 2 * np.eye(8))
        _, levelled = model.measure([sighting], CAMERA.mounting, both)
        _, expected = type(model)(sway=0.01).measure([sighting], CAMERA.mounting)
        np.testing.assert_allclose(levelled, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("place", [(2.0, 0.3, 0.6), (1.5, -1.0, -0.5), (0.8, 0.1, 1.5), (2.5, 0.5, 0.0)])
def test_what_levels_leave_is_stated_in_every_direction(place: tuple[float, float, float]) -> None:
    rng, leaning = np.random.default_rng(6), np.array([[0.0, 4e-3, 0.0], [9e-3, 0.0, -2e-3]])
    turns = [np.asarray(cv2.Rodrigues(one)[0]) for one in rng.standard_normal((4000, 2)) @ leaning]
    x, y, h = np.array([turn @ np.array(place) for turn in turns]).T
    z = np.column_stack((np.hypot(x, y), np.arctan2(y, x)))
    errors = z - [np.hypot(*place[:2]), np.arctan2(place[1], place[0])]
    stated = leant(leaning, z, h)
    whitened = np.linalg.solve(np.linalg.cholesky(stated), errors[:, :, None])[:, :, 0]
    if place[2]:
        np.testing.assert_allclose(whitened.T @ whitened / 4000, np.eye(2), atol=0.15)
    else:  # on the floor the range has an error of second order alone, which is stated to within its order
        assert 0.5 < (whitened[:, 1] ** 2).mean() < 1.1
        assert (whitened[:, 0] ** 2).mean() < 1.0


def test_the_slope_of_rocking_is_its_derivative() -> None:
    reach, height = np.array([0.5, 2.0, 3.0, 2.0]), np.array([0.4, 0.6, 0.0, 0.03])
    for sway in (0.005, 0.02, 0.1):
        ends = [rocking(np.sqrt(sway**2 * (1 + way)), reach, height) for way in (-1e-5, 1e-5)]
        numeric = (ends[1] - ends[0]) / (2e-5 * sway**2)
        np.testing.assert_allclose(rocking_slope(sway, reach, height), numeric, rtol=1e-6, atol=1e-10)


COUNT = 36
DISTANCES = (1.0, 2.0, 3.0, 4.0)
WORST_SD = {1.0: 0.6e-3, 2.0: 2.5e-3, 3.0: 25e-3, 4.0: 38e-3}
"""m, what OpenCV's subpix refinement has there."""


@cache
def errors(distance: float) -> Array:
    """(found, 3) errors of distance and bearing and the normalised squared error, of COUNT rendered markers."""
    camera = CAMERAS["pinhole"]
    shots = placements(camera, distance, COUNT, np.random.default_rng(round(10 * distance)), samples=6)
    detector = Detector(Markers("4X4_50", 0.16), camera)
    return np.array([row for shot in shots for row in errors_in(detector, shot)[0]])


@pytest.mark.parametrize("distance", first_quick(DISTANCES))
def test_rendered_markers_are_where_they_are(distance: float) -> None:
    farther, turned, _ = errors(distance).T
    assert len(farther) >= 0.9 * COUNT  # 99 % are found: chance loses four of 36 once in a thousand times
    assert abs(farther.mean()) < 0.005 * distance
    assert farther.std(ddof=1) < WORST_SD[distance]
    assert abs(turned.mean()) < np.deg2rad(0.01)


def test_the_stated_covariance_is_true() -> None:
    """Pooled over the distances: a mean of chi-squares of 2, whose standard deviation is 2 / sqrt(n), is 2.

    The band of 1.6 to 2.4 that is asked for with many, and four standard deviations for so few.
    """
    normalised = np.concatenate([errors(distance)[:, 2] for distance in DISTANCES])
    chance = 4 * 2 / np.sqrt(len(normalised))
    assert 1.6 - chance < normalised.mean() < 2.4 + chance
    assert np.median(normalised) == pytest.approx(2 * np.log(2), rel=0.5)  # a chi-square's of two


def test_two_measurements_of_one_marker_are_their_best_mean() -> None:
    """Against the least-squares estimate by the joint covariance, with what the body does in both, across pi."""
    rng = np.random.default_rng(0)
    first, second, body = (one @ one.T for one in rng.normal(size=(3, 2, 2)) * 0.01)
    ids, z = np.array([7, 3]), np.array([[2.0, np.pi - 0.01], [1.0, 0.5]])
    seen = np.array([[2.02, -np.pi + 0.005], [1.5, 0.2], [0.9, 0.1]])
    one = Measured(RangeBearing(ids, z, np.tile(first + body, (2, 1, 1))), np.tile(body, (2, 1, 1)))
    told = RangeBearing(np.array([7, 4, UNKNOWN]), seen, np.tile(second + body, (3, 1, 1)))
    found, shared = together(one, Measured(told, np.tile(body, (3, 1, 1))))
    assert found.ids.tolist() == [7, 3, 4, UNKNOWN]
    joint = np.block([[first + body, body], [body, second + body]])
    twice = np.vstack((np.eye(2), np.eye(2)))
    cov = np.linalg.inv(twice.T @ np.linalg.solve(joint, twice))
    both = np.r_[z[0], seen[0] + (0.0, 2 * np.pi)]
    mean = cov @ twice.T @ np.linalg.solve(joint, both)
    mean[1] = wrap(mean[1])
    np.testing.assert_allclose(found.z, [mean, z[1], *seen[1:]], atol=1e-12)
    np.testing.assert_allclose(found.cov[0], cov, rtol=1e-9)
    np.testing.assert_allclose(found.cov[1:], [first + body, *[second + body] * 2])
    np.testing.assert_array_equal(shared, [body] * 4)
