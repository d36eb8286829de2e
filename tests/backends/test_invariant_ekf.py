"""The invariant EKF against one written with whole matrices of the group, and against what invariance promises."""

from typing import Any

import numpy as np
import pytest

from dense_invariant import DenseInvariantEkf, turning
from driven import asking_changes_nothing
from random_logs import random_log
from slamduel.backends.api import Diverged
from slamduel.backends.gaussian import _triangle
from slamduel.backends.invariant import _invariant
from slamduel.backends.invariant._arrays import GroupArrays
from slamduel.backends.invariant.invariant_ekf import InvariantEkf, Options
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.core.factors import Log, Map, Prior, RangeBearing
from slamduel.core.kernels._blas import routine
from slamduel.core.se2 import Array, compose, wrap
from tiers import first_quick


def make(prior: Prior) -> InvariantEkf:
    return InvariantEkf(prior, Options(), np.random.default_rng(0))


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


def test_the_joint_covariance_of_some_landmarks_is_a_part_of_that_of_all() -> None:
    """Whatever is owed, from sightings and from turns, and in any order of the landmarks."""
    log, rng = random_log(np.random.default_rng(4), 150, 12, radius=4.0).log, np.random.default_rng(1)
    ours: Any = make(log.prior)
    dense, owed = DenseInvariantEkf(log.prior), set[tuple[bool, bool]]()
    for step in log:
        ours.step(step)
        dense.step(step)
        some = rng.permutation(len(dense.ids))[:5]
        entries = np.concatenate([3 + np.stack((2 * some, 2 * some + 1), axis=1).ravel(), [1, 2, 0]])
        plain = dense.plain()
        _, at, cov = ours._group.marginals(np.array([ours._slot[dense.ids[k]] for k in some]))
        assert at == pytest.approx(dense.state[:2, 3:].T[some], abs=1e-9)
        assert cov == pytest.approx((plain @ dense.cov @ plain.T)[np.ix_(entries, entries)], abs=1e-9)
        owed.add((bool(ours._group.owing[0]), bool(ours._group.owing[1])))
    assert len(owed) > 2


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


@pytest.mark.parametrize(("n", "sighted", "turned"), first_quick([(2, 2, 0), (8, 0, 3), (40, 10, 9), (1100, 40, 8)], 3))
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
    belief = GroupArrays(
        pose=np.zeros(3), mean=np.zeros(n), strip=np.zeros((3, n + 3)), flat=flat, owed=owed, owing=owing,
        known=np.zeros((0, 2)), origin=np.zeros(2), blas=np.array([routine("dgemm"), routine("dsyrk")]),
    )  # fmt: skip
    _invariant.gather(belief, n, at, rows)
    assert rows == pytest.approx(expected[at : at + 2], abs=1e-12)
    _invariant.fold(belief, n)
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
