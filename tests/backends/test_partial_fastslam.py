"""FastSLAM on sightings of a range or a bearing alone, on fixes, and with constant errors of the sensor."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import driven
from beacon_drives import BEACONS, BEARING, RANGE, Drive, drive
from random_logs import TextbookKalman, random_covariance, random_log
from slamduel.backends.api import Map, Prior, Unsuited
from slamduel.backends.particles import _parts, _rings
from slamduel.backends.particles.particle_maps import ParticleMaps
from slamduel.bench.check.parts import halves
from slamduel.core.factors import Step, Systematic
from slamduel.core.fixes import NO_FIXES, Fixes
from slamduel.core.partial import NO_PARTIAL, Partial
from slamduel.core.se2 import Array, Ints, compose, wrap
from tiers import first_quick

make = partial(driven.make, "fastslam")

DRIVES: dict[str, dict[str, Any]] = {
    "ranges": {},
    "bearings": {"kinds": (BEARING,)},
    "both in turn": {"kinds": (RANGE, BEARING)},
    "ranges of unknown scale": {"scale_sd": 0.1},
    "ranges and positions": {"fix_every": 10},
    "bearings, positions and headings": {"kinds": (BEARING,), "fix_every": 7, "compass": True},
}


def poses_at(poses: Any) -> Array:
    """(5, M) particles at `poses` (M, 3)."""
    at = np.array(poses, float).T
    return np.vstack((at, np.cos(at[2]), np.sin(at[2])))


def expected(xy: Array, pose: Array, kind: int) -> Array:
    """The range or the bearing of places (..., 2)."""
    off = xy - pose[:2]
    return np.hypot(off[..., 0], off[..., 1]) if kind == RANGE else np.arctan2(off[..., 1], off[..., 0]) - pose[2]


def part_of(kind: int, z: float) -> tuple[Array, Array]:
    """A sighting's value and share."""
    return (np.array([z, 0.0]), np.array([1.0, 0.0])) if kind == RANGE else (np.array([0.0, z]), np.array([0.0, 1.0]))


def seen_of(*rows: tuple[int, int, float, float]) -> Partial:
    """Partial sightings of rows id, kind, z, variance."""
    ids, kind, z, var = zip(*rows, strict=True)
    return Partial(np.array(ids), np.array(kind), np.array(z, float), np.array(var, float))


@pytest.mark.parametrize("first", [RANGE, BEARING])
@pytest.mark.parametrize("kind", [RANGE, BEARING])
@pytest.mark.parametrize("scale_sd", [0.0, 0.05])
def test_the_likelihood_of_the_hypotheses_is_the_integral_over_places_and_scales(
    first: int, kind: int, scale_sd: float
) -> None:
    """Of two sightings after the first, from six poses: over ring or ray, width and scale, by a fine grid."""
    var = {RANGE: 0.1**2, BEARING: 0.02**2}
    truth = np.array([4.0, 3.0])
    start = np.array([0.0, 0.0, 0.4])
    M = 6
    seconds = np.array([compose(start, np.array([0.3 + 0.1 * m, 0.1 * m, 0.1])) for m in range(M)])
    thirds = np.array([compose(start, np.array([1.2, 0.5 - 0.1 * m, 0.3])) for m in range(M)])
    common = np.zeros((5, M))
    common[2] = scale_sd**2
    constant = float(scale_sd > 0)
    rings, distance = np.zeros((1, _rings.COLUMNS, M)), np.zeros(M)
    z0 = float(expected(truth, start, first))
    value, _ = part_of(first, z0)
    _rings.begin(
        poses_at(np.tile(start, (M, 1))), rings, 0, common, False, value, first == RANGE, var[first], constant,
        np.zeros(5),
    )  # fmt: skip
    measured = [float(expected(truth, seconds[2], kind)), float(expected(truth, thirds[2], kind))]
    for poses, z in zip((seconds, thirds), measured, strict=True):
        _rings.respond(poses_at(poses), rings, 0, common, False, *part_of(kind, z), var[kind], constant, distance)
    nodes, shares = np.polynomial.hermite_e.hermegauss(9 if scale_sd else 1)
    scale = scale_sd * nodes[:, None, None]
    if first == RANGE:
        across = np.linspace(-5, 5, 41) * np.sqrt(var[RANGE])
        along = np.linspace(-np.pi, np.pi, 2001)[:-1]
        r = (z0 + across[:, None]) / (1 + scale)
        angle = along[None] + 0 * r
        density = np.exp(-0.5 * (across / 0.1) ** 2)[:, None] + 0 * angle
    else:
        across = np.linspace(-5, 5, 41) * np.sqrt(var[BEARING])
        step = np.log(_rings.RATIO)
        along = np.linspace(
            np.log(_rings.NEAREST) - step / 2, np.log(_rings.NEAREST) + (_rings.MOST - 0.5) * step, 2001
        )
        r = np.exp(along)[None] + 0 * across[:, None] + 0 * scale
        angle = start[2] + z0 + across[:, None] + 0 * r
        density = np.exp(-0.5 * (across / 0.02) ** 2)[:, None] + 0 * r
    density = density * shares[:, None, None]
    density /= density.sum()
    xy = np.stack((r * np.cos(angle), r * np.sin(angle)), axis=-1)
    for m in range(M):
        likelihood = density.copy()
        for poses, z in zip((seconds, thirds), measured, strict=True):
            off = z - (1 + scale * (kind == RANGE)) * expected(xy, poses[m], kind)
            off = wrap(off) if kind == BEARING else off
            likelihood *= np.exp(-0.5 * off**2 / var[kind]) / np.sqrt(2 * np.pi * var[kind])
        assert -0.5 * distance[m] - np.log(2 * np.pi) == pytest.approx(np.log(likelihood.sum()), abs=0.25)


