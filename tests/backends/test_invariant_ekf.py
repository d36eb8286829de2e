"""The invariant EKF against one written with whole matrices of the group, and against what invariance promises."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from driven import asking_changes_nothing
from random_logs import random_log
from slamduel.backends._blas import routine
from slamduel.backends.api import Diverged
from slamduel.backends.gaussian import _invariant, _triangle
from slamduel.backends.gaussian.invariant_ekf import InvariantEkf
from slamduel.bench.speed.textbook_ekf import TextbookEkf
from slamduel.frontend.factors import Log, Map, Odometry, Prior, RangeBearing, Step
from slamduel.frontend.options import NoOptions
from slamduel.frontend.se2 import Array, compose, wrap


def turning(angle: Any) -> Any:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def hat(xi: Any) -> Any:
    """xi (3 + 2N,) = (heading, position, landmarks) in the Lie algebra of SE_{N+1}(2)."""
    m = (len(xi) - 1) // 2
    out = np.zeros((2 + m, 2 + m), np.result_type(xi))
    out[0, 1], out[1, 0] = -xi[0], xi[0]
    out[:2, 2:] = xi[1:].reshape(m, 2).T
    return out


def derivative(function: Callable[[Any], Any], n: int) -> Array:
    """d function / d x (., n) at zero, by complex steps: exact to rounding."""
    return np.stack([np.imag(function(1e-30j * e)) / 1e-30 for e in np.eye(n)], axis=-1)


class DenseInvariantEkf:
    """RI-EKF SLAM of Zhang et al. (2017) in the plane: the state is a matrix X of the group, the truth exp(xi) X.

    Every Jacobian is the derivative of what the paper differentiates; nothing is simplified.
    """

    def __init__(self, prior: Prior) -> None:
        xy, self.ids = np.zeros((0, 2)), list[int]()
        given = np.zeros((0, 0))
        if prior.map is not None:
            xy, self.ids = prior.map.xy, prior.map.ids.tolist()
            given = np.zeros((xy.size, xy.size)) if prior.map.cov is None else prior.map.cov
        self.state = np.eye(3 + len(xy))
        self.state[:2, :2] = turning(prior.pose[2])
        self.state[:2, 2], self.state[:2, 3:] = prior.pose[:2], xy.T
        plain = np.zeros((3 + xy.size, 3 + xy.size))
        plain[np.ix_([1, 2, 0], [1, 2, 0])] = prior.cov
        plain[3:, 3:] = given
        back = np.linalg.inv(self.plain())
        self.cov = back @ plain @ back.T
        self.nis = 0.0

    def plain(self) -> Array:
        """The plain error of heading, position and landmarks by xi."""
        n = 1 + 2 * (self.state.shape[0] - 2)

        def moved(xi: Any) -> Any:
            X = self.state + hat(xi) @ self.state
            return np.concatenate(([xi[0]], X[:2, 2:].T.ravel()))

        return derivative(moved, n)

    def step(self, step: Step) -> Array:
        if step.odometry is not None:
            self.move(step.odometry)
        self.nis = 0.0
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark in self.ids:
                self.correct(3 + self.ids.index(landmark), z, R)
            else:
                self.add(landmark, z, R)
        return np.array([*self.state[:2, 2], np.arctan2(self.state[1, 0], self.state[0, 0])])

    def move(self, odometry: Odometry) -> None:
        def after(noise: Any) -> Any:
            X = self.state.astype(complex)
            X[:2, 2] += self.state[:2, :2] @ (odometry.delta[:2] + noise[:2])
            X[:2, :2] = self.state[:2, :2] @ turning(odometry.delta[2] + noise[2])
            return X

        X = np.real(after(np.zeros(3)))
        inverse = np.linalg.inv(X)

        def xi(noise: Any) -> Any:  # of what is true in terms of what is predicted
            error = after(noise) @ inverse
            return np.concatenate(([error[1, 0]], error[:2, 2:].T.ravel()))

        G = derivative(xi, 3)
        self.state, self.cov = X, self.cov + G @ odometry.cov @ G.T

    def correct(self, column: int, z: Array, R: Array) -> None:
        def seen(X: Any) -> Any:
            x, y = X[:2, :2].T @ (X[:2, column] - X[:2, 2])
            return np.array([np.sqrt(x * x + y * y), np.arctan(y / x) if abs(x) > abs(y) else -np.arctan(x / y)])

        H = derivative(lambda xi: seen(self.state + hat(xi) @ self.state), len(self.cov))
        x, y = self.state[:2, :2].T @ (self.state[:2, column] - self.state[:2, 2])
        nu = np.array([z[0] - np.hypot(x, y), wrap(z[1] - np.arctan2(y, x))])
        S = H @ self.cov @ H.T + R
        K = self.cov @ H.T @ np.linalg.inv(S)
        self.state = expm(hat(K @ nu)) @ self.state
        self.cov = (np.eye(len(self.cov)) - K @ H) @ self.cov
        self.nis += nu @ np.linalg.inv(S) @ nu

    def add(self, landmark: int, z: Array, R: Array) -> None:
        m, n = len(self.state), len(self.cov)

        def grown(error: Any) -> Any:  # xi of what is there, then the sighting's noise
            X = np.eye(m + 1, dtype=complex)
            X[:m, :m] = self.state + hat(error[:n]) @ self.state
            r, bearing = z[0] + error[n], z[1] + error[n + 1]
            X[:2, m] = X[:2, 2] + X[:2, :2] @ np.array([r * np.cos(bearing), r * np.sin(bearing)])
            return X

        X = np.real(grown(np.zeros(n + 2)))
        inverse = np.linalg.inv(X)

        def xi(error: Any) -> Any:
            off = grown(error) @ inverse
            return np.concatenate(([off[1, 0]], off[:2, 2:].T.ravel()))

        J = derivative(xi, n + 2)
        both = np.zeros((n + 2, n + 2))
        both[:n, :n], both[n:, n:] = self.cov, R
        self.state, self.cov = X, J @ both @ J.T
        self.ids.append(landmark)


def make(prior: Prior) -> InvariantEkf:
    return InvariantEkf(prior, NoOptions(), np.random.default_rng(0))


def path(log: Log) -> tuple[Array, InvariantEkf]:
    backend = make(log.prior)
    return np.array([backend.step(step) for step in log]), backend


def agree(log: Log) -> None:
    """Path, belief, NIS and map are those of whole matrices."""
    ours, dense = make(log.prior), DenseInvariantEkf(log.prior)
    for k, step in enumerate(log):
        pose, expected = ours.step(step), dense.step(step)
        assert pose[:2] == pytest.approx(expected[:2], abs=1e-9)
        assert abs(wrap(pose[2] - expected[2])) < 1e-9
        assert (ours.belief().nis or 0.0) == pytest.approx(dense.nis, abs=1e-9, rel=1e-7)
        if k % 50 == 0 or k == len(log) - 1:
            plain = dense.plain()
            cov, found = plain @ dense.cov @ plain.T, ours.map()
            assert ours.belief().cov == pytest.approx(cov[np.ix_([1, 2, 0], [1, 2, 0])], abs=1e-9)
            assert found.ids.tolist() == dense.ids
            assert found.xy == pytest.approx(dense.state[:2, 3:].T, abs=1e-9)
            assert found.cov == pytest.approx(cov[3:, 3:], abs=1e-9)


def given(log: Log, cov: Array | None, off: float = 0.0) -> Log:
    """The log with a given map of half of its landmarks."""
    _, filtered = path(log)
    found = filtered.map()
    half = Map(found.ids[::2], found.xy[::2] + off, cov)
    return Log.from_steps("given", log.prior._replace(map=half), list(log))


def test_it_is_the_papers_filter() -> None:
    agree(random_log(np.random.default_rng(2), 1000, 6, radius=4.0).log)


@pytest.mark.slow
def test_a_map_that_outgrows_its_room_and_frames_that_outgrow_what_may_be_owed() -> None:
    log = random_log(np.random.default_rng(3), 12, 60, radius=30.0).log
    assert max(len(step.sightings.ids) for step in log) > _invariant.RANK / 2
    agree(log)


@pytest.mark.parametrize("fixed", [True, False])
def test_localisation_on_a_given_map(fixed: bool) -> None:
    """Also a map held fixed is exact: left out of the state, it does what its full covariance would do in it."""
    log = random_log(np.random.default_rng(4), 150, 6, radius=8.0).log
    root = 0.1 * np.tril(np.random.default_rng(5).standard_normal((6, 6))) + 0.05 * np.eye(6)
    agree(given(log, None if fixed else root @ root.T, 0.0 if fixed else 0.05))


def test_a_map_held_fixed_stays_where_it_is() -> None:
    log = given(random_log(np.random.default_rng(6), 100, 8, radius=8.0).log, None)
    _, backend = path(log)
    m = len(log.prior.map.ids)
    found = backend.map()
    assert found.xy[:m] == pytest.approx(log.prior.map.xy, abs=1e-14)
    assert len(found.ids) > m
    assert not found.cov[: 2 * m].any()
    assert np.linalg.eigvalsh(found.cov[2 * m :, 2 * m :])[0] > 0


def test_a_world_put_elsewhere_is_the_same_world() -> None:
    """A rigid motion of the prior moves the path, the map and their covariances, and changes nothing else."""
    log = random_log(np.random.default_rng(7), 200, 8).log
    motion = np.array([30.0, -40.0, 2.0])
    M = np.eye(3)
    M[:2, :2] = turning(motion[2])
    moved = Prior(compose(motion, log.prior.pose), M @ log.prior.cov @ M.T)
    here, before = path(log)
    there, after = path(Log.from_steps("moved", moved, list(log)))
    expected = compose(motion, here)
    assert there[:, :2] == pytest.approx(expected[:, :2], abs=1e-9)
    assert np.abs(wrap(there[:, 2] - expected[:, 2])).max() < 1e-11
    cov = before.belief().cov
    assert cov is not None
    assert after.belief().cov == pytest.approx(M @ cov @ M.T, abs=1e-11)
    assert after.map().xy == pytest.approx(before.map().xy @ M[:2, :2].T + motion[:2], abs=1e-9)


def test_what_cannot_be_observed_teaches_nothing() -> None:
    """Zhang et al.: where the whole world might be moved and turned, the estimates do not depend on how sure one is.

    The plain EKF's do: it believes to learn its heading from relinearised sightings.
    """
    log = random_log(np.random.default_rng(8), 200, 8).log
    vague = Log.from_steps("vague", log.prior._replace(cov=np.diag([4.0, 9.0, 0.5])), list(log))
    (sure_path, sure), (vague_path, unsure) = path(log), path(vague)
    assert vague_path == pytest.approx(sure_path, abs=1e-9)
    assert unsure.map().xy == pytest.approx(sure.map().xy, abs=1e-9)
    ekfs = [TextbookEkf(each.prior) for each in (log, vague)]
    apart = max(float(np.abs(ekfs[0].step(step) - ekfs[1].step(step))[:2].max()) for step in log)
    assert apart > 1e-3


def test_its_belief_is_the_ekfs_where_models_are_straight_enough() -> None:
    log = random_log(np.random.default_rng(9), 150, 8, noise=1e-3).log
    backend, ekf = make(log.prior), TextbookEkf(log.prior)
    for step in log:
        assert backend.step(step)[:2] == pytest.approx(ekf.step(step)[:2], abs=1e-6)
        cov = backend.belief().cov
        assert cov == pytest.approx(ekf.cov[:3, :3], abs=1e-3 * np.abs(ekf.cov[:3, :3]).max())
    assert backend.map().cov == pytest.approx(ekf.cov[3:, 3:], abs=1e-3 * np.abs(ekf.cov).max())


@pytest.mark.parametrize(("n", "sighted", "turned"), [(2, 2, 0), (8, 0, 3), (1100, 40, 8), (40, 10, 9)])
def test_what_is_owed_is_added(n: int, sighted: int, turned: int) -> None:
    """Sightings' rows, from the first on, are taken off, turns', up to the last, are added; those between are not."""
    rng = np.random.default_rng(n)
    owed = rng.standard_normal((_invariant.RANK, n + 2))
    sign = np.concatenate((np.full(sighted, -1.0), np.zeros(_invariant.RANK - sighted - turned), np.ones(turned)))
    symmetric = rng.standard_normal((n, n))
    symmetric += symmetric.T
    expected = symmetric + (owed[:, :n].T * sign) @ owed[:, :n]
    flat, owing = _triangle.grown(np.zeros(0), n), np.array([sighted, turned])
    _triangle.store(flat, symmetric)
    rows, found = np.empty((2, n)), np.empty((n, n))
    at = n // 4 * 2
    _invariant.gather(flat, n, at, owed, owing, rows)
    assert rows == pytest.approx(expected[at : at + 2], abs=1e-12)
    _invariant.fold(flat, n, owed, owing, routine("dgemm"), routine("dsyrk"))
    _triangle.whole(flat, n, found)
    assert found == pytest.approx(expected, abs=1e-12)
    assert not owing.any()


def test_a_map_that_is_asked_for_changes_nothing() -> None:
    """Whatever is owed at the time: not a bit of the path, the beliefs or the last map."""
    log = random_log(np.random.default_rng(12), 60, 30, radius=20.0).log
    asked, left = make(log.prior), make(log.prior)
    asking_changes_nothing(left, asked, log)


def test_turns_alone_may_be_all_that_is_owed() -> None:
    """More motions than may be owed, with nothing in sight, then sightings again."""
    log = random_log(np.random.default_rng(13), _invariant.RANK + 20, 6, radius=4.0).log
    blind = [
        step._replace(sightings=RangeBearing(step.sightings.ids[:0], step.sightings.z[:0], step.sightings.cov[:0]))
        if 3 <= k < _invariant.RANK + 10
        else step
        for k, step in enumerate(log)
    ]
    agree(Log.from_steps("blind", log.prior, blind))


def test_numbers_that_left_their_domain_end_it() -> None:
    log = random_log(np.random.default_rng(11), 5, 8, radius=8.0, blind=0.0).log
    here = Map(log[0].sightings.ids, np.tile(log.prior.pose[:2], (len(log[0].sightings.ids), 1)), None)
    with pytest.raises(Diverged, match="the robot's own position"):
        make(log.prior._replace(map=here)).step(log[0])
    backend = make(log.prior)
    backend.step(log[0])
    sightings = log[1].sightings
    with pytest.raises(Diverged, match="innovation"):
        backend.step(log[1]._replace(sightings=sightings._replace(cov=-1e3 * sightings.cov)))
