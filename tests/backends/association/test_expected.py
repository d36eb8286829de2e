"""What backends expect to see: against dense inversion of all information, and the textbook EKF."""

from typing import Any

import numpy as np
import pytest

from asked import ANYWHERE, batch_state, expected_of, ordered
from driven import make, run
from random_logs import random_log
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.core.factors import RangeBearing
from slamduel.core.se2 import Array, Ints, wrap
from tiers import first_quick

WIDE = 1e9
"""A gate that lets everything through."""
BATCH = {
    "ekf": {},
    "ekf at first estimates": {"jacobians": "first-estimates"},
    "smoother": {},
    "isam2": {},
    "kf": {},
    "fixed-lag": {"lag": 1e6},
    "ekf compressed": {"compress_above": 3},
    "invariant-ekf": {},
    "ukf": {"alpha": 0.01},
}
QUICK = 4
"""Of these; the kernels that ask another backend take two to six seconds to compile, each."""
ASKED = ("ekf", "smoother", "isam2")
"""Likewise, where others are asked than on a whole log."""


@pytest.mark.parametrize("name", first_quick(BATCH, QUICK))
@pytest.mark.parametrize("seed", first_quick([0, 1]))
def test_on_an_exact_log_it_is_that_of_the_whole_log(name: str, seed: int) -> None:
    made = random_log(np.random.default_rng(seed), 40, 10, errors=0.0, noise=0.1, radius=4.0)
    log, truth = made
    places = dict(zip(truth.map.ids.tolist(), truth.map.xy, strict=True))
    backend = make(name.partition(" ")[0], log.prior, **BATCH[name])
    asked = 0
    for k, step in enumerate(log):
        if k in (5, 12, 25, 39):
            ids, mean, cov = batch_state(log, truth.poses, places, k)
            z, there = expected_of(mean, cov, step.odometry)
            found = backend.expected(step.odometry, ANYWHERE, WIDE)
            at, here = ordered(found, ids)
            second_order = name in ("kf", "ukf")  # their estimates differ from the truth by terms of second order
            assert at == pytest.approx(z, abs=1e-4 if second_order else 1e-6)
            scale = np.sqrt(np.outer(there.diagonal(), there.diagonal()))
            assert np.abs((here - there) / scale).max() < (5e-3 if second_order else 1e-5)
            asked += len(ids)
        backend.step(step)
    assert asked >= 15


@pytest.mark.parametrize("options", first_quick([{}, {"compress_above": 4}]), ids=["whole", "compressed"])
def test_the_ekf_expects_what_the_textbook_does(options: dict[str, Any]) -> None:
    log = random_log(np.random.default_rng(3), 60, 14).log
    backend, textbook = make("ekf", log.prior, **options), TextbookEkf(log.prior)
    for k, step in enumerate(log):
        if k > 0 and textbook.ids:
            z, cov = expected_of(textbook.mean, textbook.cov, step.odometry)
            at, here = ordered(backend.expected(step.odometry, ANYWHERE, WIDE), textbook.ids)
            assert at == pytest.approx(z, abs=1e-8)
            assert here == pytest.approx(cov, rel=1e-5, abs=1e-10)
        backend.step(step)
        textbook.step(step)


def within(seen: RangeBearing, z: Array, cov: Array, gate: float) -> Ints:
    """Rows of expected sightings that one of those seen is within the gate of."""
    near = set[int]()
    for i in range(len(seen.ids)):
        for a in range(len(z)):
            off = seen.z[i] - z[a]
            off[1] = wrap(off[1])
            S = cov[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] + seen.cov[i]
            if off @ np.linalg.solve(S, off) < gate:
                near.add(a)
    return np.array(sorted(near), np.int64)


@pytest.mark.parametrize("name", first_quick([*ASKED, "ekf compressed", "invariant-ekf", "ukf", "fixed-lag"], 3))
def test_no_landmark_within_the_gate_is_left_out_and_none_beyond_it_is_there(name: str) -> None:
    gate = 18.42
    log = random_log(np.random.default_rng(7), 60, 20, radius=4.0).log
    backend = make(name.partition(" ")[0], log.prior, **BATCH[name])
    number = 0
    for k, step in enumerate(log):
        if k > 0 and len(step.sightings.ids):
            found = backend.expected(step.odometry, step.sightings, gate)
            every = backend.expected(step.odometry, ANYWHERE, WIDE)
            near = within(step.sightings, every.z, every.cov, gate)
            assert sorted(found.ids.tolist()) == sorted(every.ids[near].tolist())
            number += len(near)
        backend.step(step)
    assert number > 100


def sub(seen: RangeBearing, kept: Any) -> RangeBearing:
    return RangeBearing(seen.ids[kept], seen.z[kept], seen.cov[kept])


