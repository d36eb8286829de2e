"""The EKF, dense and compressed, against the textbook filter of each kind, and against linear theory."""

from typing import Any

import numpy as np
import pytest

from driven import NO_LOOPS, asking_changes_nothing
from random_logs import TextbookKalman, random_log
from slamduel.backends.api import Diverged, TruthWanted, WantsTruth
from slamduel.backends.gaussian import _triangle, compressed
from slamduel.backends.gaussian.ekf import Ekf, Options, build
from slamduel.backends.gaussian.joint import Joint
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.core.factors import Log, Map, Odometry, Prior, RangeBearing, Step, Truth
from slamduel.core.kernels._blas import routine
from slamduel.core.se2 import Array, between, compose_jacobians, wrap
from slamduel.datasets.worlds.outliers import swapped
from tiers import first_quick

DENSE, COMPRESSED = 10**6, 0


@pytest.fixture(autouse=True)
def small_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part so small that it is settled with the rest every few steps."""
    monkeypatch.setattr(compressed, "MOST", 9)
    monkeypatch.setattr(compressed, "KEPT", 4)


def make(prior: Prior, truth: Truth | None = None, **options: Any) -> Ekf:
    backend = build.make(prior, Options(**options), np.random.default_rng(0))
    assert isinstance(backend, Ekf)
    assert isinstance(backend, WantsTruth)
    if truth is not None:
        assert backend.tell(truth) == (options.get("jacobians") == "ideal")
    return backend


def matched(log: Log, filters: list[Ekf], textbook: TextbookEkf, tolerance: float) -> int:
    """Take them through the log and compare all that they say; how many sightings were refused."""
    refused = 0
    for k, step in enumerate(log):
        expected = textbook.step(step)
        refused += textbook.refused
        for found in filters:
            pose, belief = found.step(step), found.belief()
            assert belief.cov is not None
            assert np.abs(pose - expected).max() < tolerance, k
            assert np.abs(belief.cov - textbook.cov[:3, :3]).max() < tolerance, k
            assert abs((belief.nis or 0.0) - textbook.nis) <= 1e-6 * (1 + textbook.nis), k
            assert (belief.nis_dof, belief.refused) == (textbook.nis_dof, textbook.refused), k
            assert np.array_equal(belief.cov, belief.cov.T)
        if k % 500 == 0 or k == len(log) - 1:
            for found in filters:
                agrees_on_the_map(found.map(), textbook, tolerance)
    return refused


def agrees_on_the_map(found: Map, textbook: TextbookEkf, tolerance: float) -> None:
    assert sorted(found.ids.tolist()) == sorted(textbook.ids)
    order = np.array([textbook.ids.index(landmark) for landmark in found.ids.tolist()], np.int64)
    rows = 3 + (2 * order[:, None] + [0, 1]).ravel()
    assert found.xy.ravel() == pytest.approx(textbook.mean[rows], abs=tolerance)
    assert found.cov is not None
    assert found.cov == pytest.approx(textbook.cov[np.ix_(rows, rows)], abs=tolerance)
    assert np.array_equal(found.cov, found.cov.T)
    np.linalg.cholesky(found.cov)


@pytest.mark.parametrize("update", first_quick(["sequential", "joint"]))
@pytest.mark.parametrize(
    ("jacobians", "steps"),
    first_quick([("standard", 1000), ("first-estimates", 1000), ("ideal", 1000), ("standard", 5000)], 3),
)
def test_it_is_the_textbook_filter(update: str, jacobians: str, steps: int) -> None:
    log, truth = random_log(np.random.default_rng(1), steps, 15, radius=3.5)
    told = truth if jacobians == "ideal" else None
    textbook = TextbookEkf(log.prior, together=update == "joint", jacobians=jacobians, truth=told)
    filters = [
        make(log.prior, truth, jacobians=jacobians, update=update, compress_above=above)
        for above in (DENSE, COMPRESSED)
    ]
    matched(log, filters, textbook, 1e-9)


@pytest.mark.parametrize("update", ["sequential", "joint"])
def test_the_gate_is_the_textbooks_and_bears_wrong_ids(update: str) -> None:
    clean, truth = random_log(np.random.default_rng(2), 600, 15, radius=4.0)
    assert truth is not None
    log = swapped(clean, truth, 0.08, np.random.default_rng(3)).log
    threshold = -2 * np.log(1 - 0.999)
    textbook = TextbookEkf(log.prior, together=update == "joint", gate=threshold, confirm=2)
    options: dict[str, Any] = {"gate": 0.999, "gate_after": 2, "update": update}
    filters = [make(log.prior, **options, compress_above=above) for above in (DENSE, COMPRESSED)]
    assert matched(log, filters, textbook, 1e-9) > 50
    paths = {
        name: np.array([backend.step(step) for step in of])
        for name, backend, of in (
            ("clean", make(log.prior), clean),
            ("gated", make(log.prior, **options), log),
            ("plain", make(log.prior), log),
        )
    }
    error = {n: np.sqrt(((p - truth.poses)[:, :2] ** 2).sum(1).mean()) for n, p in paths.items()}
    assert error["gated"] < 1.5 * error["clean"]
    assert error["plain"] > 5 * error["clean"]


def sighting(landmark: int, r: float, bearing: float) -> RangeBearing:
    return RangeBearing(np.array([landmark]), np.array([[r, bearing]]), np.diag([1e-4, 1e-4])[None])


def test_a_wrong_first_sighting_is_replaced_and_a_wrong_later_one_refused() -> None:
    prior = Prior(np.zeros(3), 1e-6 * np.eye(3))
    backend = make(prior, gate=0.999, gate_after=2)
    still = Odometry(np.zeros(3), 1e-8 * np.eye(3))

    def see(r: float) -> tuple[int, int, float]:
        pose = backend.step(Step(0.0, still, sighting(7, r, 0.0), NO_LOOPS))
        assert np.abs(pose).max() < 0.02  # nothing wrong has moved the robot
        belief = backend.belief()
        return belief.nis_dof, belief.refused, round(float(backend.map().xy[0, 0]), 1)

    assert see(5.0) == (0, 0, 5.0)  # wrong, and nobody can know
    assert see(2.0) == (0, 0, 2.0)  # replaces it
    assert see(2.0) == (2, 0, 2.0)
    assert see(2.01) == (2, 0, 2.0)  # confirmed
    assert see(5.0) == (0, 1, 2.0)  # refused
    assert see(2.0) == (2, 0, 2.0)


def test_a_right_sighting_passes_as_often_as_the_gate_says() -> None:
    """The share refused of some 10,000: a binomial's six standard deviations around 0.05."""
    log = random_log(np.random.default_rng(4), 2500, 10, blind=0.0).log
    backend = make(log.prior._replace(map=None), gate=0.95, gate_after=0)
    refused = used = 0
    for step in log:
        backend.step(step)
        refused += backend.belief().refused
        used += backend.belief().nis_dof // 2
    share = refused / (refused + used)
    assert share == pytest.approx(0.05, abs=6 * np.sqrt(0.05 * 0.95 / (refused + used)) + 0.005)  # and a nonlinear bit


