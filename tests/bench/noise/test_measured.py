"""The noise of whole logs: what is drawn is found, with a true path and without."""

from dataclasses import replace

import numpy as np
import pytest

from noisy_logs import REACH, Slow, noisy
from slamduel.bench.noise.innovations import likelihood, scaled_by
from slamduel.bench.noise.measured import measured
from slamduel.bench.noise.together import together
from slamduel.bench.noise.words import rows, sentences
from slamduel.bench.plan.load import load
from slamduel.bench.systematic.estimated import Estimated
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Log, Prior

WORLD = "circle[steps=600]"
RANGE = Slow(scale=1.5, power=0.4, share=0.8, time=6.0)
BEARING = Slow(scale=0.8)


def near(one: Estimated, true: float) -> bool:
    """True within four standard errors."""
    return abs(one.value - true) < (one.high - one.low)


def test_what_is_drawn_is_found_and_said() -> None:
    noise = measured([noisy(WORLD, 7, RANGE, BEARING, (1.3, 0.7, 1.2))], ["drawn"])
    one, other = noise.range.fitted, noise.bearing.fitted
    assert one.power is not None
    assert near(one.scale, 1.5 * (one.reach / REACH) ** 0.4)
    assert near(one.power, 0.4)
    assert near(one.correlation.time, 6.0)
    assert near(one.correlation.share, 0.8)
    assert near(other.scale, 0.8)
    assert other.correlation is None
    assert all(near(found, true) for found, true in zip(noise.motions.horizons[0].scales, (1.3, 0.7, 1.2), strict=True))
    said = sentences(noise)
    assert said[0].startswith(f"Range errors stay correlated for {one.correlation.time.value:.2f} s")
    assert said[1] == "Bearing errors are not correlated from one sighting of a landmark to the next."
    assert all(row.estimate.low <= row.estimate.value <= row.estimate.high for row in rows(noise))


def test_several_logs_have_narrower_intervals_and_share_one_noise() -> None:
    logs = [noisy("circle[steps=300]", seed, RANGE, BEARING) for seed in range(4)]
    one, all_ = measured(logs[:1], ["a"]), measured(logs, ["a", "b", "c", "d"])
    first, joint = one.bearing.fitted.scale, all_.bearing.fitted.scale
    assert joint.high - joint.low < 0.7 * (first.high - first.low)
    assert near(joint, 0.8)


def test_errors_of_landmarks_sighted_at_one_step_are_compared() -> None:
    common = measured([noisy(WORLD, 8, RANGE, BEARING._replace(together=0.6))], ["common"])
    assert common.range is not None
    assert common.bearing is not None
    assert common.bearing.together is not None
    assert near(common.bearing.together, 0.6)
    assert common.bearing.model.together == common.bearing.together.value
    assert common.range.together is not None
    assert near(common.range.together, 0.0)


def test_the_correlation_of_pairs_is_that_of_all_pairs_one_by_one() -> None:
    rng = np.random.default_rng(0)
    step = np.sort(rng.integers(0, 60, 200))
    error = rng.standard_normal(200)
    pairs = [(a, b) for a in range(200) for b in range(a) if step[a] == step[b]]
    product = sum(error[a] * error[b] for a, b in pairs)
    size = sum((error[a] ** 2 + error[b] ** 2) / 2 for a, b in pairs)
    found = together(step, error)
    assert found.value == pytest.approx(product / size, rel=1e-12)
    assert found.low < 0 < found.high


def test_innovations_are_likeliest_at_the_noise_that_is_drawn() -> None:
    log, _ = noisy("circle[steps=60]", 9, Slow(scale=1.5), Slow(scale=0.8), (1.3, 1.3, 0.7))
    right = np.array([1.3, 0.7, 1.5, 0.8])
    best = likelihood(scaled_by(log, right))
    for k in range(1, 4):
        for factor in (0.5, 2.0):
            other = right.copy()
            other[k] *= factor
            found = likelihood(scaled_by(log, other))
            assert found < best - 5


