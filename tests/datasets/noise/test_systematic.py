"""A log corrected for its errors is the log without them."""

from dataclasses import replace

import numpy as np
import pytest

from planted_errors import drive, way
from slamduel.core.gyro import Gyro
from slamduel.core.se2 import between, wrap
from slamduel.datasets.noise.systematic import NAMES, Systematic, corrected, measured_motions, true_motions

ALL = Systematic(0.2, -0.1, 0.15, 0.07, -0.05, 0.02, 0.01, 0.03, -0.05, 0.02, 0.04, 0.1)
SINGLE = [Systematic(**{name: getattr(ALL, name)}) for name in NAMES]


def test_without_errors_it_is_the_same_log() -> None:
    log = drive(Systematic(), seconds=10).log
    assert corrected(log, Systematic()) is log


def test_what_wheels_measure_is_undone() -> None:
    _, path = way(20, 1)
    moved = between(path[:-1], path[1:])
    measured, J = measured_motions(moved, ALL)
    back, inverse = true_motions(measured, ALL)
    np.testing.assert_allclose(back, moved, atol=1e-15)
    np.testing.assert_allclose(J @ inverse, np.eye(3), atol=1e-15)


def test_a_gyros_turns_are_without_the_errors_of_turns() -> None:
    errors = Systematic(turn_scale=0.05, drift=0.1)
    wrong, right = (drive(one, noise=0.0, known=99.0, seconds=10).log for one in (errors, Systematic()))
    n = len(wrong) - 1
    gyro = Gyro.from_arrays(np.arange(1, n + 1), wrong.delta[1:, 2], np.full(n, 1e-6), np.diff(wrong.t))
    found = corrected(replace(wrong, gyro=gyro), errors).gyro
    assert found is not None
    np.testing.assert_allclose(wrap(found.turn - right.delta[1:, 2]), 0, atol=1e-12)
    np.testing.assert_allclose(found.dt, np.diff(wrong.t) / 1.05)
    np.testing.assert_allclose(found.var, 1e-6 / 1.05**2)


@pytest.mark.parametrize("errors", [*SINGLE, ALL])
def test_an_exact_log_is_put_right(errors: Systematic) -> None:
    """To rounding, but for the delay: between steps the body drives along arcs, and is interpolated along lines.

    The odometry is a step late: after its last one nothing is known.
    """
    wrong, right = (drive(one, noise=0.0, known=99.0).log for one in (errors, Systematic()))
    found = corrected(wrong, errors)
    tolerance = 0.01 if errors.delay else 1e-12
    told = slice(1, -1) if errors.lag else slice(1, None)
    assert found.delta[told] == pytest.approx(right.delta[told], abs=1e-12)
    same = np.isin(right.sighting_step * 100 + right.ids, found.sighting_step * 100 + found.ids)
    other = np.isin(found.sighting_step * 100 + found.ids, right.sighting_step * 100 + right.ids)
    assert same.mean() > 0.99  # a landmark right at the robot is not seen by one of both
    assert found.z[other, 0] == pytest.approx(right.z[same, 0], abs=tolerance)
    front = np.abs(wrong.z[other, 1]) < 3.0  # what is out of scale right behind the sensor looks as on the other side
    assert front.mean() > 0.9
    assert wrap(found.z[other, 1] - right.z[same, 1])[front] == pytest.approx(
        0, abs=2 * tolerance if errors.delay else 2e-11
    )


def test_covariances_scale_with_what_is_corrected() -> None:
    log = drive(Systematic(), seconds=10).log
    found = corrected(log, Systematic(range_scale=0.1, bearing_scale=-0.2, wheel_scale=0.25, turn_scale=0.6))
    np.testing.assert_allclose(found.z_cov[:, 0, 0], log.z_cov[:, 0, 0] / 1.1**2)
    np.testing.assert_allclose(found.z_cov[:, 1, 1], log.z_cov[:, 1, 1] / 0.8**2)
    np.testing.assert_allclose(found.delta_cov[1:, 0, 0], log.delta_cov[1:, 0, 0] / 1.25**2)
    np.testing.assert_allclose(found.delta_cov[1:, 2, 2], log.delta_cov[1:, 2, 2] / 1.6**2)