def test_ideal_jacobians_make_it_the_kalman_filter() -> None:
    """Linearised at the truth a log with errors of 1e-7 is linear to 1e-13: its errors are a Kalman filter's."""
    log, truth = random_log(np.random.default_rng(5), 60, 6, noise=1e-6)
    place = dict(zip(truth.map.ids.tolist(), truth.map.xy, strict=True))
    mine = make(log.prior, truth, jacobians="ideal", update="joint", compress_above=COMPRESSED)
    kalman = TextbookKalman(off(log.prior.pose, truth.poses[0]), log.prior.cov)  # of errors: pose, then landmarks
    slots: dict[int, int] = {}
    for k, step in enumerate(log):
        pose = mine.step(step)
        at, n = truth.poses[k], len(kalman.mean)
        if step.odometry is not None:
            by_pose, by_delta = compose_jacobians(truth.poses[k - 1], step.odometry.delta)
            by_pose[:2, 2] = [-(at - truth.poses[k - 1])[1], (at - truth.poses[k - 1])[0]]
            F, Q, u = np.eye(n), np.zeros((n, n)), np.zeros(n)
            F[:3, :3], Q[:3, :3] = by_pose, by_delta @ step.odometry.cov @ by_delta.T
            u[:3] = by_delta @ off(step.odometry.delta, between(truth.poses[k - 1], at))
            kalman.predict(F, Q, u)
        new: list[tuple[int, Array, Array, Array, Array]] = []
        for landmark, z, R in zip(step.sightings.ids.tolist(), *step.sightings[1:], strict=True):
            dx, dy = place[landmark] - at[:2]
            q = dx * dx + dy * dy
            by_m = np.array([[dx / np.sqrt(q), dy / np.sqrt(q)], [-dy / q, dx / q]])
            by_p = np.column_stack((-by_m, [0.0, -1.0]))
            error = off(z, np.array([np.sqrt(q), np.arctan2(dy, dx) - at[2]]))
            if landmark not in slots:
                new.append((landmark, error, R, by_p, by_m))
                continue
            j = slots[landmark]
            H = np.zeros((2, n))
            H[:, :3], H[:, j : j + 2] = by_p, by_m
            kalman.update(error, H, R)
        for landmark, error, cov, by_p, by_m in new:  # m = inverse(by_m) (z - by_p pose)
            n = slots[landmark] = len(kalman.mean)
            A = np.vstack((np.eye(n), np.zeros((2, n))))
            A[n:, :3] = -np.linalg.solve(by_m, by_p)
            inverse, noise = np.linalg.inv(by_m), np.zeros((n + 2, n + 2))
            noise[n:, n:] = inverse @ cov @ inverse.T
            kalman.predict(A, noise, np.concatenate((np.zeros(n), inverse @ error)))
        assert off(pose, at) == pytest.approx(kalman.mean[:3], abs=1e-12)
        assert mine.belief().cov == pytest.approx(kalman.cov[:3, :3], abs=1e-12 * 1e-12)
    found = mine.map()
    assert found.ids.tolist() == list(slots)
    errors = found.xy - np.array([place[landmark] for landmark in slots])
    assert np.abs(errors).max() > 1e-9  # there is something to agree on
    assert errors.ravel() == pytest.approx(kalman.mean[3:], abs=1e-12)
    assert found.cov == pytest.approx(kalman.cov[3:, 3:], abs=1e-12 * 1e-12)


