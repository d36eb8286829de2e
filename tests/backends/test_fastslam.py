"""FastSLAM 1.0 and 2.0 against a plain loop over particles, and its parts against theory."""

from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import driven
from driven import NO_LOOPS, rmse
from random_logs import TextbookKalman, random_covariance, random_log
from slamduel.backends.api import Diverged, Map, Odometry, Prior, RangeBearing, Step
from slamduel.backends.models import sight
from slamduel.backends.particles import _ancestry, _particles, resampling
from slamduel.backends.particles._proposal import Motion, propose
from slamduel.backends.particles.particle_maps import RESERVED, ParticleMaps
from slamduel.backends.particles.particle_paths import ParticlePaths
from slamduel.backends.programs.textbook_fastslam import TextbookFastSlam
from slamduel.core.se2 import Array, Ints, compose
from tiers import first_quick

make = partial(driven.make, "fastslam")


def seen(ids: list[int], z: Any, cov: Any) -> RangeBearing:
    return RangeBearing(np.array(ids, np.int64), np.array(z, float).reshape(-1, 2), np.array(cov).reshape(-1, 2, 2))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    ("resampled", "below"), first_quick([("systematic", 0.5), *((scheme, 1.0) for scheme in resampling.SCHEMES)], 2)
)
def test_it_is_the_textbook_filter(version: int, resampled: str, below: float) -> None:
    """After each of 300 steps, in three logs, the paths agree, and at the end of each log every particle's map."""
    for seed in range(3):
        log = random_log(np.random.default_rng(seed), 100, 12, radius=4.0).log
        options: dict[str, Any] = {"version": version, "resampling": resampled, "resample_below": below}
        mine = make(log.prior, seed, particles=5, **options)
        textbook = TextbookFastSlam(log.prior, 5, np.random.default_rng(seed), **options)
        for step in log:
            assert mine.step(step) == pytest.approx(textbook.step(step), abs=1e-9)
            assert mine._weights == pytest.approx(textbook.weights(), abs=1e-9)
        filters = mine._maps.all()
        for m, particle in enumerate(textbook.particles):
            assert mine._poses[:3, m] == pytest.approx(particle.pose, abs=1e-9)
            for landmark, (mean, cov) in particle.map.items():
                own = filters[mine._maps.row[landmark], :, m]
                assert own == pytest.approx([*mean, cov[0, 0], cov[0, 1], cov[1, 1]], abs=1e-9)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("held", [True, False])
def test_it_is_the_textbook_filter_on_a_given_map(version: int, held: bool) -> None:
    log, truth = random_log(np.random.default_rng(5), 60, 8)
    n = 2 * len(truth.map.ids)
    cov = None if held else random_covariance(np.random.default_rng(6), [0.03] * n)
    prior = log.prior._replace(map=truth.map._replace(cov=cov))
    mine = make(prior, particles=300, version=version)  # more than one block of them
    textbook = TextbookFastSlam(prior, 300, np.random.default_rng(0), version)
    for step in log.head(6):
        assert mine.step(step) == pytest.approx(textbook.step(step), abs=1e-9)
    assert not held or np.array_equal(mine.finish().map.xy, truth.map.xy)


