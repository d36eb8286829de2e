"""What is expected of a marker's look: any camera's, or that of a camera whose response was calibrated."""

import numpy as np
import pytest

from slamduel.frontend.camera.response import Measured, Response
from slamduel.frontend.markers._grey import INK, SHARP, TONE, A, C
from slamduel.frontend.markers.prior import DRIFT, UNKNOWN_CAMERA, prior_of


def response(gamma: float, sharpening: float, sd: float) -> Response:
    return Response(Measured(gamma, gamma * sd), Measured(sharpening, sd), Measured(1.3, 0.1))


def test_nothing_is_required_of_a_camera() -> None:
    np.testing.assert_array_equal(prior_of(None), UNKNOWN_CAMERA)


def test_a_calibrated_camera_has_its_own_tone_sharpening_and_blur() -> None:
    found = prior_of(response(2.2, 0.8, 0.0))
    others = np.setdiff1d(np.arange(found.shape[1]), np.array([TONE, SHARP, A, C]) - A)
    np.testing.assert_array_equal(found[:, others], UNKNOWN_CAMERA[:, others])
    np.testing.assert_allclose(found[0, [0, C - A]], np.log(1.3))
    assert found[0, TONE - A] == pytest.approx(np.log(2.2), rel=0.05)
    assert found[0, SHARP - A] == pytest.approx(0.8, rel=0.02)
    assert found[1, TONE - A] == pytest.approx(DRIFT, rel=0.03)
    assert found[1, INK - A] == UNKNOWN_CAMERA[1, INK - A]


def test_a_calibration_that_hardly_knows_changes_hardly_anything() -> None:
    found, tone = prior_of(response(3.0, 1.5, 50.0)), UNKNOWN_CAMERA[:, TONE - A]
    np.testing.assert_allclose(found[:, TONE - A], tone, atol=1e-3)
    np.testing.assert_allclose(found[:, SHARP - A], UNKNOWN_CAMERA[:, SHARP - A], atol=1e-3)


def test_both_count_by_their_variances() -> None:
    found = prior_of(response(2.2, 0.8, 0.4))
    measured = 0.4**2 + DRIFT**2
    default = UNKNOWN_CAMERA[1, TONE - A] ** 2
    assert found[0, TONE - A] == pytest.approx(np.log(2.2) / measured / (1 / measured + 1 / default))
    assert found[1, TONE - A] == pytest.approx((1 / measured + 1 / default) ** -0.5)
