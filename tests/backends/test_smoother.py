"""The incremental smoother against dense Gauss-Newton: J, path, map and all covariances, however it is reorganised."""

import numpy as np
import pytest

from against_dense import KINDS, agrees, dense, of_kind
from driven import NO_LOOPS, NO_SIGHTINGS, asking_changes_nothing, final, make, run
from hard_logs import with_loops
from random_logs import random_log
from slamduel.backends.api import Diverged
from slamduel.backends.common_options import LOSSES
from slamduel.backends.incremental import smoother
from slamduel.backends.smoothing import forest
from slamduel.core.factors import Log, Odometry, Prior, RangeBearing, Step
from tiers import first_quick


def reorganised_at_random(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    """Small roots, gathered from nearby or from afar, and all of it ordered anew seldom, often or at every chance."""
    monkeypatch.setattr(smoother, "CAP", int(rng.integers(1, 12)))
    monkeypatch.setattr(smoother, "REACH", float(rng.uniform(0.2, 1.5)))
    monkeypatch.setattr(smoother, "PATIENCE", float(rng.uniform(1, 50)))
    monkeypatch.setattr(smoother, "LEAST", float(rng.choice([0, 1e3, 1e9])))
    monkeypatch.setattr(forest, "AS_MUCH", float(rng.choice([0.2, 1, 100])))


def ends_at_the_optimum(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    reorganised_at_random(monkeypatch, rng)
    sizes = int(rng.integers(3, 60)), int(rng.integers(1, 25))
    blind, radius = float(rng.uniform(0, 0.9)), float(rng.uniform(2, 6))
    made = random_log(rng, *sizes, noise=0.5, blind=blind, radius=radius)
    if made.truth is None or made.truth.map is None or len(made.truth.map.ids) == 0:
        return
    log = of_kind(KINDS[seed % len(KINDS)], made, rng)
    often = {"relinearize_skip": int(rng.integers(1, 20)), "relinearize_threshold": float(rng.choice([0.001, 0.03, 1]))}
    agrees(log, final("smoother", log, **often))


@pytest.mark.parametrize("seed", first_quick(range(20), 6))
def test_it_ends_at_the_optimum_however_it_was_reorganised(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ends_at_the_optimum(seed, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("hundred", [1, 2])
def test_it_does_so_on_two_hundred_logs(hundred: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(100 * hundred, 100 * hundred + 100):
        ends_at_the_optimum(seed, monkeypatch)


@pytest.mark.parametrize("kind", KINDS)
def test_the_belief_is_the_optimum_of_the_log_so_far(kind: str) -> None:
    """Where every step relinearises, its pose and covariance are those of the optimum so far to second order."""
    rng = np.random.default_rng(3)
    log = of_kind(kind, random_log(rng, 40, 10, noise=0.05), rng)
    backend = make("smoother", log.prior, relinearize_skip=1, relinearize_threshold=0.0)
    for k, step in enumerate(log):
        pose, belief = backend.step(step), backend.belief()
        if k % 8:
            continue
        best = dense(log.head(k + 1), final("smoother", log.head(k + 1)), 3)
        assert pose == pytest.approx(best.path[k], abs=1e-4)
        there = best.cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert np.abs(belief.cov - there).max() < 0.01 * np.abs(there).max()


def test_the_joint_covariance_of_chosen_landmarks_and_the_last_pose() -> None:
    log, _ = random_log(np.random.default_rng(4), 50, 10, noise=0.3, blind=0.0, radius=20.0)
    backend, _ = run("smoother", log)
    found = backend.finish()
    best, n = dense(log, found), len(log)
    chosen, order = found.map.ids[[4, 1]].tolist(), list(best.xy)
    rows = [3 * n + 2 * order.index(landmark) + a for landmark in chosen for a in (0, 1)] + [
        3 * n - 3 + i for i in range(3)
    ]
    there = best.cov[np.ix_(rows, rows)]
    assert np.abs(backend.joint(chosen) - there).max() < 1e-6 * np.abs(there).max()


@pytest.mark.parametrize("loss", ["huber", "cauchy", "geman-mcclure"])
def test_with_a_loss_it_ends_where_reweighted_least_squares_do(loss: str) -> None:
    rng = np.random.default_rng(5)
    log, _ = random_log(rng, 60, 8, noise=0.3, blind=0.0)
    z = log.z.copy()
    wrong = rng.random(len(z)) < 0.05
    z[wrong, 0] += 3.0
    steps = [log[k]._replace(sightings=log[k].sightings._replace(z=z[log.sighting_step == k])) for k in range(len(log))]
    wrong_log = Log.from_steps("wrong", log.prior, steps)
    found = final("smoother", wrong_log, loss=loss)
    assert set(found.map.ids.tolist()) == set(log.ids.tolist())
    assert found.map.cov is not None  # none is held back
    best = dense(wrong_log, found, 40, loss=loss, scale=LOSSES[loss])
    assert found.path == pytest.approx(best.path, abs=1e-5)
    assert found.map.xy == pytest.approx(np.array([best.xy[i] for i in found.map.ids.tolist()]), abs=1e-5)


@pytest.mark.slow
def test_ten_thousand_steps_without_a_landmark() -> None:
    """The way between two sightings is put together in covariance form: the ends are known as if it were one motion."""
    n, cov = 10_000, np.diag([2e-3, 1e-3, 1e-4]) ** 2
    z, z_cov = np.array([[3.0, 0.5], [2.0, -0.7]]), np.tile(np.diag([0.05, 0.02]) ** 2, (2, 1, 1))
    sights = {0: np.array([1, 2]), n: np.array([3, 4])}
    steps = [
        Step(
            float(k),
            Odometry(np.array([0.2, 0.0, 1e-4]), cov) if k else None,
            RangeBearing(sights[k], z, z_cov) if k in sights else NO_SIGHTINGS,
            NO_LOOPS,
        )
        for k in range(n + 1)
    ]
    log = Log.from_steps("blind", Prior(np.zeros(3), 1e-4 * np.eye(3)), steps)
    backend, path = run("smoother", log)
    found = backend.finish()
    assert found.path == pytest.approx(path, abs=1e-5)  # nothing is seen again, so nothing is learnt
    assert np.linalg.eigvalsh(found.cov).min() > 0
    assert found.cov[-1] == pytest.approx(backend.belief().cov, rel=1e-6)
    assert np.all(np.diff(found.cov[:, 2, 2]) > 0)


def test_a_wheel_that_is_sure_and_a_loop_into_the_middle_of_a_blind_stretch() -> None:
    rng = np.random.default_rng(6)
    made = random_log(rng, 80, 6, noise=0.3, blind=0.9)
    log = with_loops(made, 12, rng).log
    agrees(log, final("smoother", log))


def test_asking_changes_nothing() -> None:
    log, _ = random_log(np.random.default_rng(7), 80, 12)
    plain, asked = (make("smoother", log.prior, relinearize_skip=5) for _ in range(2))
    belief = asked.belief
    asked.belief = lambda: (belief(), asked.joint(asked.map().ids[:1].tolist()))[0]
    asking_changes_nothing(plain, asked, log)


def test_arrays_grow() -> None:
    """On a log ten times as large as they are at first; and the optimum is the same however often it relinearised."""
    rng = np.random.default_rng(8)
    log = with_loops(random_log(rng, 500, 120, width=30.0, radius=3.0), 20, rng).log
    backend, path = run("smoother", log)
    assert np.isfinite(path).all()
    other = final("smoother", log, relinearize_skip=3, relinearize_threshold=0.001)
    assert other.path == pytest.approx(backend.finish().path, abs=1e-6)


@pytest.mark.parametrize("name", ["smoother", "fixed-lag"])
def test_what_is_not_positive_definite_ends_with_a_sentence(name: str) -> None:
    log, _ = random_log(np.random.default_rng(9), 20, 5)
    steps = list(log)
    steps[10] = steps[10]._replace(odometry=Odometry(np.zeros(3), np.zeros((3, 3))))
    with pytest.raises(Diverged, match="not positive definite"):
        run(name, Log.from_steps("wrong", log.prior, steps))
