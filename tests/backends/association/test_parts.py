"""Data association of ranges and bearings alone, on logs whose ids are known to the test alone."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from driven import make, run
from lost_logs import ring, unnamed
from slamduel.backends.api import Expected
from slamduel.backends.association.parts import CLEAR, OFTEN, as_whole, named
from slamduel.backends.association.quantiles import quantile
from slamduel.backends.given import given
from slamduel.backends.registry import find
from slamduel.bench.measure.association import majority
from slamduel.bench.measure.cell import Job, run_on
from slamduel.core.factors import UNKNOWN, Log, Map, Odometry, Prior, RangeBearing, Step, Truth
from slamduel.core.partial import BEARING, NO_PARTIAL, RANGE, Partial
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.on_demand.parts import Parts, with_parts
from tiers import first_quick

BACKENDS = ("ekf", "fastslam", "fixed-lag", "invariant-ekf", "isam2", "smoother", "ukf")
GATE = quantile(0.999, 1, 1)
NO_WHOLE = RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))


def partly(seed: int, **options: Any) -> tuple[Log, Log]:
    """A log with ranges and bearings alone, and the same without any id."""
    dataset = with_parts(ring(**options), Parts(ranges_only=0.2, bearings_only=0.2), np.random.default_rng(seed))
    log = dataset.log
    assert log.partial is not None
    nobody = np.full(len(log.partial), UNKNOWN)
    return log, replace(unnamed(log), partial=replace(log.partial, ids=nobody))


def part_of(*rows: tuple[int, int, float, float]) -> Partial:
    """Partial sightings of (id, kind, z, var)."""
    ids, kind, z, var = zip(*rows, strict=True)
    return Partial(np.array(ids, np.int64), np.array(kind, np.int64), np.array(z), np.array(var))


def expecting(ids: list[int], z: list[list[float]], cov: Array) -> Expected:
    return Expected(np.array(ids, np.int64), np.array(z), cov)


def decided(parts: Partial, expected: Expected, whole: RangeBearing = NO_WHOLE, reach: float = 20.0) -> list[int]:
    return named(parts, expected, whole, GATE, reach)[0].tolist()


def by_hand(parts: Partial, expected: Expected, whole: RangeBearing, reach: float) -> list[int]:
    """The decision by the density of all that has been measured, afresh for each pair: no conditioning.

    The density of a hypothesis is that of one dense normal; the loss of a further pair is what it adds to it.
    """
    at = {int(landmark): a for a, landmark in enumerate(expected.ids)}
    rows, values, noise = list[int](), list[float](), list[Array]()
    for landmark, z, R in zip(whole.ids.tolist(), whole.z, whole.cov, strict=True):
        if landmark in at:
            rows += [2 * at[landmark], 2 * at[landmark] + 1]
            values += z.tolist()
            noise.append(R)

    def loss(rows: list[int], values: list[float], noise: list[Array]) -> tuple[float, float]:
        if not rows:
            return 0.0, 0.0
        S = expected.cov[np.ix_(rows, rows)].copy()
        k = 0
        for R in noise:
            S[k : k + len(R), k : k + len(R)] += R
            k += len(R)
        off = np.array(values) - expected.z.ravel()[rows]
        off = np.array([wrap(d) if row % 2 else d for d, row in zip(off, rows, strict=True)])
        d2 = float(off @ np.linalg.inv(S) @ off)
        return d2 + float(np.linalg.slogdet(2 * np.pi * S)[1]), d2

    ids = parts.ids.tolist()
    while True:
        base, base_d2 = loss(rows, values, noise)
        best: tuple[float, int, int] | None = None
        for i in range(len(ids)):
            if ids[i] != UNKNOWN:
                continue
            kind, found = int(parts.kind[i]), list[tuple[float, float, int]]()
            for landmark, a in at.items():
                if any(ids[j] == landmark and parts.kind[j] == kind for j in range(len(ids))):
                    continue
                more = loss([*rows, 2 * a + kind], [*values, float(parts.z[i])], [*noise, np.array([[parts.var[i]]])])
                if expected_range(expected, a, rows, values, noise) <= reach:
                    found.append((more[0] - base, more[1] - base_d2, landmark))
            found.sort()
            none = 2 * np.log(OFTEN * (reach if kind == RANGE else 2 * np.pi))
            if not found or not found[0][1] < GATE:
                continue
            margin = min([none, *(one[0] for one in found[1:])]) - CLEAR - found[0][0]
            if margin >= 0 and (best is None or margin > best[0]):
                best = margin, i, found[0][2]
        if best is None:
            return ids
        _, i, landmark = best
        ids[i] = landmark
        rows.append(2 * at[landmark] + int(parts.kind[i]))
        values.append(float(parts.z[i]))
        noise.append(np.array([[parts.var[i]]]))


def expected_range(expected: Expected, a: int, rows: list[int], values: list[float], noise: list[Array]) -> float:
    """The range of a landmark given measurements, by the normal equations in information form."""
    n = expected.z.size
    information, vector = np.linalg.inv(expected.cov), np.zeros(n)
    k = 0
    for R in noise:
        H, off = np.zeros((len(R), n)), np.empty(len(R))
        for h in range(len(R)):
            row = rows[k + h]
            H[h, row] = 1.0
            off[h] = values[k + h] - expected.z.ravel()[row]
            off[h] = wrap(off[h]) if row % 2 else off[h]
        information += H.T @ np.linalg.inv(R) @ H
        vector += H.T @ np.linalg.inv(R) @ off
        k += len(R)
    return float(expected.z[a, 0] + np.linalg.solve(information, vector)[2 * a])


@pytest.mark.parametrize("seed", range(8))
def test_decisions_are_those_of_dense_densities_over_all_landmarks(seed: int) -> None:
    rng, same, taken = np.random.default_rng(seed), 0, 0
    for _ in range(25):
        n = int(rng.integers(1, 6))
        ids = (-2 - np.arange(n)).tolist()
        z = np.column_stack((rng.uniform(1, 9, n), rng.uniform(-np.pi, np.pi, n)))
        pose, own = rng.normal(0, 0.15, (2 * n, 3)), rng.normal(0, 0.1, (2 * n, 2 * n))
        expected = expecting(ids, z.tolist(), pose @ pose.T + own @ own.T + 1e-3 * np.eye(2 * n))
        true = z.ravel() + np.linalg.cholesky(expected.cov) @ rng.normal(size=2 * n)
        rows = list[tuple[int, int, float, float]]()
        for a, kind in product(range(n), (RANGE, BEARING)):
            if rng.uniform() < 0.5:
                rows.append((UNKNOWN, kind, float(true[2 * a + kind] + rng.normal(0, 0.05)), 0.05**2))
        rows.append((UNKNOWN, RANGE, float(rng.uniform(1, 9)), 0.05**2))
        seen = np.flatnonzero(rng.uniform(size=n) < 0.5)
        whole = RangeBearing(
            np.array([ids[a] for a in seen] + [-99], np.int64),
            np.concatenate((true.reshape(-1, 2)[seen], [[3.0, 0.0]])),
            np.array([0.05**2 * np.eye(2)] * (len(seen) + 1)),
        )
        parts = part_of(*rows)
        found = decided(parts, expected, whole, 8.0)
        assert found == by_hand(parts, expected, whole, 8.0)
        same, taken = same + 1, taken + sum(name != UNKNOWN for name in found)
    assert same == 25
    assert taken > 10


def test_a_range_that_fits_two_landmarks_is_left_out() -> None:
    """Also two that are mirrored about the way of the robot: only their bearings differ."""
    two = expecting([-2, -3], [[4.0, 0.7], [4.0, -0.7]], 1e-3 * np.eye(4))
    assert decided(part_of((UNKNOWN, RANGE, 4.01, 1e-3)), two) == [UNKNOWN]
    assert decided(part_of((UNKNOWN, BEARING, 0.69, 1e-3)), two) == [-2]
    apart = expecting([-2, -3], [[4.0, 0.7], [5.0, -0.7]], 1e-3 * np.eye(4))
    assert decided(part_of((UNKNOWN, RANGE, 4.01, 1e-3)), apart) == [-2]


def test_a_landmark_takes_one_sighting_of_each_kind() -> None:
    one = expecting([-2], [[4.0, 0.7]], 1e-3 * np.eye(2))
    twice = part_of((UNKNOWN, RANGE, 4.05, 1e-3), (UNKNOWN, RANGE, 4.0, 1e-3), (UNKNOWN, BEARING, 0.7, 1e-3))
    assert decided(twice, one) == [UNKNOWN, -2, -2]
    known = part_of((UNKNOWN, RANGE, 4.0, 1e-3), (-2, RANGE, 4.0, 1e-3))
    assert decided(known, one) == [UNKNOWN, -2]


def test_a_sighting_far_off_or_of_a_landmark_out_of_reach_is_left_out() -> None:
    one = expecting([-2], [[4.0, 0.7]], 1e-3 * np.eye(2))
    assert decided(part_of((UNKNOWN, RANGE, 4.3, 1e-3)), one) == [UNKNOWN]
    assert decided(part_of((UNKNOWN, BEARING, 0.7, 1e-3)), one, reach=3.0) == [UNKNOWN]
    assert decided(part_of((UNKNOWN, BEARING, 0.7 - 2 * np.pi, 1e-3)), one) == [-2]


def test_a_wide_landmark_is_not_preferred_for_being_wide() -> None:
    """The squared distance alone prefers the one that is hardly known; its density is low."""
    cov = np.diag([1e-4, 1e-4, 4.0, 1e-4])
    both = expecting([-2, -3], [[4.0, 0.7], [4.05, 2.0]], cov)
    assert decided(part_of((UNKNOWN, RANGE, 4.02, 1e-4)), both) == [-2]


def test_what_whole_sightings_tell_of_the_heading_decides() -> None:
    """A heading that is off by as much as two landmarks are apart shifts all bearings alike."""
    turned = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    cov = 0.2**2 * np.outer(turned, turned) + 1e-5 * np.eye(6)
    three = expecting([-2, -3, -4], [[4.0, 0.0], [4.0, 0.3], [4.0, 2.0]], cov)
    bearing = part_of((UNKNOWN, BEARING, 0.3, 1e-4))
    assert decided(bearing, three) == [UNKNOWN]
    off = RangeBearing(np.array([-4]), np.array([[4.0, 2.3]]), np.array([1e-4 * np.eye(2)]))
    assert decided(bearing, three, off) == [-2]


def test_what_is_asked_for_finds_every_landmark_on_the_ring_and_on_the_ray() -> None:
    at = np.array([[4.0, 0.0], [0.0, 4.0], [-4.0, 0.0], [2.0, 2.0], [-3.0, -3.0]])
    known = Map(np.arange(5), at + 1.0, 1e-4 * np.eye(10))
    prior = Prior(np.array([1.0, 1.0, 0.0]), 1e-4 * np.eye(3), known)
    for name in ("ekf", "invariant-ekf", "smoother", "ukf"):
        backend = make(name, prior)
        for part, found in (
            (part_of((UNKNOWN, RANGE, 4.0, 1e-4)), {0, 1, 2}),
            (part_of((UNKNOWN, BEARING, np.pi / 4, 1e-4)), {3}),
        ):
            asked = as_whole(part, 10.0)
            for column in asked:
                column.flags.writeable = False  # as the layer's
            expected = backend.expected(Odometry(np.zeros(3), 1e-6 * np.eye(3)), asked, quantile(0.9999, 1))
            assert set(expected.ids.tolist()) >= found, name


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_among_well_separated_landmarks_no_id_is_wrong(name: str, seed: int) -> None:
    log, blind = partly(seed)
    backend, path = run(name, blind, association="jcbb", **({"lag": 1e6} if name == "fixed-lag" else {}))
    assert log.partial is not None
    found = majority(backend.assigned(), log.ids)
    true = dict(zip(found.ids.tolist(), found.true.tolist(), strict=True))
    ids = backend.assigned_partial()
    used = ids != UNKNOWN
    assert ids.shape == log.partial.ids.shape
    wrong = np.array([true[i] for i in ids[used].tolist()]) != log.partial.ids[used]
    assert wrong.mean() <= 0.01
    assert used.mean() > 0.3
    without = run(name, replace(blind, partial=None), association="jcbb")[1]
    assert not np.array_equal(path, without)  # they are used


def test_ids_that_are_known_go_through_untouched_and_a_step_without_parts_stays_the_same_object() -> None:
    log, _ = partly(0)
    plain, behind = make("ekf", log.prior), make("ekf", log.prior, association="jcbb")
    for step in log:
        assert plain.step(step).tobytes() == behind.step(step).tobytes()
    assert log.partial is not None
    assert behind.assigned_partial().tolist() == log.partial.ids.tolist()
    assert next(iter(ring().log)).partial is NO_PARTIAL


def test_only_the_layer_is_given_partial_sightings_without_an_id() -> None:
    _, blind = partly(0)
    assert blind.partial is not None
    for name, association, left in (
        ("ekf", "none", len(blind.partial)),
        ("ekf", "jcbb", 0),
        ("fastslam", "jcbb", 0),
        ("fastslam", "particle", len(blind.partial)),
    ):
        builder = find(name)
        assert given(builder, blind, builder.options(association=association)).partial == left


def test_a_row_counts_partial_sightings_with_the_whole_ones() -> None:
    """Its J is of all that was used: a smoother that minimises it has an optimum."""
    log, blind = partly(0)
    assert log.partial is not None
    assert blind.partial is not None
    truth = Truth(np.zeros(0), np.zeros((0, 3)), assigned=log.ids, assigned_partial=log.partial.ids)
    only = replace(log, partial=blind.partial)  # the whole ones have ids
    options = find("smoother").options(association="jcbb")
    job = Job("smoother[association=jcbb]", "smoother", options, 0, 4000)
    for one, names in ((blind, len(blind.ids) + len(blind.partial)), (only, len(log.ids) + len(blind.partial))):
        found = run_on(job, lambda one=one: one, lambda: truth)
        backend, _ = run("smoother", one, association="jcbb")
        backend.finish()
        left = int((backend.assigned_partial() == UNKNOWN).sum())
        dropped = left + int((backend.assigned() == UNKNOWN).sum())
        assert found.status == "done", found.reason
        assert f"{left} of {len(blind.partial)} partial sightings without an id fit no landmark clearly" in found.reason
        assert found.row["final_dropped_share"] == pytest.approx(dropped / names)
        assert found.row["final_wrong_share"] <= 0.01
        assert found.row["cost_j"] > 0


def test_steps_that_wait_have_their_parts_named_later() -> None:
    _, blind = partly(0)
    backend = make("ekf", blind.prior, association="jcbb", confirm=3)
    for step in blind:
        backend.step(step)
    before = backend.assigned_partial()
    backend.finish()
    after = backend.assigned_partial()
    assert blind.partial is not None
    assert len(before) == len(after) == len(blind.partial)
    assert (after[before != UNKNOWN] == before[before != UNKNOWN]).all()
    assert (after != UNKNOWN).sum() > 0.3 * len(after)


def test_errors_of_ranges_that_stay_widen_the_gate() -> None:
    """A range that is too long by a scale that the prior allows is named; without that it fits no landmark."""
    known = Map(np.arange(2), np.array([[4.0, 0.0], [0.0, 9.0]]), 1e-4 * np.eye(4))
    prior = Prior(np.zeros(3), 1e-4 * np.eye(3), known, partial=True)
    step = Step(0.0, None, NO_WHOLE, ring().log[0].loops, part_of((UNKNOWN, RANGE, 4.1, 1e-4)))
    for scale, name in ((0.0, UNKNOWN), (0.02, 0)):
        one = make("ekf", prior._replace(systematic=prior.systematic._replace(range_scale=scale)), association="jcbb")
        one.step(step)
        assert one.assigned_partial().tolist() == [name]
