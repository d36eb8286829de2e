"""FastSLAM whose particles associate by themselves, against a plain loop that shares no code with it."""

import pickle
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import driven
import slamduel
from lost_logs import ring, unnamed
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.association.options import check
from slamduel.backends.programs.textbook_fastslam import (
    Landmark,
    _correct,  # pyright: ignore[reportPrivateUsage]
    _found,  # pyright: ignore[reportPrivateUsage]
    _seen_first,  # pyright: ignore[reportPrivateUsage]
    _sight,  # pyright: ignore[reportPrivateUsage]
    _wrapped,  # pyright: ignore[reportPrivateUsage]
)
from slamduel.bench.measure.association import association_columns
from slamduel.bench.measure.drive import drive
from slamduel.bench.measure.score import score
from slamduel.bench.plan.spec import backend_variants
from slamduel.core.errors import InputError
from slamduel.core.factors import UNKNOWN, Log, Prior, Step
from slamduel.core.se2 import Array, Ints
from tiers import first_quick

make = partial(driven.make, "fastslam", association="particle")

GATE = -4 * np.log(1e-4)
"""Twice the squared distance that a right pair exceeds once in 10,000 times."""


@dataclass
class Particle:
    """A path, what it took every sighting for, and its landmarks with their ids."""

    pose: Array
    landmarks: list[Landmark] = field(default_factory=list[Landmark])
    names: list[int] = field(default_factory=list[int])
    rows: list[int] = field(default_factory=list[int])
    log_weight: float = 0.0


class SlowFilter:
    """One particle, sighting and landmark after another; random numbers are drawn as the package's own draws them."""

    def __init__(self, prior: Prior, particles: int, rng: np.random.Generator, version: int, below: float) -> None:
        self.particles = [Particle(np.array(prior.pose)) for _ in range(particles)]
        self._prior, self._rng, self._version, self._below, self._seen = prior, rng, version, below, 0
        self._first = True

    def weights(self) -> Array:
        logs = np.array([particle.log_weight for particle in self.particles])
        weights = np.exp(logs - logs.max())
        return weights / weights.sum()

    def step(self, step: Step) -> Array:
        weights, M = self.weights(), len(self.particles)
        if 1 / np.sum(weights**2) < self._below * M * (1 - 1e-9):
            parents = [self.particles[m] for m in _found(weights, (self._rng.random() + np.arange(M)) / M)]
            self.particles = [Particle(p.pose.copy(), list(p.landmarks), list(p.names), list(p.rows)) for p in parents]
        motion = (np.zeros(3), self._prior.cov) if self._first else step.odometry
        normals = None if motion is None else self._rng.standard_normal((3, M))
        believed: list[tuple[Array, Array]] = []
        for m, particle in enumerate(self.particles):
            mean, cov = particle.pose, np.zeros((3, 3))
            if motion is not None and normals is not None:
                c, s = np.cos(mean[2]), np.sin(mean[2])
                turn = np.eye(3) if self._first else np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
                mean, cov = mean + turn @ motion[0], turn @ motion[1] @ turn.T
                if self._version == 1:
                    mean, cov = mean + turn @ np.linalg.cholesky(motion[1]) @ normals[:, m], np.zeros((3, 3))
            believed.append((mean, cov))
        self._first = False
        order = self._order(step, self._heaviest(), believed)
        for m, particle in enumerate(self.particles):
            self._take(step, particle, *believed[m], order, None if normals is None else normals[:, m])
        self._seen += len(step.sightings.ids)
        poses = np.array([particle.pose for particle in self.particles])
        x, y, c, s = self.weights() @ np.column_stack((poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])))
        return np.array([x, y, np.arctan2(s, c)])

    def assigned(self) -> Ints:
        best = self.particles[self._heaviest()]
        return np.array([best.names[row] for row in best.rows], np.int64)

    def _heaviest(self) -> int:
        weights = self.weights()
        return int(np.argmax(weights > weights.max() * (1 - 1e-9)))

    def _order(self, step: Step, heaviest: int, believed: list[tuple[Array, Array]]) -> list[int]:
        """Sightings with ids first, then those whose second likeliest landmark is furthest behind the first."""
        particle, (mean, cov) = self.particles[heaviest], believed[heaviest]
        ids = step.sightings.ids.tolist()
        named = [i for i, name in enumerate(ids) if name != UNKNOWN]
        taken: set[int] = set()
        for i in named:
            if ids[i] in particle.names:
                row = particle.names.index(ids[i])
                taken.add(row)
                mean, cov = folded(mean, cov, particle.landmarks[row], step, i)
        ahead: dict[int, float] = {}
        for i in set(range(len(ids))) - set(named):
            free = [one for row, one in enumerate(particle.landmarks) if row not in taken]
            least, second, *_ = sorted([GATE, GATE] + [min(surprise(mean, cov, one, step, i), GATE) for one in free])
            ahead[i] = second - least
        return named + sorted(ahead, key=lambda i: (-ahead[i], i))

    def _take(
        self, step: Step, particle: Particle, mean: Array, cov: Array, order: list[int], normals: Array | None
    ) -> None:
        ids, rows, new, had = step.sightings.ids.tolist(), dict[int, int](), list[int](), len(particle.names)
        for known in (True, False):  # landmarks of known ids first
            for i in order:
                if (ids[i] in particle.names[:had] and i not in new) != known or i in rows:
                    continue
                free = [row for row in range(had) if row not in rows.values()]
                if known:
                    row = particle.names.index(ids[i])
                else:
                    if ids[i] != UNKNOWN:
                        free = [row for row in free if particle.names[row] < UNKNOWN]
                    costs = [surprise(mean, cov, particle.landmarks[row], step, i) for row in free]
                    row = free[int(np.argmin(costs))] if costs and min(costs) < GATE else len(particle.names)
                rows[i] = row
                if row == len(particle.names):
                    new.append(i)
                    particle.names.append(-2 - self._seen - i if ids[i] == UNKNOWN else ids[i])
                    particle.log_weight -= GATE / 2
                    continue
                if ids[i] != UNKNOWN:
                    particle.names[row] = ids[i]
                particle.log_weight -= surprise(mean, cov, particle.landmarks[row], step, i) / 2
                mean, cov = folded(mean, cov, particle.landmarks[row], step, i)
        particle.pose = mean if not cov.any() or normals is None else mean + np.linalg.cholesky(cov) @ normals
        particle.pose[2] = _wrapped(particle.pose[2])
        for i in sorted(rows, key=lambda i: rows[i]):
            z, R = step.sightings.z[i], step.sightings.cov[i]
            if i in new:
                particle.landmarks.append(_seen_first(particle.pose, z, R))
            else:
                particle.landmarks[rows[i]] = _correct(particle.landmarks[rows[i]], particle.pose, z, R)[0]
        particle.rows += [rows[i] for i in range(len(ids))]


