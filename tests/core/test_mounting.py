"""Sightings of a sensor that is not the body: from the sensor's own poses to the body's, exactly."""

import numpy as np
import pytest

from differences import central
from slamduel.core.factors import Log, Prior
from slamduel.core.mounting import Mounting, before, from_body, seen_from
from slamduel.core.se2 import Array, act, compose, inverse, summed, wrap

AHEAD = Mounting(0.3, -0.1, 0.4)
RNG = np.random.default_rng(5)


def range_bearing(pose: Array, place: Array) -> Array:
    x, y = act(inverse(pose), place)
    return np.array([np.hypot(x, y), np.arctan2(y, x)])


def drive(n: int = 40, dt: float = 0.1) -> tuple[Array, Array, Array]:
    """Times (n,), motions (n, 3) of speeds that change, and the path (n, 3)."""
    t = dt * np.arange(n)
    delta = np.column_stack((0.04 + 0.02 * np.sin(t), 0.001 * np.cos(t), 0.03 * np.cos(2 * t)))
    delta[0] = np.nan
    return np.asarray(t, np.float64), delta, summed(np.zeros(3), delta[1:])


@pytest.mark.parametrize("place", [(2.0, 1.0), (-1.0, 0.5), (0.0, -3.0), (-2.0, -1e-9)])
def test_a_place_is_seen_from_the_sensor_and_from_the_body(place: tuple[float, float]) -> None:
    here = range_bearing(np.zeros(3), np.array(place))[None]
    there = range_bearing(AHEAD.place, np.array(place))[None]
    cov = np.diag([0.01, 0.0004])[None]
    found, _ = from_body(there, cov, AHEAD.place)
    assert found[:, 0] == pytest.approx(here[:, 0], abs=1e-14)
    assert wrap(found[:, 1] - here[:, 1]) == pytest.approx(0, abs=1e-14)
    back = seen_from(AHEAD, here)
    assert back[:, 0] == pytest.approx(there[:, 0], abs=1e-14)
    assert wrap(back[:, 1] - there[:, 1]) == pytest.approx(0, abs=1e-14)


def test_covariances_are_propagated_by_the_derivative() -> None:
    z = np.column_stack((RNG.uniform(0.5, 5, 20), RNG.uniform(-3, 3, 20)))
    half = RNG.standard_normal((20, 2, 2)) * [0.1, 0.02]
    cov = half @ half.swapaxes(1, 2)
    found, expected = from_body(z, cov, AHEAD.place)[1], np.zeros((20, 2, 2))
    for k in range(20):
        J = central(lambda one, c=cov[k : k + 1]: from_body(one[None], c, AHEAD.place)[0][0], z[k])
        expected[k] = J @ cov[k] @ J.T
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(found, found.swapaxes(1, 2))


def test_a_landmark_at_the_origin_has_a_range_yet() -> None:
    there = seen_from(AHEAD, np.array([[1e-12, 0.0]]))
    z, cov = from_body(there, np.diag([0.01, 0.0004])[None], AHEAD.place)
    assert z[0, 0] == 1e-6
    assert np.isfinite(cov).all()


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.37, -0.05])
def test_a_late_sensor_saw_from_where_the_body_was(delay: float) -> None:
    t, delta, path = drive()
    places = np.array([[3.0, 2.0], [-2.0, 1.0], [0.5, -4.0]])
    then = np.stack([np.interp(t - delay, t, column) for column in path.T], axis=-1)
    step = np.repeat(np.arange(5, 35), 3)
    sensor = compose(then, AHEAD.place)
    seen = np.array([range_bearing(sensor[k], places[i % 3]) for i, k in enumerate(step)])
    expected = np.array([range_bearing(path[k], places[i % 3]) for i, k in enumerate(step)])
    log = Log.from_arrays(
        "",
        Prior(np.zeros(3), np.eye(3)),
        t,
        delta,
        np.broadcast_to(np.diag([1e-4, 1e-6, 1e-4]), (len(t), 3, 3)),
        step,
        np.arange(len(step)) % 3,
        seen,
        np.broadcast_to(np.diag([0.01, 0.0004]), (len(step), 2, 2)),
        sensor=AHEAD._replace(delay=delay),
    )
    tolerance = 1e-12 if delay in (0.0, 0.1) else 1e-3  # between steps the way is a curve
    assert log.z[:, 0] == pytest.approx(expected[:, 0], abs=tolerance)
    assert wrap(log.z[:, 1] - expected[:, 1]) == pytest.approx(0, abs=tolerance)


def test_between_steps_a_robot_that_sets_off_does_not_jump_to_its_speed() -> None:
    """Five steps a second at 0.4 m/s^2, 50 ms before: along straight lines it would be 1.5 mm off everywhere."""
    t = np.arange(11, dtype=np.float64) * 0.2
    delta = np.zeros((11, 3))
    delta[1:, 0] = np.diff(0.2 * t**2)
    found = before(t, delta, 0.05)[2:-1, 0]
    assert found == pytest.approx(0.2 * (t[2:-1] - 0.05) ** 2 - 0.2 * t[2:-1] ** 2, abs=2e-4)


def test_before_the_first_step_the_body_stands() -> None:
    t, delta, path = drive()
    found = before(t, delta, 1e3)
    assert found[:, :2] == pytest.approx(act(inverse(path), path[:1, :2]), abs=1e-12)