def off(found: Array, centre: Array) -> Array:
    """found - centre, of a pose or a sighting, the angle wrapped."""
    return np.array([*(found - centre)[:-1], float(wrap(found[-1] - centre[-1]))])


@pytest.mark.parametrize("above", [DENSE, COMPRESSED])
def test_a_map_with_its_covariance_is_the_textbooks_prior(above: int) -> None:
    log, truth = random_log(np.random.default_rng(6), 200, 12)
    n = len(truth.map.ids)
    root = np.random.default_rng(7).normal(size=(2 * n, 2 * n))
    for cov in (1e-4 * (root @ root.T + np.eye(2 * n)), None):
        prior = log.prior._replace(map=Map(truth.map.ids[::-1], truth.map.xy[::-1], cov))
        mine, textbook = make(prior, compress_above=above), TextbookEkf(prior)
        for step in log:
            assert mine.step(step) == pytest.approx(textbook.step(step), abs=1e-9)
        found = mine.map()
        assert found.ids.tolist() == textbook.ids
        assert found.xy.ravel() == pytest.approx(textbook.mean[3:], abs=1e-9)
        assert found.cov == pytest.approx(textbook.cov[3:, 3:], abs=1e-9)
        if cov is None:
            assert np.array_equal(found.xy, truth.map.xy[::-1])


def test_asking_for_the_map_changes_no_later_bit() -> None:
    log = random_log(np.random.default_rng(8), 300, 20, radius=3.0).log
    asked, left = (make(log.prior, gate=0.99, compress_above=COMPRESSED) for _ in range(2))
    asking_changes_nothing(left, asked, log)


def test_a_frame_of_very_many_new_landmarks_and_its_second_sight() -> None:
    """More landmarks than a part holds, more sightings than may be owed, a growth of the vectors."""
    rng = np.random.default_rng(9)
    k = 80
    z = np.column_stack((rng.uniform(2, 30, k), rng.uniform(-3, 3, k)))
    seen = RangeBearing(rng.permutation(k), z, np.tile(np.diag([1e-2, 1e-4]), (k, 1, 1)))
    ahead = Odometry(np.array([0.0, 0.0, 0.1]), 1e-4 * np.eye(3))
    again = seen._replace(z=z - [0, 0.1])
    prior = Prior(np.zeros(3), 1e-4 * np.eye(3))
    steps = [Step(float(i), ahead if i else None, again if i else seen, NO_LOOPS) for i in range(2)]
    paths = []
    for above in (DENSE, COMPRESSED):
        mine, textbook = make(prior, compress_above=above), TextbookEkf(prior)
        for step in steps:
            paths.append(mine.step(step))
            assert paths[-1] == pytest.approx(textbook.step(step), abs=1e-9)
        agrees_on_the_map(mine.map(), textbook, 1e-9)