def innovation(mean: Array, cov: Array, landmark: Landmark, step: Step, i: int) -> tuple[Array, Array, Array]:
    expected, by_pose, by_landmark = _sight(mean, landmark.mean)
    off = step.sightings.z[i] - expected
    off[1] = _wrapped(off[1])
    S = step.sightings.cov[i] + by_landmark @ landmark.cov @ by_landmark.T + by_pose @ cov @ by_pose.T
    return off, S, by_pose


def surprise(mean: Array, cov: Array, landmark: Landmark, step: Step, i: int) -> float:
    off, S, _ = innovation(mean, cov, landmark, step, i)
    return float(off @ np.linalg.solve(S, off) + np.log(np.linalg.det(S) / np.linalg.det(step.sightings.cov[i])))


def folded(mean: Array, cov: Array, landmark: Landmark, step: Step, i: int) -> tuple[Array, Array]:
    off, S, by_pose = innovation(mean, cov, landmark, step, i)
    K = cov @ by_pose.T @ np.linalg.inv(S)
    after = (np.eye(3) - K @ by_pose) @ cov
    return mean + K @ off, (after + after.T) / 2


def some_ids(log: Log, share: float) -> Log:
    hidden = np.random.default_rng(5).random(len(log.ids)) < share
    return replace(log, ids=np.where(hidden, UNKNOWN, log.ids))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(("share", "below"), first_quick([(0.6, 0.5), (1.0, 0.5), (1.0, 1.0)]))
def test_it_is_the_slow_filter(version: int, share: float, below: float) -> None:
    """After every step the pose and weights agree, and at the end every particle's map, ids and decisions."""
    resampled = 0
    for seed in range(2):
        log = some_ids(random_log(np.random.default_rng(seed), 40, 12, radius=4.0).log, share)
        mine = make(log.prior, seed, particles=5, version=version, resample_below=below)
        slow = SlowFilter(log.prior, 5, np.random.default_rng(seed), version, below)
        for step in log:
            resampled += slow.particles[0].log_weight == 0
            assert mine.step(step) == pytest.approx(slow.step(step), abs=1e-8)
            assert mine._weights == pytest.approx(slow.weights(), abs=1e-7)
        for m, particle in enumerate(slow.particles):
            names, filters = mine._maps.of(m)
            assert names.tolist() == particle.names
            own = [[*one.mean, one.cov[0, 0], one.cov[0, 1], one.cov[1, 1]] for one in particle.landmarks]
            assert filters == pytest.approx(np.array(own), abs=1e-8)
        assert mine.assigned().tolist() == slow.assigned().tolist()
    assert resampled


