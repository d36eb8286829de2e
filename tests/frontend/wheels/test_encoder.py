"""Wheel readings as odometry factors, against the documents' equations and numerical derivatives."""

from functools import reduce

import numpy as np
import pytest

from differences import central
from motions import chain
from slamduel.core import se2
from slamduel.core.factors import Odometry
from slamduel.core.se2 import Array
from slamduel.frontend.wheels import encoder
from slamduel.frontend.wheels.encoder import Curve, Encoder, Floors

CURVES: tuple[Curve, ...] = ("midpoint", "arc")
NO_FLOORS = Floors(0.0, 0.0)


def wheels(seed: int, n: int) -> tuple[Encoder, Array, Array]:
    """An encoder, random counts (n, 2) with wheels turning both ways, and durations (n,)."""
    rng = np.random.default_rng(seed)
    made = Encoder(left=2.3e-4, right=2.1e-4, base=0.4, k=0.03, noise="distance")
    return made, rng.normal(100, 300, (n, 2)), rng.uniform(0.01, 0.1, n)


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.9])
def test_midpoint_is_equation_1_and_its_covariance_equation_4(theta: float) -> None:
    wheel = Encoder(left=2.3e-4, right=2.1e-4, base=0.4, k=0.03, floors=NO_FLOORS)
    counts = np.array([[700.0, 900.0]])
    ds_l, ds_r = 700 * 2.3e-4, 900 * 2.1e-4
    b, ds, dth = 0.4, (ds_r + ds_l) / 2, (ds_r - ds_l) / 0.4
    pose = np.array([1.0, -2.0, theta])
    delta, cov = wheel.odometry(counts, np.array([0.1]))

    expected = pose + np.array([ds * np.cos(theta + dth / 2), ds * np.sin(theta + dth / 2), dth])
    np.testing.assert_allclose(se2.compose(pose, delta), expected, atol=1e-14)

    c, s = np.cos(theta + dth / 2), np.sin(theta + dth / 2)
    along, across = np.array([c, s, 0]) / 2, ds / (2 * b) * np.array([-s, c, 2 / ds])
    G_u = np.column_stack((along + across, along - across))  # by (ds_r, ds_l), in the world
    in_world = G_u @ np.diag([(0.03 * ds_r) ** 2, (0.03 * ds_l) ** 2]) @ G_u.T
    turn = se2.rotation(theta)
    np.testing.assert_allclose(turn @ cov @ turn.T, in_world, atol=1e-18)


@pytest.mark.parametrize("turn", [1.3, -0.4, 0.02001, 0.01999, 1e-5, 0.0, -3.0])
def test_arc_is_the_reports_and_the_surveys_circle(turn: float) -> None:
    distance, theta = 0.8, 0.6
    (delta,), _ = encoder.roll(np.array([[distance, turn]]), "arc")
    x, y, heading = se2.compose(np.array([0.0, 0.0, theta]), delta)
    if abs(turn) > 1e-3:  # eq. (3-1), the sign of x put right; the survey's v / omega is the same radius
        radius = distance / turn
        assert x == pytest.approx(radius * (np.sin(theta + turn) - np.sin(theta)), abs=1e-12)
        assert y == pytest.approx(radius * (np.cos(theta) - np.cos(theta + turn)), abs=1e-12)
    else:
        assert (x, y) == pytest.approx((distance * np.cos(theta), distance * np.sin(theta)), abs=distance * abs(turn))
    assert heading == pytest.approx(theta + turn)


def test_arc_is_what_ever_shorter_midpoint_steps_become() -> None:
    rolling = np.array([[0.8, 1.3]])
    pieces, _ = encoder.roll(np.repeat(rolling / 1000, 1000, axis=0), "midpoint")
    (arc,), _ = encoder.roll(rolling, "arc")
    end, _ = encoder.compose(pieces, np.zeros((1000, 3, 3)), NO_FLOORS)
    # A chord is too long by (a/2)^2 / 6 of itself, here with a = 0.0013.
    np.testing.assert_allclose(end, arc, atol=0.8 * (0.0013 / 2) ** 2 / 6 * 1.1)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("turn", [0.0, 1e-9, 0.0199, 0.0201, -0.5, 2.0])
def test_roll_jacobian(curve: Curve, turn: float) -> None:
    rolling = np.array([0.3, turn])
    _, (jacobian,) = encoder.roll(rolling[None], curve)
    expected = central(lambda r: encoder.roll(r[None], curve)[0][0], rolling)
    np.testing.assert_allclose(jacobian, expected, atol=1e-9)


