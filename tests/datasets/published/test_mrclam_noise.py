import numpy as np
import pytest

from motions import chained
from slamduel.core.factors import UNKNOWN, Log, Map, Prior, Truth
from slamduel.core.se2 import Array, Ints, between, wrap
from slamduel.core.truth.errors import sighting_errors
from slamduel.datasets.published.mrclam_noise import HORIZON, motion_errors, noise

STEPS, GROSS = 3000, 7
BIAS, SD = np.array([0.05, -0.01]), np.array([0.1, 0.02])
MOTION = np.array([0.02, 0.005, 0.03])
FORWARD = np.array([0.1, 0.0, 0.05])
PLACES = Map(np.array([9, 6, 7]), np.array([[5.0, 1.0], [-2.0, 6.0], [0.0, -1.0]]), None)


def dataset(rng: np.random.Generator, alike: float = 0.0) -> tuple[Log, Truth]:
    """A robot that drives circles, a step a second, and sights a landmark in each, its errors `alike` those of before.

    Each landmark is sighted twenty times in a row. The truth has a gap; the last three sightings are of nobody known.
    """
    poses = chained(np.broadcast_to(FORWARD, (STEPS - 1, 3)))
    ids = np.array([9, 6, 7])[np.arange(STEPS) // 20 % 3]
    white = rng.normal(size=(STEPS, 2))
    errors = white.copy()
    for k in range(1, STEPS):
        errors[k] = alike * errors[k - 1] + np.sqrt(1 - alike**2) * white[k]
    errors = BIAS + SD * errors
    errors[100 : 100 + GROSS, 1] = 2.0
    z = exact(poses, ids) + errors
    z[:, 1] = wrap(z[:, 1])
    ids = np.concatenate((ids[:-3], [UNKNOWN, UNKNOWN, 8]))
    delta = np.concatenate((np.zeros((1, 3)), FORWARD + MOTION * rng.normal(size=(STEPS - 1, 3))))
    cov = np.broadcast_to(np.eye(3), (STEPS, 3, 3))
    t, z_cov = np.arange(STEPS, dtype=float), np.broadcast_to(np.eye(2), (STEPS, 2, 2))
    log = Log.from_arrays("x", Prior(poses[0], np.eye(3)), t, delta, cov, np.arange(STEPS), ids, z, z_cov)
    there = (t < 200) | (t >= 210)
    return log, Truth(t[there], poses[there], PLACES, None, "truth")


def exact(poses: Array, ids: Ints) -> Array:
    xy = np.array([PLACES.xy[PLACES.ids.tolist().index(one)] for one in ids.tolist()])
    x, y = between(poses, np.column_stack((xy, np.zeros(len(xy)))))[:, :2].T
    return np.stack((np.hypot(x, y), np.arctan2(y, x)), axis=-1)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_bias_and_spread_are_found_beside_gross_errors(rng: np.random.Generator):
    """Within six standard errors: of a Gaussian's median 1.25 sd / sqrt n, of its MAD 1.17, of its RMS 0.71."""
    log, truth = dataset(rng)
    found, few = noise(log, truth), 6 / np.sqrt(STEPS)
    assert found["gross"] == GROSS
    assert found["sightings compared"] == STEPS - 10 - 3
    for name, bias, sd in zip(("range", "bearing"), BIAS, SD, strict=True):
        assert found[name]["median"] == pytest.approx(bias, abs=1.25 * sd * few + 5e-5)
        assert found[name]["sd by MAD"] == pytest.approx(sd, abs=1.17 * sd * few + 5e-5)
        assert found[name]["RMS"] == pytest.approx(np.hypot(bias, sd), abs=1.5 * sd * few)
        assert found[name]["correlation within 1 s"] == pytest.approx(0, abs=few)


def test_errors_that_repeat_are_seen_to(rng: np.random.Generator):
    log, truth = dataset(rng, alike=0.9)
    found = noise(log, truth)
    assert found["range"]["correlation within 1 s"] == pytest.approx(0.9, abs=6 * np.sqrt((1 - 0.9**2) / STEPS) + 5e-3)


def test_motion_errors_are_those_of_a_second_whatever_the_horizon(rng: np.random.Generator):
    log, truth = dataset(rng)
    for horizon in (1.0, HORIZON):
        errors = motion_errors(log, truth, horizon)
        n = STEPS / horizon
        assert 0.9 * n < len(errors) < n
        rms = np.sqrt((errors**2).mean(axis=0))
        assert rms[0] == pytest.approx(MOTION[0], rel=6 / np.sqrt(2 * n))
        assert rms[2] == pytest.approx(MOTION[2], rel=6 / np.sqrt(2 * n))
    # across: its own, and what turns that went wrong on the way make of a forward speed, sum_k (k v s)^2 / T
    k = np.arange(HORIZON)
    across = np.sqrt(MOTION[1] ** 2 + (k**2).sum() * (FORWARD[0] * MOTION[2]) ** 2 / HORIZON)
    assert np.sqrt((motion_errors(log, truth)[:, 1] ** 2).mean()) == pytest.approx(across, rel=0.25)


def test_where_nothing_is_known_nothing_is_said(rng: np.random.Generator):
    log, truth = dataset(rng)
    unknown = truth._replace(map=None)
    assert not len(sighting_errors(log, unknown).row)
    few = unknown._replace(t=truth.t[:5], poses=truth.poses[:5])
    assert noise(log.head(5), few) == {"sightings compared": 0, "gross": 0}