@pytest.mark.parametrize("version", [1, 2])
def test_on_a_ring_the_map_has_the_right_number_of_landmarks(version: int) -> None:
    log = ring().log
    backend = make(log.prior, particles=100, version=version)
    for step in unnamed(log):
        backend.step(step)
    row = association_columns(backend.assigned(), log.ids)
    assert row["wrong_share"] == row["dropped_share"] == 0
    assert row["landmarks_double"] == row["landmarks_merged"] == 0
    assert len(backend.map().ids) == len(np.unique(log.ids))


@pytest.mark.parametrize("version", [1, 2])
def test_told_all_ids_it_is_the_filter_that_is_told(version: int) -> None:
    log = random_log(np.random.default_rng(3), 60, 10).log
    told = driven.make("fastslam", log.prior, particles=300, version=version)
    mine = make(log.prior, particles=300, version=version)  # more than one block of them
    for step in log:
        assert mine.step(step) == pytest.approx(told.step(step), abs=1e-9)
    assert mine.assigned().tolist() == log.ids.tolist()
    assert mine.finish().map.xy == pytest.approx(told.finish().map.xy, abs=1e-9)


def test_ids_of_map_belief_and_history_are_of_one_particle_however_often_it_is_resampled() -> None:
    log = unnamed(ring(odometry=0.1, landmarks=30).log)
    backend = make(log.prior, particles=40, resample_below=1.0)
    sighted = 0
    for k, step in enumerate(log):
        backend.step(step)
        sighted += len(step.sightings.ids)
        found, now = backend.assigned(), backend.belief().assigned
        assert len(found) == sighted
        assert found[sighted - len(now) :].tolist() == now.tolist()
        assert len(np.unique(now)) == len(now)
        assert set(found.tolist()) == set(backend.map().ids.tolist()), k
        first = np.array([np.argmax(found == one) for one in np.unique(found)])
        assert (found[first] == -2 - first).all()  # an id is named after the sighting that made it up
    assert backend.belief().ancestors < 10
    assert backend.finish().map.ids.tolist() == backend.map().ids.tolist()


def test_decisions_are_kept_where_particles_are_resampled_and_nothing_is_seen() -> None:
    log = unnamed(ring(odometry=0.1).log.head(20))
    backend = make(log.prior, particles=40)
    for step in log:
        backend.step(step)
    descendants = np.full(40, backend._heaviest())
    before = backend.assigned()
    backend._decisions.resampled(descendants)
    backend._maps.resampled(descendants)
    for m in (0, 39):
        backend._log_weights = np.where(np.arange(40) == m, 0.0, -1.0)
        assert backend.assigned().tolist() == before.tolist()


def test_on_a_given_map_that_is_held_fixed_its_ids_are_found() -> None:
    log, truth = ring()
    backend = make(log.prior._replace(map=truth.map), particles=100)
    for step in unnamed(log):
        backend.step(step)
    assert (backend.assigned() == log.ids).all()
    assert np.array_equal(backend.map().xy, truth.map.xy)  # pyright: ignore[reportOptionalMemberAccess]


def test_a_log_whose_ids_are_hidden_is_driven_and_scored() -> None:
    row, told = (
        scored(f"fastslam[particles=50{rule}]", f"circle[steps=100,landmarks=16,sighting=0.05{ids}]")
        for rule, ids in ((",association=particle", ",ids=hidden"), ("", ""))
    )
    assert row["wrong_share"] == row["final_wrong_share"] == 0
    assert row["landmarks_double"] == row["final_landmarks_double"] == 0
    assert row["final_ate_m"] < 1.5 * told["final_ate_m"]


def scored(backend: str, dataset: str) -> dict[str, Any]:
    made = slamduel.load(dataset, seed=1)
    variant = backend_variants(backend)[0]
    assert variant.builder is not None
    outcome = drive(variant.builder, variant.options, made.log, lambda: np.random.default_rng(0))
    return score(made.log, outcome, made.truth).row


@pytest.mark.parametrize(
    "option", ["match=0.99", "joint=0.9", "rescue=false", "lookahead=3", "confirm=1", "within=4", "retire=5", "nodes=9"]
)
def test_options_that_it_does_not_have_are_refused(option: str) -> None:
    name = option.partition("=")[0]
    with pytest.raises(InputError, match=rf"option {name} is not for association=particle; expected association=nn"):
        backend_variants(f"fastslam[association=particle,{option}]")
    assert backend_variants(f"fastslam[association=jcbb,{option}]")


def test_the_rule_is_that_of_fastslam_alone() -> None:
    with pytest.raises(
        InputError, match="association=particle is not one of its values; expected one of none, nn, ml, jcbb"
    ):
        backend_variants("ekf[association=particle]")
    options = registry.find("fastslam").options(association="particle", new=0.99)
    check(options, "backend fastslam")
    again = pickle.loads(pickle.dumps(options))
    assert again == options
    assert type(again) is type(options)