@pytest.mark.parametrize("name", first_quick(["smoother", "isam2", "fixed-lag"], 2))
def test_a_landmark_that_is_held_back_is_expected(name: str) -> None:
    """With a loss, two sightings have to agree first: until then its place is that of the only one."""
    first = random_log(np.random.default_rng(19), 8, 6, errors=0.0, noise=0.1, radius=6.0, blind=0.0).log
    ids, rows = np.unique(first.ids, return_index=True)
    assert len(ids) > 2
    steps = [
        step._replace(sightings=sub(step.sightings, kept))
        for step, kept in zip(
            first, np.split(np.isin(np.arange(len(first.ids)), rows), first.sighting_first[1:-1]), strict=True
        )
    ]
    backend = make(name, first.prior, loss="cauchy")
    for step in steps[:-1]:
        backend.step(step)
    seen = set(np.concatenate([step.sightings.ids for step in steps[:-1]]).tolist())
    found = backend.expected(steps[-1].odometry, ANYWHERE, WIDE)
    assert set(found.ids.tolist()) == seen
    for i, landmark in enumerate(found.ids.tolist()):
        again = first[7].sightings
        for there, z in zip(again.ids.tolist(), again.z, strict=True):
            if there == landmark:
                assert found.z[i] == pytest.approx(z, abs=1e-6)
                assert np.linalg.eigvalsh(found.cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]).min() > 0


@pytest.mark.parametrize("name", first_quick([*BATCH, "fastslam"], QUICK))
def test_asking_again_changes_no_bit(name: str) -> None:
    log = random_log(np.random.default_rng(11), 50, 15).log
    paths: list[bytes] = []
    for times in (1, 3):
        backend = make(name.partition(" ")[0], log.prior, **BATCH.get(name, {}))
        path: list[Array] = []
        for step in log:
            for _ in range(times if len(step.sightings.ids) else 0):
                backend.expected(step.odometry, step.sightings, 18.42)
            path.append(backend.step(step))
        paths.append(np.array(path).tobytes() + backend.map().xy.tobytes())
    assert paths[0] == paths[1]


def test_particles_expect_their_mean_and_covariance() -> None:
    log = random_log(np.random.default_rng(13), 30, 8).log
    backend = make("fastslam", log.prior, particles=400)
    for k, step in enumerate(log):
        if k == 29:
            pose, weights = backend.belief().pose, backend._weights
            error = backend._poses[:3] - pose[:, None]
            error[2] = wrap(error[2])
            filters, known = backend._maps.all(), backend.map()
            apart = np.concatenate((error, (filters[:, :2] - known.xy[..., None]).reshape(-1, len(weights))))
            cov = (apart * weights) @ apart.T
            cov[3:, 3:] = known.cov
            z, there = expected_of(np.concatenate((pose, known.xy.ravel())), cov, step.odometry)
            at, here = ordered(backend.expected(step.odometry, ANYWHERE, WIDE), known.ids.tolist())
            assert at == pytest.approx(z, abs=1e-8)
            assert here == pytest.approx(there, rel=1e-5, abs=1e-10)
        backend.step(step)


@pytest.mark.parametrize("name", first_quick([*ASKED, "ukf", "invariant-ekf", "fixed-lag", "fastslam"], 3))
def test_a_given_map_is_expected_at_the_first_step(name: str) -> None:
    log = random_log(np.random.default_rng(17), 30, 8).log
    given = run("ekf", log)[0].map()
    prior = log.prior._replace(map=given)
    cov = np.zeros((3 + len(given.cov), 3 + len(given.cov)))
    cov[:3, :3], cov[3:, 3:] = prior.cov, given.cov
    if name == "fastslam":  # it keeps no correlation between landmarks
        blocks = np.kron(np.eye(len(given.ids)), np.ones((2, 2)))
        cov[3:, 3:] *= blocks
    z, there = expected_of(np.concatenate((prior.pose, given.xy.ravel())), cov, None)
    backend = make(name, prior)
    at, here = ordered(backend.expected(None, ANYWHERE, WIDE), given.ids.tolist())
    assert at == pytest.approx(z, abs=1e-6)
    assert here == pytest.approx(there, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("name", first_quick(["smoother", "isam2", "ekf compressed", "invariant-ekf", "fixed-lag"], 2))
def test_what_is_remembered_leaves_out_no_landmark_that_is_sighted(name: str) -> None:
    """Against another one that is asked for all landmarks at each step, and so has nothing to remember."""
    gate, number, missing = 18.42, 0, 0
    for seed in (7, 8):
        log = random_log(np.random.default_rng(seed), 120, 30, radius=4.0, width=24.0).log
        backend, other = (make(name.partition(" ")[0], log.prior, **BATCH[name]) for _ in range(2))
        for k, step in enumerate(log):
            if k > 0 and len(step.sightings.ids):
                every = other.expected(step.odometry, ANYWHERE, WIDE)
                near = set(every.ids[within(step.sightings, every.z, every.cov, gate)].tolist())
                found = set(backend.expected(step.odometry, step.sightings, gate).ids.tolist())
                assert found <= near
                assert not (near - found).intersection(step.sightings.ids.tolist())
                number, missing = number + len(near), missing + len(near - found)
            backend.step(step)
            other.step(step)
    assert number > 200
    assert missing <= number / 500