@pytest.mark.parametrize("each", [False, True])
def test_given_the_path_landmarks_and_constant_errors_are_one_kalman_filter(each: bool) -> None:
    """The product p(s) p(m1 | s) p(m2 | s) against the joint filter, linearised at the same means."""
    rng = np.random.default_rng(4)
    backend = make(Prior(np.zeros(3), np.eye(3), systematic=Systematic(0.1, 0.3, each=each), partial=True), particles=1)
    parts, maps = backend._parts, backend._maps
    places = np.array([[3.0, 1.0], [-1.0, 4.0]])
    joint = TextbookKalman(np.concatenate((places.ravel(), np.zeros(4))), np.diag([0.09] * 4 + [0.01, 0.09] * 2))
    slots = [maps.add(i) for i in range(2)]
    for slot, place in zip(slots, places, strict=True):
        maps.filters[slot] = 0.0
        parts.adopted(maps.filters[slot])
        maps.filters[slot, :5, 0] = (*place, 0.09, 0.0, 0.09)
    for k in range(30):
        i = k % 2
        pose = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)])
        z = 1.05 * np.hypot(*(places[i] + 0.2 - pose[:2])) + 0.1 + rng.normal(0, 0.1)
        s = 4 + 2 * i * each
        at = joint.mean[2 * i : 2 * i + 2]
        r = np.hypot(*(at - pose[:2]))
        H = np.zeros((1, 8))
        H[0, 2 * i : 2 * i + 2] = (1 + joint.mean[s]) * (at - pose[:2]) / r
        H[0, s : s + 2] = r, 1.0
        e = z - (1 + joint.mean[s]) * r - joint.mean[s + 1]
        U = float((H @ joint.cov @ H.T)[0, 0]) + 0.01
        joint.update(np.array([e]) + H @ joint.mean, H, np.array([[0.01]]))
        distance = np.zeros(1)
        _parts.correct(
            poses_at([pose]), maps.filters, slots[i], parts.common, parts.each, *part_of(RANGE, z), 0.01, 1.0, np.inf,
            False, np.zeros(1, np.bool_), distance,
        )  # fmt: skip
        assert distance[0] == pytest.approx(e * e / U + np.log(U), abs=1e-9)
    filters = maps.all()
    found = parts.marginals(filters)[..., 0]
    assert found[:, :2].ravel() == pytest.approx(joint.mean[:4], abs=1e-9)
    for i in range(2):
        own = joint.cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        assert found[i, 2:] == pytest.approx([own[0, 0], own[0, 1], own[1, 1]], abs=1e-9)
    errors = filters[1, _parts.OWN :, 0] if each else parts.common[:, 0]
    at = slice(6, 8) if each else slice(4, 6)
    assert errors[:2] == pytest.approx(joint.mean[at], abs=1e-9)
    assert errors[2:] == pytest.approx(joint.cov[at, at][[0, 0, 1], [0, 1, 1]], abs=1e-9)
    if not each:
        assert parts.shared(filters, np.ones(1))[:2, 2:] == pytest.approx(joint.cov[:2, 2:4], abs=1e-9)