def test_the_polynomials_are_the_functions() -> None:
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal((2, 4000)) * 10 ** rng.uniform(-8, 8, (2, 4000))
    angles = np.concatenate((rng.uniform(-12, 12, 4000), np.arange(-8, 9) * np.pi / 4))
    assert [_particles.arctan2(*at) for at in zip(y, x, strict=True)] == pytest.approx(np.arctan2(y, x), abs=1e-15)
    for at in ((0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (-1.0, -1.0)):
        assert _particles.arctan2(*at) == pytest.approx(np.arctan2(*at), abs=1e-15)
    found = np.array([_particles.cosine_sine(angle) for angle in angles])
    assert found == pytest.approx(np.column_stack((np.cos(angles), np.sin(angles))), abs=1e-15)


def test_one_landmark_from_a_known_path_is_a_kalman_filter() -> None:
    """Far away, and the path all but certain: linear in the landmark, so its EKF is the Kalman filter."""
    prior = Prior(np.zeros(3), 1e-24 * np.eye(3))
    R = np.array([[0.04, 1e-5], [1e-5, 1e-8]])
    H = np.array([[1.0, 0.0], [0.0, 1e-3]])  # at (1 km, 0)
    rng = np.random.default_rng(1)
    backend = make(prior, particles=1, version=1)
    kalman = TextbookKalman(np.array([1000.0, 0.0]), np.diag([1.0, 1e-2]))
    backend._maps.add(4)
    backend._maps.filters[0] = np.array([1000.0, 0.0, 1.0, 0.0, 1e-2])[:, None]
    for k in range(20):
        z = np.array([1000.0, 0.0]) + rng.multivariate_normal(np.zeros(2), R)
        backend.step(Step(float(k), None, seen([4], z, R), NO_LOOPS))
        kalman.update(z, H, R)
    found = backend.map()
    # it strays by less than 0.1 m across, which at 1 km bends the range by 5e-6 m and turns the axes by 1e-4
    assert found.xy[0] == pytest.approx(kalman.mean, abs=1e-5)
    assert found.cov == pytest.approx(kalman.cov, rel=1e-3, abs=1e-6)


def test_a_weight_of_version_two_is_the_integral_over_motion_and_landmark() -> None:
    """By Gauss-Hermite quadrature over pose and landmark, 7 nodes each; what is common to all particles aside."""
    rng = np.random.default_rng(2)
    M = 6
    poses = np.zeros((5, M))
    poses[:3] = 1e-3 * rng.standard_normal((3, M))
    poses[3], poses[4] = np.cos(poses[2]), np.sin(poses[2])
    delta, motion = np.array([0.5, 0.1, 0.2]), random_covariance(rng, [1e-3, 1e-3, 1e-3])
    P, R, z = random_covariance(rng, [1e-3, 1e-3]), random_covariance(rng, [1e-3, 1e-3]), np.array([2.0, 0.4])
    mean = np.array([0.5, 0.1]) + 2 * np.array([np.cos(0.6), np.sin(0.6)])
    filters = np.array([*mean, P[0, 0], P[0, 1], P[1, 1]])[None, :, None] + np.zeros((1, 5, M))
    nodes, shares = np.polynomial.hermite_e.hermegauss(7)
    grid = np.stack(np.meshgrid(*[nodes] * 5, indexing="ij"), axis=-1).reshape(-1, 5)
    share = np.prod(np.stack(np.meshgrid(*[shares] * 5, indexing="ij"), axis=-1).reshape(-1, 5), axis=1)
    logs: list[float] = []
    for m in range(M):
        at = compose(poses[:3, m], delta + grid[:, :3] @ np.linalg.cholesky(motion).T)
        off = mean + grid[:, 3:] @ np.linalg.cholesky(P).T - at[:, :2]
        error = z - np.stack((np.hypot(*off.T), np.arctan2(off[:, 1], off[:, 0]) - at[:, 2]), axis=-1)
        likelihood = np.exp(-0.5 * np.sum(error @ np.linalg.inv(R) * error, axis=1))
        logs.append(float(np.log(share @ likelihood)))
    distance, volume = np.zeros(M), np.ones((1, M))
    noise = rng.standard_normal((3, M))
    propose(poses, Motion(delta, motion, noise), filters, np.array([0]), z[None], R[None], distance, volume)
    weights = -0.5 * (distance + np.log(volume[0]))
    assert np.ptp(logs) > 0.3  # they do differ
    assert weights - weights[0] == pytest.approx(np.array(logs) - logs[0], abs=0.02)


def test_version_two_draws_from_motion_and_sightings() -> None:
    """Many particles with one past: their mean and covariance are the EKF's, of known landmarks that are held fixed."""
    known = Map(np.array([1, 2]), np.array([[4.0, 1.0], [1.0, -3.0]]), None)
    prior = Prior(np.array([0.0, 0.0, 0.3]), random_covariance(np.random.default_rng(3), [0.02, 0.02, 0.02]), known)
    R = np.array([[1e-4, 2e-5], [2e-5, 1e-4]])
    z = [(np.hypot(4.0, 1.0) + 0.01, np.arctan2(1, 4) - 0.29), (np.hypot(1, 3), np.arctan2(-3, 1) - 0.31)]
    backend = make(prior, particles=20_000, version=2)
    backend.step(Step(0.0, None, seen([1, 2], z, [R, R]), NO_LOOPS))
    ekf = TextbookKalman(prior.pose, prior.cov)
    for at, measured in zip(known.xy, z, strict=True):
        expected, H, _ = sight(ekf.mean, at)
        ekf.update(np.array(measured) - expected + H @ ekf.mean, H, R)
    errors = np.linalg.solve(np.linalg.cholesky(ekf.cov), backend._poses[:3] - ekf.mean[:, None])
    assert errors.mean(axis=1) == pytest.approx(0, abs=6 / np.sqrt(20_000))
    assert np.cov(errors) == pytest.approx(np.eye(3), abs=6 * np.sqrt(2 / 20_000))
    assert backend.belief().n_eff == pytest.approx(20_000)  # they share their past, so their weights are the same


def sharp_log(rng: np.random.Generator, steps: int = 60) -> tuple[Prior, list[Step], Array]:
    """Coarse odometry, 12 cm and 0.1 rad a step, and sharp sightings, 2 cm and 5 mrad; a circle among 10 landmarks."""
    angle = 2 * np.pi * np.arange(10) / 10
    xy = np.column_stack((np.cos(angle), np.sin(angle))) * rng.uniform(3, 7, (10, 1))
    Q, R = np.diag([0.12, 0.06, 0.1]) ** 2, np.diag([0.02, 0.005]) ** 2
    pose = np.array([5.0, 0.0, np.pi / 2])
    prior, path, log = Prior(pose, 1e-6 * np.eye(3)), [], []
    for k in range(steps):
        delta = np.array([0.5, 0.0, 0.1])
        odometry = None if k == 0 else Odometry(delta + rng.multivariate_normal(np.zeros(3), Q), Q)
        pose = pose if k == 0 else compose(pose, delta)
        off = xy - pose[:2]
        near = np.flatnonzero(np.hypot(*off.T) < 6)
        z = np.column_stack((np.hypot(*off.T), np.arctan2(off[:, 1], off[:, 0]) - pose[2]))[near]
        z = z + rng.multivariate_normal(np.zeros(2), R, len(near))
        log.append(Step(float(k), odometry, seen(near.tolist(), z, np.tile(R, (len(near), 1, 1))), NO_LOOPS))
        path.append(pose)
    return prior, log, np.array(path)


def test_version_two_beats_version_one_where_odometry_is_coarse_and_sightings_sharp() -> None:
    """Montemerlo et al., IJCAI 2003: at equal numbers of particles; the median over 20 logs."""
    errors = np.zeros((20, 2))
    for seed in range(20):
        prior, log, truth = sharp_log(np.random.default_rng(seed))
        for version in (1, 2):
            backend = make(prior, seed, particles=30, version=version)
            errors[seed, version - 1] = rmse(np.array([backend.step(step) for step in log]), truth)
    one, two = np.median(errors, axis=0)
    assert two < 0.5 * one
    assert (errors[:, 1] < errors[:, 0]).sum() >= 18


class EagerMaps(ParticleMaps):
    """The same, but every resampling copies all maps at once."""

    def resampled(self, ancestors: Ints) -> None:
        super().resampled(ancestors)
        self.all()


def test_maps_do_not_depend_on_when_they_are_handed_down() -> None:
    """Lazily, with room made several times on the way, and at once, against copies of whole maps."""
    rng = np.random.default_rng(3)
    M = 11
    lazy: Any = ParticleMaps(M)
    eager, whole = EagerMaps(M), np.zeros((0, 5, M))
    furthest = 0
    for k in range(500):
        if k % 7 == 0:
            new = rng.standard_normal((5, M))
            for maps in (lazy, eager):
                slot = maps.add(k)
                maps.filters[slot] = new
            whole = np.concatenate((whole, new[None]))
        ancestors = np.sort(rng.integers(0, M, M)) if k % 3 else np.arange(M)
        lazy.resampled(ancestors)
        eager.resampled(ancestors)
        whole = whole[..., ancestors]
        for row in rng.choice(len(lazy), rng.integers(0, 2), replace=False).tolist():
            written = rng.standard_normal((5, M))
            for maps in (lazy, eager):
                maps.filters[maps.slots(np.array([row]))[0]] = written
            whole[row] = written
        furthest = max(furthest, int((lazy._epoch - lazy._written[: len(lazy)]).max()))
        assert furthest <= len(lazy)
        if k % 50 == 49:
            assert np.array_equal(eager.all(), whole)
            row = int(rng.integers(len(lazy)))
            assert np.array_equal(lazy.filters[lazy.slots(np.array([row]))[0]], whole[row])
    assert furthest > RESERVED  # the maps over many epochs have been of use
    assert np.array_equal(lazy.all(), whole)


@pytest.mark.parametrize("version", [1, 2])
def test_the_path_is_the_same_when_maps_are_handed_down_at_once(version: int) -> None:
    log = random_log(np.random.default_rng(4), 120, 20).log
    lazy, eager = (make(log.prior, particles=40, version=version) for _ in range(2))
    eager._maps = EagerMaps(40)
    for step in log:
        assert lazy.step(step).tobytes() == eager.step(step).tobytes()
        eager.belief()
        eager.map()
    assert np.array_equal(lazy.map().xy, eager.map().xy)
    assert np.array_equal(lazy.finish().path, eager.finish().path)


def test_after_resampling_no_two_particles_have_one_map() -> None:
    log = random_log(np.random.default_rng(11), 30, 6).log
    backend = make(log.prior, particles=20, version=1, resample_below=1.0)
    for step in log:
        backend.step(step)
    backend._resample()
    before = backend._maps.all()
    rows = np.arange(len(before))
    backend._maps.filters[backend._maps.slots(rows), 0, 7] += 1.0  # one particle sees its landmarks elsewhere
    backend._maps.resampled(np.arange(20))  # and is handed down as it is
    changed = np.abs(backend._maps.all() - before).max(axis=(0, 1))
    assert changed == pytest.approx(np.eye(20)[7])


def test_paths_are_those_of_the_ancestors() -> None:
    rng = np.random.default_rng(5)
    M = 9
    paths: Any = ParticlePaths(M)
    whole = np.zeros((0, 3, M))
    for k in range(400):
        if k > 0 and k % 3:
            ancestors = np.sort(rng.integers(0, M, M))
            paths.resampled(ancestors)
            whole = whole[..., ancestors]
        poses = rng.standard_normal((5, M))
        paths.add(poses)
        whole = np.concatenate((whole, poses[None, :3]))
    for m in range(M):
        assert np.array_equal(paths.path(m), whole[..., m])
    assert len(paths._nodes) < 400 * 3  # of 3600: dead branches have made room


def test_the_solution_is_the_heaviest_particle() -> None:
    log, truth = random_log(np.random.default_rng(6), 80, 10)
    backend = make(log.prior, particles=60, version=1)
    path = np.array([backend.step(step) for step in log])
    solution, best = backend.finish(), int(np.argmax(backend._weights))
    assert solution.path[-1] == pytest.approx(backend._poses[:3, best])
    assert rmse(solution.path, truth.poses) < 2 * rmse(path, truth.poses)
    filters = backend._maps.all()[..., best]
    assert np.array_equal(solution.map.xy, filters[:, :2])
    assert np.array_equal(solution.map.cov[2:4, 2:4], filters[1, [[2, 3], [3, 4]]])
    assert np.count_nonzero(solution.map.cov) == 4 * len(filters)


def test_ancestors_are_counted() -> None:
    log = random_log(np.random.default_rng(7), 60, 8).log
    backend = make(log.prior, particles=50, version=1, resample_below=1.0)
    counts = [(backend.step(step), backend.belief().ancestors)[1] for step in log]
    assert counts[0] == 50
    assert all(after <= before for before, after in pairwise(counts))
    roots = {backend._paths.path(m)[0].tobytes() for m in range(50)}
    assert counts[-1] == len(roots) < 10


@pytest.mark.parametrize("scheme", resampling.SCHEMES)
def test_resampling_is_unbiased(scheme: str) -> None:
    rng = np.random.default_rng(8)
    M, rounds = 12, 4000
    weights = rng.exponential(size=M) ** 2
    weights[[0, 5, M - 1]] = 0.0  # ends and middle without weight
    copies = np.zeros((rounds, M))
    for k in range(rounds):
        ancestors = resampling.SCHEMES[scheme](weights, rng)
        assert len(ancestors) == M
        assert (np.diff(ancestors) >= 0).all()
        copies[k] = np.bincount(ancestors, minlength=M)
    expected = M * weights / weights.sum()
    assert copies.mean(axis=0) == pytest.approx(expected, abs=6 * np.sqrt(M / 4 / rounds))  # 6 sigma of a multinomial
    assert not copies[:, weights == 0].any()
    if scheme == "systematic":
        assert (np.abs(copies - expected) < 1 + 1e-9).all()


def test_the_schemes_are_ordered_by_their_variance() -> None:
    """Of the mean of a function of the particle: none is above multinomial's, which is known (Douc et al., 2005)."""
    rng = np.random.default_rng(9)
    M, rounds = 20, 3000
    weights, value = rng.exponential(size=M), np.arange(M) / M
    variance = {
        name: float(np.var([value[scheme(weights, rng)].mean() for _ in range(rounds)]))
        for name, scheme in resampling.SCHEMES.items()
    }
    share = weights / weights.sum()
    exact = (share @ value**2 - (share @ value) ** 2) / M
    assert variance["multinomial"] == pytest.approx(exact, rel=6 * np.sqrt(2 / rounds))
    assert variance["stratified"] < variance["residual"] < 0.9 * variance["multinomial"]
    assert variance["systematic"] < 0.9 * variance["multinomial"]


def test_equal_weights_are_left_alone() -> None:
    for scheme in (resampling.systematic, resampling.residual, resampling.stratified):
        for M in (1, 7, 100):
            assert scheme(np.full(M, 1 / M), np.random.default_rng(M)).tolist() == list(range(M))
    assert _ancestry.chosen(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.5, 1.0])).tolist() == [1, 1, 1]


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("scale", [1e-12, 1e6])
def test_covariances_may_be_tiny_or_huge(version: int, scale: float) -> None:
    """Each of motion and sighting in turn so, against the other near 1: finite, and no filter loses its sign."""
    log = random_log(np.random.default_rng(10), 60, 6).log
    for of_motion, of_sightings in ((scale, 1.0), (1.0, scale), (scale, scale), (scale, 1 / scale)):
        backend = make(log.prior, particles=30, version=version)
        for step in log:
            odometry = step.odometry and step.odometry._replace(cov=of_motion * np.eye(3))
            sightings = step.sightings._replace(cov=np.tile(of_sightings * np.eye(2), (len(step.sightings.ids), 1, 1)))
            assert np.isfinite(backend.step(step._replace(odometry=odometry, sightings=sightings))).all()
        xx, xy, yy = backend._maps.all()[:, 2:].swapaxes(0, 1)
        assert (xx > 0).all()
        assert (xx * yy - xy * xy > -1e-12 * (xx + yy) ** 2).all()


