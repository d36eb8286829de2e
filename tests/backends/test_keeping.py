"""`smoother[keep=...]`: what it marginalises, by dense algebra; what that loses, beside the exact smoother."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from driven import aligned_error, asking_changes_nothing, final, make, run
from random_logs import random_covariance, random_log
from slamduel.backends.api import Unsuited
from slamduel.backends.keeping import _condensed, _stretches
from slamduel.backends.keeping import smoother as keeping
from slamduel.backends.keeping.submaps import Condensed, begun
from slamduel.backends.smoothing import _factors, _log
from slamduel.backends.smoothing._graph import (
    END,
    FIRST,
    LANDMARK,
    LOSS,
    MEMBER,
    NO_VARIABLE,
    PART,
    PLACE,
    POINT,
    POSE,
    SCALE,
    SIGHTINGS,
    SUBMAP,
    Graph,
)
from slamduel.backends.smoothing.arrays import made, with_rows
from slamduel.core.factors import Dataset, Prior
from slamduel.core.gyro import Bias
from slamduel.core.se2 import Array, Ints, between, wrap
from slamduel.datasets.worlds.city import Options, city
from tiers import first_quick

LANDMARKS, STEP_COUNT = 60, 1500


def a_city(seed: int, steps: int = STEP_COUNT) -> Dataset:
    return city(Options(landmarks=LANDMARKS, steps=steps), np.random.default_rng(seed))


def normalised(path: Array, cov: Array, truth: Array) -> float:
    """The mean NEES of a path, over its degrees of freedom."""
    off = path - truth
    off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
    return float(np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off).mean() / 3)


def a_stretch(rng: np.random.Generator, poses: int = 6, landmarks: int = 5) -> Graph:
    """A pose, then a stretch of poses, each with sightings of all landmarks, off their linearisation points."""
    g = made(0, 1.0)
    for table, rows in (("steps", poses + 1), ("variables", poses + landmarks + 1), ("sightings", poses * landmarks)):
        g = with_rows(g, table, rows)
    pose, cov = np.array([1.0, -2.0, 2.9]), 0.01 * np.eye(3)
    _log.move(g, np.concatenate((pose[None], cov)), pose, cov)
    newest = _log.add_pose_after(g, NO_VARIABLE, 0)
    places = pose[:2] + rng.uniform(2, 5, (landmarks, 2))
    variables = np.array([_log.add_variable(g, 2, x, y, 0.0) for x, y in places.tolist()])
    for k in range(1, poses + 1):
        motion = np.concatenate((np.array([[0.5, 0.1, 0.3]]), random_covariance(rng, [0.1, 0.2, 0.05])))
        _log.move(g, motion, pose, cov)
        g.steps[k, 9:] += 0.03 * rng.standard_normal(3)
        newest = _log.add_pose_after(g, newest, k)
        x, seen = g.values[newest], np.zeros((landmarks, 6))
        for i, v in enumerate(variables):
            d = g.values[v, :2] - x[:2]
            seen[i, :2] = np.hypot(*d) + 0.1 * rng.standard_normal(), wrap(np.arctan2(d[1], d[0]) - x[2] + 0.02)
            seen[i, 2:] = random_covariance(rng, [0.2, 0.1]).ravel()
        _log.add_sightings_of(g, newest, variables, seen)
    return g


def residuals(g: Graph, poses: Array, landmarks: dict[int, Array]) -> tuple[Array, list[slice]]:
    """The whitened residuals of the stretch from step 1 on, by the models as they are defined; those of sightings."""
    out, seen, at = list[Array](), list[slice](), 0
    for k in range(1, len(poses) + 1):
        x = poses[k - 1]
        if k > 1:
            e = between(poses[k - 2], x) - g.steps[k, :3]
            e[2] = wrap(e[2])
            a = g.steps[k, 3:9]
            cov = np.array([[a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]]])
            out.append(np.array(np.linalg.solve(np.linalg.cholesky(cov), e), np.float64))
            at += 3
        pose = g.at[k]
        for s in range(g.variables[pose, FIRST], g.variables[pose, END]):
            d = landmarks[int(g.sightings[s, LANDMARK])] - x[:2]
            r, b, rr, rb, bb = g.seen[s]
            e = np.array([np.hypot(*d) - r, wrap(np.arctan2(d[1], d[0]) - x[2] - b)])
            out.append(np.linalg.cholesky(np.array([[rr, rb], [rb, bb]])).T @ e)
            seen.append(slice(at, at + 2))
            at += 2
    return np.concatenate(out), seen


def dense(g: Graph, poses: int, variables: Ints, lost: float | None) -> tuple[Array, Array, float]:
    """Information, right-hand side and J of all poses, then all landmarks of a stretch, by central differences.

    With a scale `lost`, sightings have Cauchy's loss, and the weights of the linearisation point.
    """
    start = np.concatenate((g.steps[1 : poses + 1, 9:12].ravel(), g.values[variables, :2].ravel()))

    def off(v: Array) -> Array:
        xy = v[3 * poses :].reshape(-1, 2)
        return residuals(g, v[: 3 * poses].reshape(-1, 3), {int(i): xy[n] for n, i in enumerate(variables)})[0]

    h = 1e-6
    J = np.stack([(off(start + h * e) - off(start - h * e)) / (2 * h) for e in np.eye(len(start))], axis=1)
    e = off(start)
    weights, total = np.ones(len(e)), float(e @ e)
    if lost is not None:
        poses_at = start[: 3 * poses].reshape(-1, 3)
        _, seen = residuals(g, poses_at, {int(i): g.values[i, :2] for i in variables})
        for rows in seen:
            q = float(e[rows] @ e[rows])
            weights[rows] = 1 / (1 + q / lost**2)
            total += lost**2 * np.log1p(q / lost**2) - q
    return J.T @ (weights[:, None] * J), -J.T @ (weights * e), total


@pytest.mark.parametrize("frame", [False, True])
@pytest.mark.parametrize("lost", [None, 1.0])
def test_a_condensed_stretch_is_a_schur_complement(frame: bool, lost: float | None) -> None:
    rng, poses = np.random.default_rng(5), 6
    g = a_stretch(rng, poses)
    variables, held = _stretches.seen_in(g, 1, poses)
    assert not held
    H, b, total = dense(g, poses, variables, lost)
    if lost is not None:
        g.settings[[LOSS, SCALE]] = _factors.CAUCHY, lost
    m, n = 2 * len(variables), 3 * poses
    W, h, left = np.zeros((m, m)), np.zeros(m), np.zeros((poses, 3, 3))
    constant = _condensed.condense(g, 1, poses, variables, frame, False, W, h, left)
    gone = np.arange(n - 3 if frame else n)
    rest = np.arange(n, n + m)
    gain = H[np.ix_(rest, gone)] @ np.linalg.inv(H[np.ix_(gone, gone)])
    scale = np.abs(H).max()
    assert np.abs(W - (H[np.ix_(rest, rest)] - gain @ H[np.ix_(gone, rest)])).max() < 1e-6 * scale
    assert np.abs(h - (b[rest] - gain @ b[gone])).max() < 1e-6 * np.abs(b).max()
    assert constant == pytest.approx(total - b[gone] @ np.linalg.solve(H[np.ix_(gone, gone)], b[gone]), rel=1e-6)
    given = np.linalg.inv(H[:n, :n])
    for k in range(poses):
        block = given[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert np.abs(left[k] - block).max() < 1e-6 * np.abs(block).max()
    if not frame:  # moving all landmarks together changes nothing
        xy = g.values[variables, :2]
        together = np.stack((np.tile([1.0, 0.0], m // 2), np.tile([0.0, 1.0], m // 2), (xy[:, ::-1] * [-1, 1]).ravel()))
        assert np.abs(W @ together.T).max() < 1e-8 * scale


def test_a_submap_in_a_front_has_the_derivatives_of_its_part_of_the_cost() -> None:
    rng = np.random.default_rng(6)
    g = a_stretch(rng)
    variables, _ = _stretches.seen_in(g, 1, 6)
    m, pose = len(variables), int(g.at[6])
    W, h, left = np.zeros((2 * m, 2 * m)), np.zeros(2 * m), np.zeros((6, 3, 3))
    told = Condensed(variables, W, h, _condensed.condense(g, 1, 6, variables, True, False, W, h, left))
    submap = begun(pose, told, g.values[pose], g.values, left[-1], g.values[pose, :2])
    with_more, other = np.zeros((2 * m - 2, 2 * m - 2)), np.zeros(2 * m - 2)
    some = variables[:-1]
    for k in range(1, 7):  # a second stretch over the same steps, which does not see the last landmark
        rows = slice(g.variables[g.at[k], FIRST], g.variables[g.at[k], END])
        g.sightings[rows, LANDMARK][g.sightings[rows, LANDMARK] == variables[-1]] = -1
    constant = _condensed.condense(g, 1, 6, some, False, False, with_more, other, left)
    submap.add(Condensed(some, with_more, other, constant), g.values[pose], g.values)
    g = with_rows(g, "submaps", 1000)
    first = int(g.state[SIGHTINGS])
    g = with_rows(g, "sightings", first + m)
    g.sightings[first : first + m, LANDMARK], g.sightings[first : first + m, POSE] = variables, pose
    g.sightings[first : first + m, PART] = MEMBER
    g.variables[pose, FIRST], g.variables[pose, END], g.variables[pose, SUBMAP] = first, first + m, 1
    block = np.concatenate(([submap.constant], submap.stated.ravel(), submap.side, submap.information.ravel()))
    g.submaps[1 : 1 + len(block)] = block
    assert _factors.submap_cost(g, pose, g.values[pose], g.values) == pytest.approx(told.constant + constant, rel=1e-9)

    g.values[pose, :3] += 0.1 * rng.standard_normal(3)
    g.values[variables, :2] += 0.1 * rng.standard_normal((m, 2))
    size, places = 3 + 2 * m, rng.permutation(m + 1)  # landmarks before the pose and after it
    order, place = [pose, *variables.tolist()], 0
    for t in places:
        g.variables[order[t], PLACE] = place
        place += 3 if t == 0 else 2
    F = np.zeros(size * (size + 1))
    _factors.add_submap(g, pose, F, size + 1)
    rows = F.reshape(size, size + 1)
    assert np.array_equal(np.tril(rows[:, :size], -1), np.zeros((size, size)))
    found = np.triu(rows[:, :size]) + np.triu(rows[:, :size], 1).T
    where = np.concatenate([g.variables[v, PLACE] + np.arange(3 if v == pose else 2) for v in order])
    found, side = found[np.ix_(where, where)], rows[where, size]

    def y(v: Array) -> Array:
        c, s = np.cos(v[2]), np.sin(v[2])
        return ((v[3:].reshape(-1, 2) - v[:2]) @ np.array([[c, -s], [s, c]]) - submap.stated).ravel()

    v = np.concatenate((g.values[pose], g.values[variables, :2].ravel()))
    J = np.stack([(y(v + 1e-6 * e) - y(v - 1e-6 * e)) / 2e-6 for e in np.eye(size)], axis=1)
    assert np.abs(found - J.T @ submap.information @ J).max() < 1e-7 * np.abs(found).max()
    assert np.abs(side - J.T @ (submap.side - submap.information @ y(v))).max() < 1e-7 * np.abs(side).max()
    J_here = y(v) @ submap.information @ y(v) - 2 * submap.side @ y(v) + submap.constant
    assert _factors.submap_cost(g, pose, g.values[pose], g.values) == pytest.approx(J_here, rel=1e-9)


@pytest.mark.parametrize(("keep", "landmarks", "steps"), [(1e6, LANDMARKS, 1200), (10.0, 1000, 300)])
def test_it_is_the_exact_smoother_bit_for_bit_while_nothing_is_marginalised(
    keep: float, landmarks: int, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a stretch that is longer than the way; and where all stretches are new."""
    monkeypatch.setattr(keeping, "OFTEN", 50)
    log = city(Options(landmarks=landmarks, steps=steps), np.random.default_rng(0)).log
    (one, path), (other, there) = run("smoother", log, keep=keep), run("smoother", log)
    assert one.held == steps
    assert path.tobytes() == there.tobytes()
    ends = one.finish(), other.finish()
    assert ends[0].path.tobytes() == ends[1].path.tobytes()
    assert ends[0].cov.tobytes() == ends[1].cov.tobytes()
    assert ends[0].map.xy.tobytes() == ends[1].map.xy.tobytes()