def test_version_two_draws_from_ranges_bearings_and_fixes_too() -> None:
    """Many particles with one past: mean and covariance are the EKF's, as of landmarks that are held fixed."""
    known = Map(np.array([1, 2]), np.array([[4.0, 1.0], [1.0, -3.0]]), None)
    cov = random_covariance(np.random.default_rng(3), [0.02, 0.02, 0.02])
    prior = Prior(np.array([0.0, 0.0, 0.3]), cov, known, partial=True, fixes=True)
    R = np.full((3, 3), np.nan)
    R[np.ix_([0, 2], [0, 2])] = np.array([[1e-4, 2e-5], [2e-5, 1e-4]])
    fixes = Fixes(np.array([[0.32, np.nan, 0.31]]), R[None], np.array([[0.3, -0.2]]))
    z = [np.hypot(4.0, 1.0) + 0.01, np.arctan2(-3, 1) - 0.31]
    M = 20_000
    backend = make(prior, particles=M, version=2)
    partial_ = seen_of((1, RANGE, z[0], 1e-4), (2, BEARING, z[1], 1e-4))
    backend.step(Step(0.0, None, driven.NO_SIGHTINGS, driven.NO_LOOPS, partial_, fixes))
    ekf = TextbookKalman(prior.pose, prior.cov)
    for at, kind, value in zip(known.xy, (RANGE, BEARING), z, strict=True):
        dx, dy = at - ekf.mean[:2]
        r = np.hypot(dx, dy)
        H = np.array([[-dx / r, -dy / r, 0.0] if kind == RANGE else [dy / r**2, -dx / r**2, -1.0]])
        ekf.update(np.array([value - expected(at, ekf.mean, kind)]) + H @ ekf.mean, H, np.array([[1e-4]]))
    c, s = np.cos(ekf.mean[2]), np.sin(ekf.mean[2])
    slope = np.array([[1.0, 0.0, -(s * 0.3 - c * 0.2)], [0.0, 0.0, 1.0]])
    off = np.array([0.32 - ekf.mean[0] - (c * 0.3 + s * 0.2), 0.31 - ekf.mean[2]])
    ekf.update(off + slope @ ekf.mean, slope, R[np.ix_([0, 2], [0, 2])])
    errors = np.linalg.solve(np.linalg.cholesky(ekf.cov), backend._poses[:3] - ekf.mean[:, None])
    assert errors.mean(axis=1) == pytest.approx(0, abs=6 / np.sqrt(M) + 0.01)
    assert np.cov(errors) == pytest.approx(np.eye(3), abs=6 * np.sqrt(2 / M) + 0.01)
    assert backend.belief().n_eff == pytest.approx(M)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("case", DRIVES)
def test_it_agrees_with_the_ekf(version: int, case: str) -> None:
    """The path to 0.2 m, every beacon to 0.4 m and the scale of ranges to 0.02."""
    made = drive(6, steps=250, **DRIVES[case])
    backend, path = driven.run("fastslam", made.log, 1, version=version)
    other = driven.run("ekf", made.log)[1]
    assert driven.rmse(path[150:], other[150:]) < 0.2
    found = backend.finish()
    assert set(found.map.ids.tolist()) == {0, 1, 2, 3}
    assert np.hypot(*(found.map.xy - BEACONS[found.map.ids]).T).max() < 0.4
    if made.scale:
        assert abs(found.constant.range_scale[0] - made.scale) < 0.02


@pytest.mark.parametrize("version", [1, 2])
def test_the_scale_of_every_beacon_is_estimated(version: int) -> None:
    made = drive(8, steps=300, fix_every=10)
    assert made.log.partial is not None
    scales = np.array([0.1, -0.05, 0.03, -0.1])
    z = made.log.partial.z * (1 + scales[made.log.partial.ids])
    prior = made.log.prior._replace(systematic=Systematic(range_scale=0.1, each=True))
    log = replace(made.log, prior=prior, partial=replace(made.log.partial, z=z))
    found = driven.final("fastslam", log, version=version)
    assert found.constant.range_scale == pytest.approx(scales[found.map.ids], abs=0.02)


