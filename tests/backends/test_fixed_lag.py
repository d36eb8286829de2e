"""The fixed-lag smoother against dense Schur complements, against GTSAM's, and against smoothing of the whole log."""

from dataclasses import replace

import numpy as np
import pytest

from dense_window import DenseWindow
from driven import final, make, run
from hard_logs import with_given
from random_logs import random_log
from slamduel import load
from slamduel.backends.window import fixed_lag
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Log
from tiers import first_quick

KINDS = ("plain", "blocks", "joint", "fixed")


def drawn(seed: int, kind: str, steps: int = 60) -> Log:
    """A log whose landmarks come and go."""
    rng = np.random.default_rng(seed)
    made = random_log(rng, steps, 12, noise=0.3, radius=float(rng.uniform(2, 5)), blind=float(rng.uniform(0, 0.6)))
    return made.log if kind == "plain" else with_given(made, kind, rng).log


def eliminated_at_random(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    """Landmarks leave the front at once, soon or hardly ever, and the prior moves on at once or late."""
    monkeypatch.setattr(fixed_lag, "KEEP", int(rng.choice([0, 1, 3, 1000])))
    monkeypatch.setattr(fixed_lag, "OVER", int(rng.choice([0, 5, 1000])))


@pytest.mark.parametrize("kind", KINDS[:3])
@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_it_is_the_textbook_one(seed: int, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relinearised at every step; a landmark that comes back is a new one, and what has left is what it was then."""
    rng = np.random.default_rng(seed)
    eliminated_at_random(monkeypatch, rng)
    log = drawn(seed, kind)
    lag = float(np.median(np.diff(log.t)) * rng.integers(1, 12))
    exact = {"relinearize_skip": 1, "relinearize_threshold": 0.0}
    backend, dense = make("fixed-lag", log.prior, lag=lag, **exact), DenseWindow(log.prior, lag)
    for step in log:
        pose, (expected, cov) = backend.step(step), dense.step(step)
        assert pose == pytest.approx(expected, abs=1e-8)
        found = backend.belief().cov
        assert np.abs(found - cov).max() < 1e-7 * np.abs(cov).max()
    landmarks = dense.gone | dense.inside()
    found = backend.map()
    assert set(found.ids.tolist()) == set(landmarks)
    assert found.xy == pytest.approx(np.array([landmarks[i] for i in found.ids.tolist()]), abs=1e-7)
    solution, n = backend.finish(), len(dense.left)
    assert n > len(log) // 2
    assert solution.path[:n] == pytest.approx(np.array([pose for pose, _ in dense.left]), abs=1e-8)
    there = np.array([cov for _, cov in dense.left])
    assert np.abs(solution.cov[:n] - there).max() < 1e-7 * np.abs(there).max()


@pytest.mark.parametrize("kind", KINDS)
def test_each_step_is_gtsams(kind: str) -> None:
    """Relinearised at other steps, and other landmarks held back: to second order alone."""
    log = drawn(5, kind, 150)
    lag = float(20 * np.median(np.diff(log.t)))
    (_, path), (_, peer) = (run(f"fixed-lag by {solver}", log, lag=lag) for solver in ("own", "gtsam"))
    assert path == pytest.approx(peer, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_with_a_lag_longer_than_the_log_it_ends_where_smoothing_all_of_it_does(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    eliminated_at_random(monkeypatch, np.random.default_rng(seed))
    log = drawn(seed, KINDS[seed % 4])
    found, best = final("fixed-lag", log, lag=1e9, final_checks=50), final("smoother", log)
    one, other = misfit(log, found.path, found.map), misfit(log, best.path, best.map)
    assert one.total == pytest.approx(other.total, rel=1e-9, abs=1e-9)
    assert found.path == pytest.approx(best.path, abs=1e-6)
    assert np.abs(found.cov - best.cov).max() < 1e-5 * np.abs(best.cov).max()


def test_its_tables_stay_as_long_as_the_window() -> None:
    log = random_log(np.random.default_rng(7), 2000, 60, noise=0.3, width=30.0, blind=0.3).log
    lag = float(15 * np.median(np.diff(log.t)))
    for often in (10, 10**6):
        backend, path = run("fixed-lag", log, lag=lag, relinearize_skip=often)
        assert np.isfinite(path).all()
        assert len(backend._tables.window.poses) <= 256
        assert len(backend._tables.window.places) <= 64


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_it_converges_where_the_place_in_the_world_is_hardly_known(seed: int) -> None:
    """As after a long drive: rounding then moves all poses together, which no sighting contradicts."""
    log = load("circle", seed=seed).log
    near = final("fixed-lag", log)
    for sd in (10.0, 30.0, 100.0):
        far = final("fixed-lag", replace(log, prior=log.prior._replace(cov=np.diag([sd**2, sd**2, 1.0]))))
        assert near.converged
        assert far.converged
        assert far.path == pytest.approx(near.path, abs=1e-7 * sd**2)