def test_innovations_of_a_first_pair_of_sightings_have_the_likelihood_of_the_stated_noise() -> None:
    """A robot whose pose is known and that stands still sights a landmark twice: the difference has twice the noise."""
    cov = np.diag([0.04, 0.01])
    z = np.array([[2.0, 0.3], [2.1, 0.25]])
    still = np.full((3, 3), 0.0) + 1e-14 * np.eye(3)
    log = Log.from_arrays(
        "still", Prior(np.zeros(3), still), np.arange(2.0), np.zeros((2, 3)), np.stack((still, still)),
        np.arange(2), np.zeros(2, np.int64), z, np.stack((cov, cov)),
    )  # fmt: skip
    e = z[1] - z[0]
    right = -0.5 * (e @ np.linalg.solve(2 * cov, e) + np.linalg.slogdet(2 * cov)[1])
    assert likelihood(log) == pytest.approx(right, rel=1e-6)


@pytest.mark.slow
def test_without_a_true_path_the_innovations_tell_the_sizes() -> None:
    log, _ = noisy("circle[steps=250]", 9, Slow(scale=1.5), Slow(scale=0.8), (1.3, 1.3, 0.7))
    noise = measured([Dataset(log, None)], ["blind"])
    assert noise.motions is None
    for name, true in (("turn", 0.7), ("range", 1.5), ("bearing", 0.8)):
        assert near(getattr(noise.innovations, name), true)
    model = noise.model
    assert model.odometry is not None
    assert model.range.scale == noise.innovations.range.value
    assert any("without a true path" in remark for remark in noise.remarks)
    assert any(said.startswith("By the EKF's innovations") for said in sentences(noise))


def test_a_log_without_a_true_path_and_without_revisits_is_refused_with_a_sentence() -> None:
    log, _ = load("circle[steps=2]", 0)
    with pytest.raises(InputError, match=r"short: found no true path and [0-9]+ sightings of landmarks sighted before"):
        measured([Dataset(log, None)], ["short"])


def test_logs_without_a_true_path_are_left_out_beside_one_that_has_it() -> None:
    one, other = noisy("circle[steps=300]", 0), noisy("circle[steps=300]", 1)
    noise = measured([Dataset(one.log, None), other], ["blind", "seen"])
    assert list(noise.labels) == ["seen"]
    assert list(noise.remarks) == ["blind has no true path, and is left out"]


def test_true_paths_with_too_few_errors_are_refused() -> None:
    log, truth = noisy("circle[steps=300]", 0)
    few = truth._replace(t=truth.t[:5], poses=truth.poses[:5])
    with pytest.raises(InputError, match="too few measurements with a known error"):
        measured([Dataset(log, few)], ["few"])


def test_a_log_without_sightings_has_the_noise_of_its_odometry() -> None:
    log, truth = noisy("circle[steps=300]", 0, odometry=(2.0, 2.0, 2.0))
    bare = replace(log, ids=np.full_like(log.ids, -1))
    noise = measured([Dataset(bare, truth)], ["bare"])
    assert noise.range is None
    assert near(noise.motions.scales[2], 2.0)
    assert noise.model.range is None


@pytest.mark.slow
def test_a_size_at_the_end_of_the_search_is_at_most_that() -> None:
    log, _ = noisy("circle[steps=60]", 9, Slow(), Slow(scale=1e-3), (1.0, 1.0, 1.0))
    noise = measured([Dataset(log, None)], ["blind"])
    assert noise.innovations is not None
    bearing = noise.innovations.bearing
    assert bearing.value == pytest.approx(1 / 30)
    assert bearing.low == 0
    assert bearing.value <= bearing.high
    assert noise.innovations.range.low > 0
    assert any("and at most 0.0333 for bearing." in said for said in sentences(noise))