@pytest.mark.parametrize("version", [1, 2])
def test_the_offset_of_a_compass_is_estimated(version: int) -> None:
    made = drive(3, steps=150, kinds=(BEARING,), fix_every=3, compass=True)
    assert made.log.fixes is not None
    prior = made.log.prior._replace(systematic=Systematic(heading_offset=0.5))
    log = replace(made.log, prior=prior, fixes=replace(made.log.fixes, z=made.log.fixes.z + np.array([0, 0, 0.3])))
    found = driven.final("fastslam", log, version=version)
    assert found.constant.heading_offset == pytest.approx(0.3, abs=0.05)
    assert driven.rmse(found.path, made.path) < 0.2


@pytest.mark.parametrize("version", [1, 2])
def test_halves_of_sightings_at_one_step_are_whole_ones(version: int) -> None:
    """The same bits: particles do not care in which of the two a log has them."""
    log = random_log(np.random.default_rng(4), 80, 10).log
    log = replace(log, z_cov=log.z_cov * np.eye(2))
    split = halves(log)
    plain, parts = (make(log.prior._replace(partial=part), 0, particles=60, version=version) for part in (False, True))
    parts._draws_start = True
    for whole, half in zip(log, split, strict=True):
        assert plain.step(whole).tobytes() == parts.step(half).tobytes()
    assert plain.map().cov.tobytes() == parts.map().cov.tobytes()


class EagerMaps(ParticleMaps):
    """Copies every landmark at every resampling."""

    def resampled(self, ancestors: Ints) -> None:
        super().resampled(ancestors)
        self.all()


@pytest.mark.parametrize("case", first_quick(["ranges of unknown scale", "ranges", "bearings"], 1))
def test_hypotheses_are_handed_down(case: str) -> None:
    """Copied when next needed or at once, the path is the same; and each particle has those of its ancestor."""
    made = drive(6, steps=80, **DRIVES[case])
    lazy, eager = (make(made.log.prior, particles=40) for _ in range(2))
    eager._maps, eager._parts.open = EagerMaps(40, eager._parts.columns), EagerMaps(40, _rings.COLUMNS, 1)
    copied = 0
    for step in made.log:
        assert lazy.step(step).tobytes() == eager.step(step).tobytes()
        before = eager._parts.open.all()
        common = eager._parts.common.copy()
        if len(before) > 1 and copied < 3:
            ancestors = np.sort(np.random.default_rng(copied).integers(0, 40, 40))
            for one in (lazy, eager):
                one._parts.resampled(ancestors)
            assert np.array_equal(lazy._parts.open.all(), before[..., ancestors])
            assert np.array_equal(lazy._parts.common, common[:, ancestors])
            copied += 1
    assert copied == 3
    assert np.array_equal(lazy.finish().path, eager.finish().path)


def test_space_of_landmarks_that_are_placed_is_used_again() -> None:
    made = drive(2, steps=250)
    assert made.log.partial is not None
    twice = made.log.partial.ids + 10 * (made.log.partial.step >= 125)
    backend = driven.run("fastslam", replace(made.log, partial=replace(made.log.partial, ids=twice)), particles=100)[0]
    assert len(backend._maps.row) >= 7
    assert len(backend._parts.open._slots) <= 4


@pytest.mark.parametrize("turn", [0.5, 2.0, -2.8])
def test_from_any_heading_the_path_is_the_same_turned(turn: float) -> None:
    made = drive(4, steps=120)
    prior = made.log.prior._replace(pose=np.array([0.0, 0.0, turn]))
    plain, turned = (
        driven.run("fastslam", log, 2, version=1, particles=50)[1] for log in (made.log, replace(made.log, prior=prior))
    )
    expected_ = compose(np.array([0.0, 0.0, turn]), plain)
    np.testing.assert_allclose(turned[:, :2], expected_[:, :2], atol=1e-6)