def ends(g: Graph, last: int, length: float, longest: int, centres: Array) -> list[int]:
    """The ends of all stretches from step 0 on, by their definition."""
    places = g.steps[:, POINT : POINT + 2]

    def near(k: int) -> int:
        return int(np.hypot(*(centres - places[k]).T).argmin()) if len(centres) else -1

    def seen(first: int, last: int) -> int:
        poses = [int(v) for v in g.at[first : last + 1] if v >= 0]
        return len({int(i) for v in poses for i in g.sightings[g.variables[v, FIRST] : g.variables[v, END], LANDMARK]})

    out, start = list[int](), 0
    for k in range(last):
        far = np.hypot(*(places[k] - places[start]))
        elsewhere = far > _stretches.SHORT * length and near(k + 1) != near(start)
        if not (far > length or k - start + 1 >= longest or elsewhere):
            continue
        if min(g.at[k], g.at[k + 1]) >= 0 and seen(max(start, k - 4), k) >= 3 and seen(k + 1, min(k + 5, last)) >= 3:
            out.append(k)
            start = k + 1
    return out


@pytest.mark.parametrize("centres", [0, 1, 30])
def test_stretches_end_where_another_submap_is_nearer(centres: int) -> None:
    backend = make("smoother", a_city(7, 700).log.prior, keep=1e6)
    for step in a_city(7, 700).log:
        backend.step(step)
    g = backend._forest.g
    rng = np.random.default_rng(8)
    places = g.steps[:700, POINT : POINT + 2]
    around = rng.uniform(places.min(axis=0), places.max(axis=0), (centres, 2))
    for length, longest in ((15.0, 1000), (8.0, 1000), (1e3, 30)):
        found = _stretches.stretches(g, 0, 699, length, longest, around, False).tolist()
        assert found == ends(g, 699, length, longest, around)
        assert len(found) > 5
    alone = _stretches.stretches(g, 0, 699, 1e3, 1000, around, False)
    assert len(alone) == 0