@pytest.mark.parametrize("version", [1, 2])
def test_a_landmark_at_a_particles_place_takes_its_weight_and_no_more(version: int) -> None:
    prior = Prior(np.zeros(3), 1e-4 * np.eye(3))
    backend = make(prior, particles=10, version=version)
    sighting = seen([1], [[2.0, 0.0]], 1e-2 * np.eye(2))
    backend.step(Step(0.0, None, sighting, NO_LOOPS))
    backend._maps.filters[0, :2, 3] = backend._poses[:2, 3]
    before = backend._maps.all()[0, :, 3]
    backend.step(Step(1.0, None, sighting, NO_LOOPS))  # not moved since
    assert backend._weights[3] == 0
    assert (np.delete(backend._weights, 3) > 0).all()
    assert np.array_equal(backend._maps.all()[0, :, 3], before)
    backend._maps.filters[0, :2] = backend._poses[:2]
    with pytest.raises(Diverged, match="no particle"):
        backend.step(Step(2.0, None, sighting, NO_LOOPS))


def test_five_hundred_sightings_in_a_frame_are_within_a_doubles_range() -> None:
    rng = np.random.default_rng(12)
    backend = make(Prior(np.zeros(3), 1e-6 * np.eye(3)), particles=20, version=1)
    z = np.column_stack((rng.uniform(1, 9, 500), rng.uniform(-3, 3, 500)))
    cov = np.tile(np.diag([1e-8, 1e-8]), (500, 1, 1))
    for k in range(3):
        backend.step(Step(float(k), None, seen(list(range(500)), z, cov), NO_LOOPS))
    assert backend.belief().pose == pytest.approx(np.zeros(3), abs=6e-3)
    assert np.isfinite(backend.map().xy).all()


@pytest.mark.parametrize("version", [1, 2])
def test_an_odometry_that_comes_first_moves_what_the_prior_says(version: int) -> None:
    prior = Prior(np.array([1.0, 2.0, np.pi / 2]), np.diag([1e-6, 1e-6, 1e-12]))
    odometry = Odometry(np.array([1.0, 0.0, 0.0]), np.diag([1e-6, 1e-12, 1e-12]))
    backend = make(prior, particles=4000, version=version)
    backend.step(Step(0.0, odometry, seen([], [], []), NO_LOOPS))
    belief = backend.belief()
    assert belief.pose == pytest.approx([1.0, 3.0, np.pi / 2], abs=1e-4)
    assert belief.cov == pytest.approx(np.diag([1e-6, 2e-6, 0.0]), abs=3e-7)