def test_the_start_is_not_drawn_where_nothing_measures_it() -> None:
    """A start that is poorly known moves path and map together: their covariance has it, the estimate does not."""
    made = drive(4, steps=150)
    cov = np.diag([0.5, 0.5, 0.2]) ** 2
    loose = replace(made.log, prior=made.log.prior._replace(cov=cov))
    (tight, path), (backend, other) = (driven.run("fastslam", log, 2) for log in (made.log, loose))
    off = tight.belief().cov
    x, y, _ = path[-1]
    J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    assert np.abs(other - path).max() < 0.5
    assert backend.belief().cov == pytest.approx(off + J @ cov @ J.T, rel=0.1, abs=0.01)
    found = backend.map()
    mx, my = found.xy[0]
    turned = np.array([[1.0, 0.0, -my], [0.0, 1.0, mx]])
    assert found.cov[:2, :2] == pytest.approx(turned @ cov @ turned.T, rel=0.2, abs=0.05)


@pytest.mark.parametrize("version", [1, 2])
def test_a_gate_refuses_a_range_that_is_far_off(version: int) -> None:
    made = drive(4, steps=250)
    assert made.log.partial is not None
    z = made.log.partial.z.copy()
    z[220] += 3.0
    wrong = replace(made.log, partial=replace(made.log.partial, z=z))
    backends = [make(wrong.prior, version=version, gate=gate) for gate in (0.999, 0.0)]
    refused = np.zeros(221, int)
    for k, step in enumerate(wrong.head(221)):
        for backend in backends:
            backend.step(step)
        refused[k] = backends[0].belief().refused
    assert refused[220] == 1
    assert refused[150:220].sum() <= 2
    gated, plain = (backend.belief().n_eff for backend in backends)
    assert plain < 2 < 50 < gated


def test_a_range_too_short_to_leave_a_ring_waits_for_a_longer_one() -> None:
    backend = make(Prior(np.zeros(3), 1e-6 * np.eye(3), partial=True), particles=10)
    for z, there in ((0.2, False), (2.0, True)):
        backend.step(Step(0.0, None, driven.NO_SIGHTINGS, driven.NO_LOOPS, seen_of((3, RANGE, z, 0.01)), NO_FIXES))
        assert (3 in backend._parts.open.row) == there
    assert len(backend.map().ids) == 0
    assert np.hypot(*backend.finish().map.xy[0]) == pytest.approx(2.0)


def test_a_whole_sighting_ends_the_doubt() -> None:
    prior = Prior(np.zeros(3), 1e-8 * np.eye(3), partial=True)
    backend = make(prior, particles=10)
    backend.step(Step(0.0, None, driven.NO_SIGHTINGS, driven.NO_LOOPS, seen_of((3, RANGE, 2.0, 0.01)), NO_FIXES))
    whole = driven.RangeBearing(np.array([3]), np.array([[2.0, 0.7]]), np.diag([0.01, 1e-4])[None])
    backend.step(Step(1.0, None, whole, driven.NO_LOOPS, NO_PARTIAL, NO_FIXES))
    found = backend.map()
    assert found.ids.tolist() == [3]
    assert found.xy[0] == pytest.approx(2.0 * np.array([np.cos(0.7), np.sin(0.7)]), abs=0.02)
    assert np.sqrt(np.trace(found.cov)) == pytest.approx(np.sqrt(0.005 + 4e-4), rel=0.05)


def test_particles_that_associate_take_whole_sightings_alone() -> None:
    from slamduel.backends.association.builders import associating

    builder = associating(driven.find("fastslam"))
    with pytest.raises(Unsuited, match="whole sightings alone"):
        builder.make(
            Prior(np.zeros(3), np.eye(3), partial=True), builder.options(association="particle"),
            np.random.default_rng(0),
        )  # fmt: skip


def consistency(made: Drive, seed: int, version: int) -> float:
    """The mean NEES of a drive, divided by 3."""
    backend = make(made.log.prior, seed, version=version)
    total = list[float]()
    for k, step in enumerate(made.log):
        off = backend.step(step) - made.path[k]
        off[2] = wrap(off[2])
        cov = backend.belief().cov
        if cov is not None and k > 0:
            total.append(float(off @ np.linalg.solve(cov, off)) / 3)
    return float(np.mean(total))


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("case", DRIVES)
def test_it_is_nearly_consistent(case: str, version: int) -> None:
    """The median NEES of 20 drives; few particles have distinct ancestors, so that it is above 1."""
    found = [consistency(drive(seed, **DRIVES[case]), seed, version) for seed in range(20)]
    assert 0.5 < np.median(found) < 2.5