class Watched(keeping.Keeping):
    """Lists the steps that are marginalised."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.gone = list[tuple[int, int]]()

    def _marginalise(self, gone: list[tuple[int, int]]) -> None:
        self.gone += [(int(self._numbers[a]), int(self._numbers[b])) for a, b in gone]
        super()._marginalise(gone)


def test_all_it_loses_is_the_motions_in_and_out_of_what_it_marginalises() -> None:
    """Its map is that of the exact smoother on the log without these motions, but for linearisation."""
    log = a_city(3).log
    backend = Watched(log.prior, keeping.Options(keep=10.0), np.random.default_rng(0))
    for step in log:
        backend.step(step)
    found = backend.finish()
    assert len(backend.gone) > 20
    covs = log.delta_cov.copy()
    for a, b in backend.gone:
        covs[[a, b + 1]] = np.diag([1e6, 1e6, 1e4])
    cut = final("smoother", replace(log, delta_cov=covs))
    rows = np.argsort(found.map.ids), np.argsort(cut.map.ids)
    assert np.array_equal(found.map.ids[rows[0]], cut.map.ids[rows[1]])
    off = (found.map.xy[rows[0]] - cut.map.xy[rows[1]]).ravel()
    scalars = (2 * rows[1][:, None] + np.arange(2)).ravel()
    sds = np.sqrt(cut.map.cov.diagonal()[scalars])
    assert np.abs(off / sds).max() < 0.2
    mine = found.map.cov.diagonal()[(2 * rows[0][:, None] + np.arange(2)).ravel()]
    assert np.abs(np.sqrt(mine) / sds - 1).max() < 0.05


@pytest.mark.parametrize("seeds", first_quick([range(2), range(2, 10)]))
def test_it_is_nearly_as_good_as_the_exact_smoother_and_honest(seeds: range) -> None:
    """Final errors after alignment, in the geometric mean; covariances as honest as the exact ones, in the mean."""
    errors, honest = list[Array](), list[Array]()
    for seed in seeds:
        made = a_city(seed)
        assert made.truth is not None
        truth = made.truth.poses
        ends = [final("smoother", made.log, keep=keep) for keep in (15.0, 0.0)]
        assert all(end.converged for end in ends)
        errors.append(np.log([aligned_error(end.path, truth) for end in ends]))
        honest.append(np.array([normalised(end.path.copy(), end.cov, truth) for end in ends]))
    bounded, exact = np.exp(np.mean(errors, axis=0))
    assert bounded < 1.1 * exact
    assert 0.5 < np.mean(honest, axis=0)[0] / np.mean(honest, axis=0)[1] < 2
    if len(seeds) >= 8:
        assert 0.5 < np.mean(honest, axis=0)[0] < 2


@pytest.mark.slow
def test_what_it_holds_does_not_grow_with_time() -> None:
    log = a_city(1, 9000).log
    backend = make("smoother", log.prior, keep=15.0)
    held, within = list[int](), list[int]()
    for step in log:
        backend.step(step)
        held.append(backend.held)
        within.append(sum(len(of.landmarks) for of in backend.submaps))
    assert max(held[5000:]) < 1.02 * max(held[1000:5000]) < 2000
    assert within[5000] > LANDMARKS
    assert within[-1] < 1.1 * within[5000]
    assert len(backend.submaps) < 40
    assert len(backend.finish().path) == 9000


def test_asking_changes_nothing() -> None:
    log = a_city(2, 1300).log
    plain, asked = (make("smoother", log.prior, keep=8.0) for _ in range(2))
    asking_changes_nothing(plain, asked, log)


@pytest.mark.slow
def test_ids_can_be_hidden() -> None:
    made = city(Options(landmarks=LANDMARKS, steps=STEP_COUNT, ids="hidden"), np.random.default_rng(4))
    assert made.truth is not None
    found = final("smoother", made.log, keep=15.0, association="jcbb")
    exact = final("smoother", made.log, association="jcbb")
    assert aligned_error(found.path, made.truth.poses) < 1.2 * aligned_error(exact.path, made.truth.poses)


def refused(prior: Prior, **options: Any) -> str:
    with pytest.raises(Unsuited) as error:
        make("smoother", prior, keep=5.0, **options)
    return str(error.value)


def test_what_it_does_not_take_is_said() -> None:
    log, truth = random_log(np.random.default_rng(0), 20, 5)
    assert truth is not None
    systematic = log.prior.systematic._replace(heading_offset=0.1)
    assert refused(log.prior._replace(fixes=True, systematic=systematic)) == (
        "keep=5 takes no constant error of a compass; keep=0 does, and so does fixed-lag, at a bounded cost"
    )
    assert "no given map" in refused(log.prior._replace(map=truth.map))
    assert "gyro=front" in refused(log.prior._replace(gyro=Bias(0.0, 0.1)))
    assert "no sightings that" in refused(log.prior._replace(partial=True))
