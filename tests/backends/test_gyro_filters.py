"""A gyro's bias in filters and particles: against dense ones, the linear case, one another; expecting by turns."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, norm

from asked import ANYWHERE
from beacon_drives import drive as beacons
from dense_gyro_filters import GyroInvariant, GyroUkf
from driven import NO_SIGHTINGS, make
from gyro_logs import with_gyro
from hard_logs import with_given, with_loops
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Expected
from slamduel.backends.association.builders import associating
from slamduel.backends.gaussian import ekf
from slamduel.backends.given import given
from slamduel.backends.invariant import invariant_ekf
from slamduel.backends.particles import fastslam
from slamduel.backends.particles.turns import GyroBias
from slamduel.backends.unscented import ukf
from slamduel.backends.unscented.ukf import Options
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN, Dataset, Log, Odometry, Prior, Truth
from slamduel.core.fixes import FixTable
from slamduel.core.gyro import Bias, Turn
from slamduel.core.se2 import Array, wrap
from tiers import first_quick

FILTERS = ("ekf", "invariant-ekf", "ukf")
WIDE = 1e9
WALKS = [1e-3, 0.0]


def drive(seed: int = 1, steps: int = 60, landmarks: int = 8, noise: float = 1.0, **of_gyro: Any) -> Log:
    rng = np.random.default_rng(seed)
    return with_gyro(random_log(rng, steps, landmarks, noise=noise), rng, **of_gyro)[0].log


def compass(log: Log, seed: int = 2) -> Log:
    """The log with a heading in the world every third step and no sightings: its headings are a linear system."""
    rng, steps = np.random.default_rng(seed), np.arange(3, len(log), 3)
    z, cov = np.full((len(steps), 3), np.nan), np.full((len(steps), 3, 3), np.nan)
    z[:, 2], cov[:, 2, 2] = wrap(log.dead_reckoned()[steps, 2] + 0.03 * rng.standard_normal(len(steps))), 0.03**2
    bare = [step._replace(sightings=NO_SIGHTINGS) for step in log]
    made = replace(Log.from_steps("compass", log.prior, bare), fixes=FixTable.from_arrays(len(log), steps, z, cov))
    assert made.gyro is not None
    return made


def alike(ours: tuple[float, float], mean: float, var: float, rel: float = 1e-7) -> None:
    assert ours[0] == pytest.approx(mean, rel=rel, abs=1e-10)
    assert ours[1] ** 2 == pytest.approx(var, rel=rel, abs=1e-13)


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("options", first_quick([{}, {"alpha": 0.5, "kappa": 1.0}]), ids=str)
def test_the_ukf_is_the_dense_one_that_samples_all(options: dict[str, Any], walk: float) -> None:
    log = drive(walk=walk)
    ours, dense = make("ukf", log.prior, **options), GyroUkf(log, Options(**options))
    for step in log:
        pose, expected = ours.step(step), dense.step(step)
        np.testing.assert_allclose(pose[:2], expected[:2], atol=1e-9)
        assert abs(wrap(pose[2] - expected[2])) < 1e-9
        np.testing.assert_allclose(ours.belief().cov, dense.cov[:3, :3], rtol=1e-7, atol=1e-11)
        alike(ours.gyro_bias, dense.mean[3], dense.cov[3, 3])
    found = ours.map()
    np.testing.assert_allclose(found.xy.ravel(), dense.mean[5:], atol=1e-9)
    np.testing.assert_allclose(found.cov, dense.cov[5:, 5:], rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("seed", first_quick([1, 2]))
def test_the_invariant_filter_is_that_of_whole_matrices(seed: int, walk: float) -> None:
    log = drive(seed, 120, walk=walk)
    ours, dense = make("invariant-ekf", log.prior), GyroInvariant(log)
    for step in log:
        pose, expected = ours.step(step), dense.step(step)
        np.testing.assert_allclose(pose[:2], expected[:2], atol=1e-9)
        assert abs(wrap(pose[2] - expected[2])) < 1e-9
        assert (ours.belief().nis or 0.0) == pytest.approx(dense.nis, abs=1e-9, rel=1e-7)
        alike(ours.gyro_bias, dense.bias, dense.poses_cov[0, 0])
    plain, found = dense.plain(), ours.map()
    cov = plain @ dense.cov @ plain.T
    np.testing.assert_allclose(ours.belief().cov, cov[np.ix_([1, 2, 0], [1, 2, 0])], atol=1e-9)
    np.testing.assert_allclose(found.xy, dense.state[:2, 3:].T, atol=1e-9)
    np.testing.assert_allclose(found.cov, cov[3:, 3:], atol=1e-9)


def of_headings(log: Log) -> tuple[Array, Array]:
    """Means (n, 2) and covariances (n, 2, 2) of heading and bias by the Kalman filter, which is exact for `compass`."""
    assert log.prior.gyro is not None
    x, cov = np.array([log.prior.pose[2], log.prior.gyro.mean]), np.diag([log.prior.cov[2, 2], log.prior.gyro.sd**2])
    means, covs = [], []
    for step in log:
        if step.odometry is not None:  # heading, bias, and the heading before
            u, q = step.odometry.delta[2], step.odometry.cov[2, 2]
            F = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
            y, joint = F @ x + [u, 0.0, 0.0], F @ cov @ F.T
            joint[0, 0] += q
            if step.gyro is not None:
                joint[1, 1] += step.gyro.walk
                h = np.array([1.0, step.gyro.dt, -1.0])
                gain = joint @ h / (h @ joint @ h + step.gyro.var)
                y = y + gain * float(wrap(np.array(step.gyro.turn - h @ y)))
                joint = joint - np.outer(gain, h @ joint)
            x, cov = y[:2], joint[:2, :2]
        for z, noise in zip(step.fixes.z, step.fixes.cov, strict=True):
            gain = cov[0] / (cov[0, 0] + noise[2, 2])
            x, cov = x + gain * float(wrap(np.array(z[2] - x[0]))), cov - np.outer(gain, cov[0])
        means.append(x)
        covs.append(cov)
    return np.array(means), np.array(covs)


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("name", FILTERS)
def test_headings_and_bias_are_linear_and_exact_in_all_filters(name: str, walk: float) -> None:
    log = compass(drive(walk=walk))
    means, covs = of_headings(log)
    filter_ = make(name, log.prior)
    for step, mean, cov in zip(log, means, covs, strict=True):
        pose = filter_.step(step)
        assert abs(wrap(pose[2] - mean[0])) < 1e-9
        assert filter_.belief().cov[2, 2] == pytest.approx(cov[0, 0], rel=1e-9)
        alike(filter_.gyro_bias, mean[1], cov[1, 1], rel=1e-9)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("seed", first_quick([4, 10, 13, 17, 21]))
def test_many_particles_come_near_what_is_exact(seed: int, version: int) -> None:
    """Their mean errs by a deviation over the root of their number, and more as they are resampled.

    Ten times that is 0.05 here; without the turn's likelihood as a weight it is above 1.
    """
    log = compass(drive(seed, 40, sd=3e-3, bias=0.2, every=5, walk=0.05))
    means, covs = of_headings(log)
    filter_ = make("fastslam", log.prior, particles=40_000, version=version)
    for k, step in enumerate(log):
        pose, cov, bias = filter_.step(step), filter_.belief().cov, filter_.gyro_bias
        sds, off = np.sqrt(np.diag(covs[k])), np.array((wrap(pose[2] - means[k, 0]), bias.mean - means[k, 1]))
        assert (np.abs(off) < 0.2 * sds).all()
        np.testing.assert_allclose((np.sqrt(cov[2, 2]), bias.sd), sds, rtol=0.1)


def test_a_particles_motion_and_weight_are_those_of_its_own_gaussian() -> None:
    """The joint of its bias, of a motion by the wheels and of the turn; then the step drawn tells the bias."""
    rng, M = np.random.default_rng(5), 6
    half = 0.1 * rng.standard_normal((3, 3))
    motion, turn = Odometry(np.array([0.3, -0.1, 0.2]), half @ half.T), Turn(0.35, 0.02**2, 0.4, 0.1**2)
    bias = GyroBias(Bias(0.0, 0.3), M)
    bias.mean = 0.3 * rng.standard_normal(M)
    poses = np.empty((5, M))
    poses[:3] = rng.standard_normal((3, M))
    poses[3:] = np.cos(poses[2]), np.sin(poses[2])
    before, means = poses.copy(), bias.mean.copy()
    moved, surprise = bias.turned(poses, motion, turn)
    P = 0.3**2 + 0.1**2
    expected = []
    for m in range(M):
        row, cov = np.array([turn.dt, 0.0, 0.0, 1.0]), np.zeros((4, 4))  # bias, motion
        cov[0, 0], cov[1:, 1:] = P, motion.cov
        S, off = row @ cov @ row + turn.var, turn.turn - row @ [means[m], *motion.delta]
        gain = cov @ row / S
        u = motion.delta + gain[1:] * off
        np.testing.assert_allclose(moved.cov, (cov - np.outer(gain, row @ cov))[1:, 1:], atol=1e-12)
        c, s = before[3:, m]
        at = before[:3, m] + [c * u[0] - s * u[1], s * u[0] + c * u[1], u[2]]
        d = moved.delta
        np.testing.assert_allclose(poses[:3, m] + [c * d[0] - s * d[1], s * d[0] + c * d[1], d[2]], at, atol=1e-12)
        expected.append(off**2 / S)
    np.testing.assert_allclose(surprise, expected, rtol=1e-12)
    step = 0.2 * rng.standard_normal(M)
    poses[2] = wrap(before[2] + step)
    bias.learn(poses)
    var = 1 / (1 / P + turn.dt**2 / turn.var)
    np.testing.assert_allclose(bias.mean, var * (means / P + turn.dt * (turn.turn - step) / turn.var), rtol=1e-9)
    assert bias.var == pytest.approx(var, rel=1e-9)
    weights = rng.dirichlet(np.ones(M))
    whole = float(weights @ bias.mean)
    alike(bias.marginal(weights), whole, float(var + weights @ (bias.mean - whole) ** 2))


@pytest.mark.parametrize("options", [{}, {"version": 1}], ids=str)
def test_resampled_particles_take_their_bias_with_them(options: dict[str, int]) -> None:
    """With a prior of a wide bias, sightings choose those whose bias is right."""
    dataset, biases = with_gyro(
        random_log(np.random.default_rng(3), 80, 8), np.random.default_rng(3), bias=0.3, walk=0.0
    )
    filter_ = make("fastslam", dataset.log.prior, particles=2000, **options)
    for step in dataset.log:
        filter_.step(step)
    found = filter_.finish().gyro_bias
    assert found.sd < 0.05
    assert abs(found.mean - biases[-1]) < 5 * found.sd


@pytest.mark.parametrize("name", ["invariant-ekf", "ukf"])
@pytest.mark.parametrize("seed", first_quick([1, 2, 3]))
def test_they_are_the_ekf_where_all_is_nearly_linear(name: str, seed: int) -> None:
    """With errors of s sds of a hundredth, what is not linear is of their squares: s = 1e-5 leaves less than 1e-9."""
    log = drive(seed, noise=1e-5, sd=1e-8, bias=1e-6, walk=1e-7)
    ours, usual = make(name, log.prior), make("ekf", log.prior)
    for step in log:
        off = ours.step(step) - usual.step(step)
        assert np.abs((off[0], off[1], wrap(off[2]))).max() < 1e-9
        cov, sds = usual.belief().cov, np.sqrt(np.diag(usual.belief().cov))
        assert np.abs((ours.belief().cov - cov) / np.outer(sds, sds)).max() < 1e-4
        assert abs(ours.gyro_bias.mean - usual.gyro_bias.mean) < 1e-9
        assert ours.gyro_bias.sd == pytest.approx(usual.gyro_bias.sd, rel=1e-4)


def variant(kind: str) -> Log:
    """A log with a gyro, and with loop closures, on a given map, or of ranges alone with fixes and constant errors."""
    rng = np.random.default_rng(6)
    if kind == "parts":
        found = beacons(1, steps=120, scale_sd=0.05, fix_every=9, compass=True)
        made = Dataset(found.log, Truth(found.log.t, found.path, None, None, "truth"))
        wheels = found.log.prior.systematic._replace(wheel_scale=0.05)
        made = made._replace(log=replace(found.log, prior=found.log.prior._replace(systematic=wheels)))
    elif kind == "loops":
        made = with_loops(random_log(rng, 60, 8), 8, rng)
    else:
        made = with_given(random_log(rng, 60, 8), kind, rng)
    return with_gyro(made, rng)[0].log


@pytest.mark.parametrize("kind", ["loops", "fixed", "joint", "parts"])
@pytest.mark.parametrize("name", ["invariant-ekf", "ukf", "fastslam"])
def test_the_bias_is_kept_beside_all_else_that_is_in_a_state(name: str, kind: str) -> None:
    """It is that of the EKF, as near as linearisation and sampling are to one another."""
    log, builder = variant(kind), registry.find(name)
    if kind == "loops" and not builder.loops:
        return
    options: dict[str, Any] = {"particles": 5000} if name == "fastslam" else {}
    ours, usual = make(name, log.prior, **options), make("ekf", log.prior)
    loose = 0.5 if name == "fastslam" else 0.3
    for k, step in enumerate(log):
        off = ours.step(step) - usual.step(step)
        mean, sd = usual.gyro_bias
        if k % 10 == 9:
            assert abs(ours.gyro_bias.mean - mean) < loose * sd
            assert ours.gyro_bias.sd == pytest.approx(sd, rel=0.5 * loose)
            assert abs(wrap(off[2])) < loose * np.sqrt(usual.belief().cov[2, 2])
    xy = dict(zip(usual.map().ids.tolist(), usual.map().xy, strict=True))
    for landmark, at in zip(ours.map().ids.tolist(), ours.map().xy, strict=True):
        np.testing.assert_allclose(at, xy[landmark], atol=0.1)
    solution = ours.finish()
    if solution is not None:
        assert solution.gyro_bias == ours.gyro_bias


@pytest.mark.parametrize("name", [*FILTERS, "fastslam"])
def test_with_a_bias_that_is_known_the_state_is_the_front(name: str) -> None:
    """Both are the same Gaussian of a motion, one for each particle, too."""
    log, builder = drive(bias=0.0, walk=0.0), registry.find(name)
    paths = []
    for way in ("state", "front", "ignored"):
        options = builder.options(gyro=way)
        found = given(builder, log, options)
        assert (found.turns, found.log.gyro is None) == ((0, False) if way == "state" else (len(log) - 1, True))
        backend: Any = builder.make(found.log.prior, options, np.random.default_rng(0))
        paths.append(np.array([np.concatenate((backend.step(k), backend.belief().cov.ravel())) for k in found.log]))
    for other in paths[1:]:
        off = other - paths[0]
        off[:, 2] = wrap(off[:, 2])
        assert np.abs(off).max() < 1e-9


def ordered(found: Expected) -> tuple[Array, Array]:
    order = np.argsort(found.ids)
    entries = np.stack((2 * order, 2 * order + 1), axis=1).ravel()
    return found.z[order], found.cov[np.ix_(entries, entries)]


ASKED: dict[str, tuple[dict[str, Any], float]] = {
    "ekf": ({}, 1e-9),
    "ekf at first estimates": ({"jacobians": "first-estimates"}, 1e-9),
    "invariant-ekf": ({}, 1e-9),
    "ukf": ({}, 0.02),  # what it expects is of first order, how it moves of second
    "fastslam": ({"particles": 40_000}, 0.03),  # the motion is drawn
}


@pytest.mark.parametrize("name", ASKED)
def test_what_is_expected_by_a_turn_is_what_is_after_it(name: str) -> None:
    """Asked before a step and after its motion: the same, in deviations of what is expected; asking changes no bit."""
    log, (options, tolerance) = drive(steps=25, landmarks=6, bias=0.5, walk=0.05), ASKED[name]
    of = name.partition(" ")[0]
    plain, asked = make(of, log.prior, **options), make(of, log.prior, **options)
    compared = wider = 0
    for k, step in enumerate(log):
        if k in (6, 12, 18):
            alone = ordered(asked.expected(step.odometry, ANYWHERE, WIDE))
            asked.foresee(step.gyro)
            found = ordered(asked.expected(step.odometry, ANYWHERE, WIDE))
            copy = make(of, log.prior, **options)
            for before in list(log)[:k]:
                copy.step(before)
            copy.step(step._replace(sightings=NO_SIGHTINGS))
            z, cov = ordered(copy.expected(None, ANYWHERE, WIDE))
            sds = np.sqrt(np.diag(cov))
            off = found[0] - z
            off[:, 1] = wrap(off[:, 1])
            assert (np.abs(off.ravel()) < tolerance * sds).all()
            assert (np.abs(found[1] - cov) < tolerance * np.outer(sds, sds)).all()
            compared, wider = compared + len(z), wider + (np.trace(alone[1]) > np.trace(cov))
        assert plain.step(step).tobytes() == asked.step(step).tobytes()
        assert plain.belief().cov.tobytes() == asked.belief().cov.tobytes()
    assert compared >= 9
    assert wider == 3


PLAIN: dict[str, Any] = {"ekf": ekf, "invariant-ekf": invariant_ekf, "ukf": ukf, "fastslam": fastslam}


class OdometryAlone:
    """A backend that does not say that it expects by turns."""

    def __init__(self, inner: Any) -> None:
        self.step, self.belief, self.map, self.finish = inner.step, inner.belief, inner.map, inner.finish
        self.expected = inner.expected


SLIPPING = "circle[steps=400,landmarks=60,gyro=0.02,gyro_bias=0.2,gyro_walk=0.002,slip_share=0.2,sighting=0.05]"


def wrong_ids(name: str, seed: int, *, by_turns: bool, **options: Any) -> int:
    """Sightings of a landmark that most of its sightings are not of, with all ids hidden."""
    log, plain = load(SLIPPING, seed).log, PLAIN[name].build

    def make_alone(prior: Prior, options: Any, rng: np.random.Generator) -> Any:
        return OdometryAlone(plain.make(prior, options, rng))

    builder = associating(plain if by_turns else replace(plain, make=make_alone, expects=True))
    chosen = builder.options(association="nn", **options)
    backend: Any = builder.make(log.prior, chosen, np.random.default_rng(0))
    hidden = np.full(len(log.ids), UNKNOWN)
    hidden.flags.writeable = False
    for step in replace(log, ids=hidden):
        backend.step(step)
    said, wrong = backend.assigned(), 0
    for landmark in np.unique(said):
        true = np.unique(log.ids[said == landmark], return_counts=True)[1]
        wrong += int(true.sum() - true.max())
    return wrong


@pytest.mark.parametrize("name", first_quick(["ekf", "invariant-ekf", "ukf", "fastslam"]))
def test_fewer_ids_are_wrong_by_turns(name: str) -> None:
    seeds = range(3)
    by_turns, alone = (sum(wrong_ids(name, seed, by_turns=by) for seed in seeds) for by in (True, False))
    assert 2 * by_turns < alone


BIASED = "circle[steps=800,gyro=0.05,gyro_bias=1,gyro_start=given,gyro_walk=0.005,slip_share=0.1]"


def judged(name: str, dataset: Dataset, way: str) -> tuple[float, float]:
    """The heading's error, RMS in rad, and the mean NEES per degree of freedom, where there is a covariance."""
    builder, truth = registry.find(name), dataset.truth
    options = builder.options(gyro=way)
    log = given(builder, dataset.log, options).log
    backend: Any = builder.make(log.prior, options, np.random.default_rng(0))
    off, nees = np.zeros((len(log), 3)), list[float]()
    assert truth is not None
    for k, step in enumerate(log):
        off[k] = backend.step(step) - truth.poses[k]
        off[k, 2] = wrap(off[k, 2])
        cov = backend.belief().cov
        if cov is not None:
            nees.append(off[k] @ np.linalg.inv(cov) @ off[k] / 3)
    return float(np.sqrt((off[:, 2] ** 2).mean())), float(np.mean(nees))