def test_frames_in_turn_with_many_and_few_do_not_update_the_rest_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty of a map's landmarks, and five of the others, in turn: without the twenty a part has room for nine."""
    rng = np.random.default_rng(10)
    root, xy, noise = rng.normal(size=(120, 120)), rng.uniform(-20, 20, (60, 2)), np.diag([1e-2, 1e-4])
    z = np.column_stack((np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0]))) + rng.normal(size=(60, 2)) * [0.1, 0.01]
    known = Map(np.arange(60), xy, 1e-4 * (root @ root.T))
    prior = Prior(np.zeros(3), 1e-4 * np.eye(3), known)
    mine, textbook = make(prior, compress_above=COMPRESSED), TextbookEkf(prior)
    updates, settle = list[int](), compressed.Active.settle_with

    def counted(part: compressed.Active, whole: Joint) -> None:
        updates.append(part.pairs)
        settle(part, whole)

    monkeypatch.setattr(compressed.Active, "settle_with", counted)
    for k in range(40):
        rows = np.arange(20) if k % 2 else 20 + 5 * (k % 8) + np.arange(5)
        seen = RangeBearing(rows, z[rows], np.tile(noise, (len(rows), 1, 1)))
        assert mine.step(Step(float(k), None, seen, NO_LOOPS)) == pytest.approx(
            textbook.step(Step(float(k), None, seen, NO_LOOPS)), abs=1e-9
        )
    assert len(updates) <= 10
    agrees_on_the_map(mine.map(), textbook, 1e-9)


@pytest.mark.parametrize("n", [2, 40, 1016, 1018, 2500])
def test_the_triangle_is_a_symmetric_matrix(n: int) -> None:
    """Rows in and out, and both corrections, over up to three panels, against the matrix in full."""
    rng = np.random.default_rng(n)
    full = rng.normal(size=(n, n))
    full = full + full.T
    flat = np.zeros(0)
    for so_far in range(0, n + 1, 500):  # grown as a map grows
        flat.resize(_triangle.space(max(so_far, n if so_far + 500 > n else 0)), refcheck=False)
    _triangle.store(flat, full)
    W, M, out, rows = rng.normal(size=(9, n + 5)), rng.normal(size=(7, n)), np.empty((n, n)), np.empty((2, n))
    dgemm, dsyrk = routine("dgemm"), routine("dsyrk")
    _triangle.add_square_of(flat, n, -1.0, W, 8, dgemm, dsyrk)
    full -= W[:8, :n].T @ W[:8, :n]
    _triangle.add_square_of(flat, n, 1.0, W[6:], 3, dgemm, dsyrk)
    full += W[6:, :n].T @ W[6:, :n]
    psi = np.diag(np.arange(1.0, 8))
    _triangle.subtract_product(flat, n, M, psi @ M, dgemm)
    full -= M.T @ psi @ M
    at = min(2 * (n // 3), n - 2)
    new = rng.normal(size=(2, n))
    new[0, at + 1] = new[1, at]
    _triangle.put(flat, at, n, new)
    full[at : at + 2] = new
    full[:, at : at + 2] = new.T
    _triangle.whole(flat, n, out)
    assert np.allclose(out, full, rtol=0, atol=1e-10)
    for i in (0, at, n - 2):
        _triangle.take(flat, i, n, rows)
        assert np.array_equal(rows, out[i : i + 2])


def test_ideal_needs_the_truth_of_every_step_and_landmark() -> None:
    log, truth = random_log(np.random.default_rng(10), 20, 5)
    assert truth is not None
    assert not make(log.prior).tell(truth)
    cases = [
        (None, "--oracle"),
        (truth._replace(t=truth.t[:-3], poses=truth.poses[:-3]), "t = 1.7 s"),
        (truth._replace(map=Map(truth.map.ids[:-1], truth.map.xy[:-1], None)), f"none of {truth.map.ids[-1]}"),
    ]
    for told, said in cases:
        backend = make(log.prior, told, jacobians="ideal")
        with pytest.raises(TruthWanted, match=said):
            follow(backend, log)


def follow(backend: Ekf, log: Log) -> None:
    for step in log:
        backend.step(step)


def test_a_landmark_at_the_robot_and_an_impossible_covariance_are_named() -> None:
    prior = Prior(np.zeros(3), 1e-6 * np.eye(3), Map(np.array([4]), np.zeros((1, 2)), None))
    with pytest.raises(Diverged, match="landmark 4 lies at the robot"):
        make(prior).step(Step(0.0, None, sighting(4, 1.0, 0.0), NO_LOOPS))
    backend = make(prior._replace(map=None))
    backend.step(Step(0.0, None, sighting(5, 1.0, 0.0), NO_LOOPS))
    bad = sighting(5, 1.0, 0.0)._replace(cov=-np.eye(2)[None])
    with pytest.raises(Diverged, match="landmark 5 is not positive definite"):
        backend.step(Step(1.0, None, bad, NO_LOOPS))