def test_the_arc_has_no_seam_where_its_series_takes_over() -> None:
    turns = 0.02 * np.array([1 - 1e-12, 1 + 1e-12])
    deltas, jacobians = encoder.roll(np.stack((np.ones(2), turns), axis=-1), "arc")
    assert np.abs(np.diff(deltas, axis=0)).max() < 1e-13
    assert np.abs(np.diff(jacobians, axis=0)).max() < 1e-11


@pytest.mark.parametrize("curve", CURVES)
def test_composed_covariance_is_first_order_in_every_reading(curve: Curve) -> None:
    base, counts, dt = wheels(1, 6)
    wheel = Encoder(base.left, base.right, base.base, base.k, base.noise, curve=curve, floors=NO_FLOORS)
    found = wheel.odometry(counts, dt)

    def end(rolled: Array) -> Array:
        return wheel.odometry(rolled.reshape(-1, 2) / [base.left, base.right], dt).delta

    rolled = wheel.travel(counts)
    jacobian = central(end, rolled.ravel())
    expected = jacobian @ np.diag(wheel.variance(rolled, dt).ravel()) @ jacobian.T
    np.testing.assert_allclose(found.cov, expected, rtol=1e-7, atol=1e-13)


def test_composing_is_chaining_with_the_floors_added_once() -> None:
    base, counts, dt = wheels(3, 40)
    floors = Floors(0.01, 0.02)
    wheel = Encoder(base.left, base.right, base.base, base.k, base.noise, floors=floors)
    bare = Encoder(base.left, base.right, base.base, base.k, base.noise, floors=NO_FLOORS)
    single = [bare.odometry(counts[i : i + 1], dt[i : i + 1]) for i in range(40)]
    folded = reduce(lambda a, b: Odometry(*chain(*a, *b)), single)
    found = wheel.odometry(counts, dt)
    np.testing.assert_allclose(found.delta, folded.delta, atol=1e-13)
    np.testing.assert_allclose(found.cov, folded.cov + np.diag([1e-4, 1e-4, 4e-4]), rtol=1e-12)


@pytest.mark.parametrize("readings", [1, 100])
def test_at_rest_only_the_floors_are_left(readings: int) -> None:
    wheel, _, _ = wheels(0, 1)
    rest = wheel.odometry(np.zeros((readings, 2)), np.full(readings, 0.1))
    assert (rest.delta == 0).all()
    np.testing.assert_array_equal(rest.cov, wheel.floors.cov)


@pytest.mark.parametrize("noise", ["proportional", "distance"])
def test_covariance_is_positive_definite_and_symmetric(noise: str) -> None:
    base, counts, dt = wheels(5, 10)
    wheel = Encoder(base.left, base.right, base.base, base.k, "distance" if noise == "distance" else "proportional")
    for n in (1, 2, 10):
        cov = wheel.odometry(counts[:n], dt[:n]).cov
        assert (cov == cov.T).all()
        np.linalg.cholesky(cov)


def heading_sd(wheel: Encoder, readings: int) -> float:
    """Of a metre straight ahead in one second, in that many readings."""
    counts = np.full((readings, 2), 1.0 / readings)
    return float(np.sqrt(wheel.odometry(counts, np.full(readings, 1 / readings)).cov[2, 2]))


def test_equation_1_depends_on_how_often_it_is_read() -> None:
    wheel = Encoder(1.0, 1.0, base=0.719561485930414, k=0.01, floors=NO_FLOORS)
    assert [round(heading_sd(wheel, n), 3) for n in (1, 10, 100)] == [0.020, 0.006, 0.002]


@pytest.mark.parametrize(
    "wheel",
    [
        Encoder(1.0, 1.0, base=0.7, k=0.01, noise="distance", floors=NO_FLOORS),
        Encoder(1.0, 1.0, base=0.7, k=0.01, noise="proportional", interval=0.1, floors=NO_FLOORS),
    ],
)
def test_noise_that_composes(wheel: Encoder) -> None:
    expected = heading_sd(wheel, 10)
    assert [heading_sd(wheel, n) for n in (1, 7, 100)] == pytest.approx([expected] * 3, rel=1e-12)


def test_a_stated_interval_is_equation_1_at_that_interval() -> None:
    stated = Encoder(1.0, 1.0, base=0.7, k=0.01, interval=0.1, floors=NO_FLOORS)
    assert heading_sd(stated, 10) == pytest.approx(heading_sd(Encoder(1.0, 1.0, 0.7, 0.01, floors=NO_FLOORS), 10))


def test_the_heading_of_a_factor_is_wrapped() -> None:
    wheel = Encoder(left=1.0, right=1.0, base=1.0, k=0.1)
    turning = wheel.odometry(np.tile([-0.5, 0.5], (4, 1)), np.ones(4))
    assert turning.delta[2] == pytest.approx(4 - 2 * np.pi)