@pytest.mark.parametrize("seeds", [3, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["invariant-ekf", "ukf", "fastslam"])
def test_with_the_bias_in_its_state_a_heading_is_far_closer(name: str, seeds: int) -> None:
    """Particles are too few to be honest on drives with slip, with a gyro or without."""
    state, front, ignored = (
        np.mean([judged(name, load(BIASED, seed), way) for seed in range(seeds)], axis=0)
        for way in ("state", "front", "ignored")
    )
    assert 5 * state[0] < ignored[0]
    assert state[0] < front[0]
    assert ignored[1] > 5
    if name != "fastslam":
        assert 0.5 < state[1] < 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["invariant-ekf", "ukf"])
def test_the_true_bias_is_in_its_interval(name: str) -> None:
    """At 95 % of the steps of 20 drives; a drive's steps are taken as some ten independent ones."""
    inside = list[bool]()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        made, biases = with_gyro(random_log(rng, 400, 8), rng, every=20, walk=2e-3)
        filter_ = make(name, made.log.prior)
        for k, step in enumerate(made.log):
            filter_.step(step)
            if k:
                mean, sd = filter_.gyro_bias
                inside.append(abs(mean - biases[k - 1]) < norm.ppf(0.975) * sd)
    low, high = binom.interval(0.999, 200, 0.95)
    assert low / 200 < np.mean(inside) < high / 200
