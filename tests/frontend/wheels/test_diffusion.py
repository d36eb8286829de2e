"""White noise along an arc, against integrals and drives of small steps; however a motion is cut, it is the same."""

import numpy as np
import pytest

from slamduel.core.se2 import Array, compose
from slamduel.frontend.wheels.diffusion import along, even, spread
from slamduel.frontend.wheels.encoder import Floors
from slamduel.frontend.wheels.encoder import compose as joined
from slamduel.frontend.wheels.track import TrackNoise

TURNS = [0.0, 1e-9, 1e-3, -0.1, 0.1249, 0.1251, 0.2499, 0.2501, -0.7, 1.5, -3.0, np.pi]
NONE = Floors(0.0, 0.0)


def twisted(p: float, q: float, turn: float) -> Array:
    """(3,) the motion of a body that moves by p ahead and q to the left in axes of its own while it turns."""
    u, weight = np.polynomial.legendre.leggauss(30)
    heading, weight = turn * (u + 1) / 2, weight / 2
    c, s = np.cos(heading), np.sin(heading)
    return np.array([weight @ (c * p - s * q), weight @ (s * p + c * q), turn])


def integrated(p: float, q: float, turn: float, forward: float, turning: float) -> Array:
    """(3, 3) the integral over the arc of what an error at each of its points does to its end."""
    u, weight = np.polynomial.legendre.leggauss(30)
    end, total = twisted(p, q, turn), np.zeros((3, 3))
    for share, part in zip((u + 1) / 2, weight / 2, strict=True):
        x, y, heading = twisted(share * p, share * q, share * turn)
        by_turn = np.array([y - end[1], end[0] - x, 1.0])
        by_way = np.array([np.cos(heading), np.sin(heading), 0.0])
        total += part * (turning * np.outer(by_turn, by_turn) + forward * np.outer(by_way, by_way))
    return total


@pytest.mark.parametrize("turn", TURNS)
def test_the_covariance_is_the_integral_over_the_arc(turn: float) -> None:
    """Both are rounded: 1e-14 of 1 m^2, with S(x) from 1e-14 of a quotient near 0.25 rad."""
    rng = np.random.default_rng(4)
    for p, q in rng.normal(size=(8, 2)):
        forward, turning = rng.uniform(0.001, 1.0, 2)
        delta = twisted(p, q, turn)
        np.testing.assert_allclose(even(delta), (p, q), atol=1e-13)
        expected = integrated(p, q, turn, forward, turning)
        np.testing.assert_allclose(spread(delta, np.array(forward), np.array(turning)), expected, atol=2e-13)


def test_straight_ahead_it_is_the_textbooks() -> None:
    """T s^2 / 3 sideways and T s / 2 with the heading, of the turn's variance T."""
    found = spread(np.array([2.0, 0.0, 0.0]), np.array(0.25), np.array(0.09))
    np.testing.assert_allclose(found, [[0.25, 0, 0], [0, 0.12, 0.09], [0, 0.09, 0.09]], atol=1e-15)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("pieces", [2, 10])
def test_small_steps_compose_to_the_large_one(turn: float, pieces: int) -> None:
    """The pieces of an arc have its noise in proportion: to rounding, as errors act to first order in either."""
    noise = TrackNoise(0.05, 0.03, 0.05, NONE)
    whole = twisted(1.2, -0.3, turn)
    small = np.tile(along(whole, np.array(1 / pieces)), (pieces, 1))
    found = joined(small, noise.cov(small), NONE)
    end = found.delta - whole
    end[2] = np.arctan2(np.sin(end[2]), np.cos(end[2]))
    np.testing.assert_allclose(end, 0, atol=1e-13)
    np.testing.assert_allclose(found.cov, noise.cov(whole), atol=1e-15, rtol=1e-11)


def test_uneven_pieces_do_too() -> None:
    whole, shares = np.array([0.9, 0.4, 0.8]), np.array([0.05, 0.5, 0.15, 0.3])
    parts = np.array([along(whole, np.array(share)) for share in shares])
    found = joined(parts, spread(parts, 0.02 * shares, 0.04 * shares), NONE)
    np.testing.assert_allclose(found.delta, whole, atol=1e-14)
    np.testing.assert_allclose(found.cov, spread(whole, np.array(0.02), np.array(0.04)), atol=1e-15)


@pytest.mark.parametrize(("seed", "turn"), [(0, 0.0), (1, 0.6), (2, -1.4), (3, 2.8)])
def test_drives_of_small_steps_scatter_as_stated(seed: int, turn: float) -> None:
    """8,000 drives of 60 steps: sample covariance within 6 of its standard errors.

    Entry ij has variance (C_ij^2 + C_ii C_jj) / n. An error that acts from a step's middle on is off by a share
    1 / (4 60^2) of what it does; the second order is a share of the heading's variance, 0.004, of the diagonal.
    """
    noise, steps, n = TrackNoise(0.05, 0.03, 0.04, NONE), 60, 8000
    whole = twisted(1.0, 0.0, turn)
    half = along(whole, np.array(0.5 / steps))
    rng, pose = np.random.default_rng(seed), np.zeros((n, 3))
    forward, turning = noise.forward**2, noise.turning**2 + noise.turning_by_turn**2 * abs(turn)
    sd = np.sqrt(np.array([forward, 0.0, turning]) / steps)
    for _ in range(steps):
        pose = compose(compose(compose(pose, half), rng.standard_normal((n, 3)) * sd), half)
    off = pose - whole
    found, stated = np.cov(off.T), noise.cov(whole)
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    assert (np.abs(found - stated) < 6 * np.sqrt((stated**2 + scale**2) / n) + 3 * stated[2, 2] * scale).all()


def test_no_noise_is_none_and_all_others_are_covariances() -> None:
    rng = np.random.default_rng(1)
    delta = np.column_stack((rng.normal(size=(500, 2)), rng.uniform(-np.pi, np.pi, 500)))
    np.testing.assert_array_equal(spread(delta, np.zeros(500), np.zeros(500)), 0)
    found = spread(delta, rng.uniform(0, 1, 500), rng.uniform(0, 1, 500))
    np.testing.assert_allclose(found, found.swapaxes(1, 2), atol=1e-14)
    assert np.linalg.eigvalsh(found)[:, 0].min() > -1e-14
    np.testing.assert_array_equal(TrackNoise().cov(np.zeros(3)), 0)  # a robot that stands
