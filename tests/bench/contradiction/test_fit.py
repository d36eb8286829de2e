"""Stretches of a log, and what a fit leaves of their measurements."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from mistaken_logs import drawn
from slamduel.bench.contradiction.fit import agreement, fitted, kept_mean
from slamduel.bench.contradiction.motions import MotionNoise
from slamduel.bench.contradiction.stretch import ENOUGH, degrees_of_freedom, part_of, stretches
from slamduel.core.factors import Log
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.registry import find


def log_of(name: str, **options: object) -> Log:
    source = find(name)
    return source.make(source.options(**options), np.random.default_rng(0)).log


@pytest.mark.parametrize("share", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("k", [2, 3])
def test_the_mean_of_the_least_part_of_chi_square(k: int, share: float):
    middles = chi2.ppf((np.arange(20_000) + 0.5) / 20_000 * share, k)
    assert kept_mean(k, share) == pytest.approx(middles.mean(), rel=1e-3)


def test_a_stretch_is_its_part_of_the_log():
    log = log_of("bailey")
    part = part_of(log, 30, 90)
    whole = part_of(log, 0, len(log))
    assert len(part) == 60
    assert part.digest == part_of(whole, 30, 90).digest
    assert np.array_equal(part.delta[1:], log.delta[31:90])
    assert np.array_equal(part.z, log.z[log.sighting_first[30] : log.sighting_first[90]])
    assert degrees_of_freedom(log, 30, 90) == 2 * (len(part.ids) - len(np.unique(part.ids)))


def test_loop_closures_with_steps_before_a_stretch_are_left_out():
    log = log_of("laser-floor", laps=1.15)
    part = part_of(log, 100, 250)
    kept = [
        (k - 100, to - 100) for k, to in zip(log.loop_step, log.loop_to, strict=True) if 100 <= k < 250 and to >= 100
    ]
    assert list(zip(part.loop_step, part.loop_to, strict=True)) == kept
    assert degrees_of_freedom(log, 100, 250) == 3 * len(kept)


def test_stretches_are_spread_over_the_log_and_long_enough():
    log = log_of("circle")
    parts = list(stretches(log))
    assert len(parts) == 3
    assert len({len(part) for part in parts}) == 1
    assert max(degrees_of_freedom(part, 0, len(part)) for part in parts) >= ENOUGH
    assert parts[0].t[0] == log.t[0]
    assert parts[-1].t[-1] == log.t[-1]


def test_the_fit_is_the_optimum_where_there_are_no_outliers(tmp_path: Path):
    """Against least squares over all residuals, with Cauchy's loss of sightings, from a start of its own."""
    (log, _), _ = drawn(3000, None, tmp_path)
    part = part_of(log, 0, 25)
    ids, of = np.unique(part.ids, return_inverse=True)
    step, n = part.sighting_step, len(part)
    roots = [np.linalg.inv(np.linalg.cholesky(cov)) for cov in (part.delta_cov[1:], part.z_cov, part.prior.cov[None])]

    def residuals(x: Array) -> Array:
        path, places = x[: 3 * n].reshape(n, 3), x[3 * n :].reshape(-1, 2)
        moved = between(path[:-1], path[1:]) - part.delta[1:]
        off = places[of] - path[step, :2]
        seen = np.column_stack((np.hypot(*off.T), np.arctan2(off[:, 1], off[:, 0]) - path[step, 2])) - part.z
        moved[:, 2], seen[:, 1] = wrap(moved[:, 2]), wrap(seen[:, 1])
        squares = np.einsum("nij,nj->ni", roots[1], seen)
        size = np.sqrt((squares**2).sum(axis=1))
        scale = 2.3849  # Cauchy's, of 95 % efficiency
        robust = scale * np.sqrt(np.log1p((size / scale) ** 2)) / np.maximum(size, 1e-12)
        start = roots[2][0] @ (path[0] - part.prior.pose)
        return np.concatenate(
            (start, np.einsum("nij,nj->ni", roots[0], moved).ravel(), (robust[:, None] * squares).ravel())
        )

    found = fitted(part)
    assert found is not None
    at = (
        np.searchsorted(found.landmarks.ids, ids)
        if np.all(np.diff(found.landmarks.ids) > 0)
        else np.array([found.landmarks.ids.tolist().index(i) for i in ids])
    )
    ours = np.concatenate((found.path.ravel(), found.landmarks.xy[at].ravel()))
    best = least_squares(
        residuals, ours + 0.01 * np.random.default_rng(0).standard_normal(len(ours)), xtol=1e-12, ftol=1e-12
    )
    assert (residuals(ours) ** 2).sum() < 1.01 * 2 * best.cost


def test_stated_noise_is_that_of_the_reader_for_other_motions(tmp_path: Path):
    (log, _), _ = drawn(3000, None, tmp_path)
    noise = MotionNoise(log)
    assert noise.modelled
    assert np.allclose(noise.cov(log.delta[1:]), log.delta_cov[1:], rtol=0.3, atol=1e-6)
    longer = noise.cov(log.delta[1:] * [4.0, 4.0, 1.0])
    moving = np.hypot(*log.delta[1:, :2].T) > 0.1
    growth = longer[moving, 0, 0] / log.delta_cov[1:][moving, 0, 0]
    assert np.median(growth) == pytest.approx(4.0, rel=0.05)  # the variance goes with the way


def test_a_log_of_exact_measurements_has_no_misfit(tmp_path: Path):
    (log, _), _ = drawn(3001, None, tmp_path)
    assert 0.8 < agreement(list(map(fitted, stretches(log)))).j < 1.15
