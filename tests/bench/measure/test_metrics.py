"""The judges: closed forms against brute force and evo, consistency against what chi-square promises."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import chdtri

from random_logs import random_covariance
from slamduel.bench.measure import accuracy, nees
from slamduel.core.factors import Map
from slamduel.core.se2 import Array, compose


def wander(rng: np.random.Generator, n: int = 60) -> Array:
    poses = np.cumsum(rng.normal(size=(n, 3)), axis=0)
    poses[:, 2] = rng.uniform(-np.pi, np.pi, n)
    return poses


def moved(motion: Array, poses: Array) -> Array:
    return compose(np.broadcast_to(motion, poses.shape), poses)


def test_alignment_undoes_a_rigid_motion() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        truth = wander(rng)
        estimate = moved(rng.normal(size=3) * 2, truth)
        alignment = accuracy.align(estimate, truth)
        assert not alignment.translation_only
        assert accuracy.ate(accuracy.aligned(alignment, estimate), truth) == pytest.approx(0, abs=1e-12)


def test_no_proper_motion_of_the_plane_is_better_than_the_alignment() -> None:
    """Also for a mirrored path, which a flip out of the plane would lay on the truth: a plane has no such motion."""
    rng = np.random.default_rng(2)
    truth = wander(rng)
    for estimate in (truth + rng.normal(size=truth.shape), truth * (1, -1, 1)):
        ours = accuracy.ate(accuracy.aligned(accuracy.align(estimate, truth), estimate), truth)
        starts = [(0, 0, a) for a in np.linspace(-3, 3, 7)]
        best = min(minimize(lambda m, e=estimate: accuracy.ate(moved(m, e), truth), x0=start).fun for start in starts)
        assert ours == pytest.approx(best, abs=1e-5)
    assert ours > 1  # the mirrored one keeps its error


def test_a_straight_and_a_standing_path_are_only_shifted() -> None:
    rng = np.random.default_rng(3)
    line = np.zeros((30, 3))
    line[:, 0] = np.linspace(0, 10, 30)
    for truth in (line, moved(np.array([1.0, 2.0, 0.3]), line), np.zeros((30, 3))):
        estimate = truth + 0.1 * rng.normal(size=truth.shape)
        alignment = accuracy.align(estimate, truth)
        assert alignment.translation_only
        assert alignment.motion == pytest.approx([*(truth - estimate).mean(axis=0)[:2], 0])


def test_heading_error_goes_the_short_way_round() -> None:
    a, b = np.zeros((2, 3)), np.zeros((2, 3))
    a[:, 2], b[:, 2] = np.pi - 0.1, -np.pi + 0.1
    assert accuracy.heading_error(a, b) == pytest.approx(0.2)


def test_map_error_is_of_the_shared_landmarks_after_the_alignment() -> None:
    truth = Map(np.array([1, 2, 3]), np.array([[0.0, 0], [1, 0], [0, 1]]), None)
    quarter = accuracy.Alignment(np.array([0.0, 0.0, np.pi / 2]), False)
    estimate = Map(np.array([3, 9, 2]), np.array([[1.0, 0.3], [5, 5], [0.0, -1.4]]), None)
    assert accuracy.map_rmse(estimate, truth, quarter) == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 2))
    assert accuracy.map_rmse(estimate._replace(ids=np.array([7, 8, 9])), truth, quarter) is None


def test_nees_of_true_covariances_is_chi_square() -> None:
    rng = np.random.default_rng(5)
    n = 4000
    truth = wander(rng, n)
    covs = np.array([random_covariance(rng, (0.1, 0.2, 0.05)) for _ in range(n)])
    estimate = np.array([rng.multivariate_normal(p, c) for p, c in zip(truth, covs, strict=True)])
    values = nees.nees(estimate, covs, truth)
    assert values.mean() == pytest.approx(3, abs=6 * np.sqrt(6 / n))  # 6 sigma: the variance of chi-square(3) is 6
    inside = (values <= nees.INSIDE_95[3]).mean()
    assert inside == pytest.approx(0.95, abs=6 * np.sqrt(0.95 * 0.05 / n))


def test_the_bounds_are_chi_squares() -> None:
    dof = np.array(list(nees.INSIDE_95))
    np.testing.assert_allclose(list(nees.INSIDE_95.values()), chdtri(dof, 0.05), rtol=1e-14)


def test_nees_is_blank_where_there_is_no_covariance_to_divide_by() -> None:
    covs = np.array([np.eye(3), np.full((3, 3), np.nan), np.diag([1.0, 1, 0])])
    values = nees.nees(np.ones((3, 3)), covs, np.zeros((3, 3)))
    assert values[0] == pytest.approx(3)
    assert np.isnan(values[1:]).all()


@pytest.mark.parametrize(
    "cov",
    [
        np.zeros((3, 3)), -np.eye(3), np.diag([1.0, -1e-9, 1.0]), np.ones((3, 3)), 1e-320 * np.eye(3),
        1e-40 * np.eye(3), np.diag([1e-12, 1e-12, 1e-33]), np.eye(3, k=1) - np.eye(3, k=-1) + np.eye(3),
        1e308 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ],
)  # fmt: skip
def test_what_is_no_covariance_has_no_nees_and_is_counted(cov: Array) -> None:
    estimate, covs = np.array([[3.0, -40.0, 1.0]] * 3), np.array([cov, 0.01 * np.eye(3), np.full((3, 3), np.nan)])
    assert nees.counted_void(covs, estimate) == 1
    assert np.isnan(nees.nees(estimate, covs, np.zeros((3, 3)))).tolist() == [True, False, True]


def test_how_small_a_covariance_may_be_depends_on_the_numbers_of_the_pose() -> None:
    cov = np.array([np.diag([1e-18, 1e-18, 1e-18])])
    assert nees.counted_void(cov, np.array([[500.0, 0.0, 3.0]])) == 0
    assert nees.counted_void(cov, np.array([[5e6, 0.0, 3.0]])) == 1  # numbers there are 9e-10 m apart


def test_nees_is_never_negative_however_thin_the_covariance() -> None:
    rng = np.random.default_rng(10)
    cloud = rng.normal(size=(200, 2, 3)) * (1e-3, 1e-3, 1e-5)  # two particles: rank one, but for rounding
    covs = np.einsum("npi,npj->nij", cloud, cloud)
    values = nees.nees(rng.normal(size=(200, 3)), covs, np.zeros((200, 3)))
    assert not (values < 0).any()


def test_a_map_alone_is_aligned_by_its_landmarks() -> None:
    rng = np.random.default_rng(11)
    truth = Map(np.arange(6), rng.normal(size=(6, 2)), None)
    turned = moved(np.array([3.0, -2.0, 1.0]), np.column_stack((truth.xy, np.zeros(6))))[:, :2]
    assert accuracy.own_map_rmse(Map(np.arange(6)[::-1], turned[::-1], None), truth) == pytest.approx(0, abs=1e-12)
    assert accuracy.own_map_rmse(Map(np.arange(2), turned[:2], None), truth) is None


def test_landmarks_missed_are_those_sighted_and_spurious_those_unknown() -> None:
    known = Map(np.array([1, 2, 3, 4]), np.zeros((4, 2)), None)
    found = Map(np.array([2, 9, 8, 7]), np.zeros((4, 2)), None)
    assert accuracy.missed(found, known, np.array([1, 1, -1, 2, 3, 3, 5])) == 2  # 1 and 3; 4 was never sighted
    assert accuracy.spurious(found, known) == 3
    assert accuracy.missed(known, known, known.ids) == accuracy.spurious(known, known) == 0


def test_landmark_nees_of_true_covariances_is_chi_square() -> None:
    """The correlations between landmarks do not matter: each is judged by its own block."""
    rng = np.random.default_rng(12)
    n = 300
    mixed = rng.normal(size=(2 * n, 2 * n)) / np.sqrt(2 * n)
    joint = mixed @ mixed.T + 0.01 * np.eye(2 * n)
    truth = Map(np.arange(n), rng.normal(0, 30, (n, 2)), None)
    order = rng.permutation(n)
    values = list[float]()
    for _ in range(10):
        xy = truth.xy + (mixed @ rng.normal(size=2 * n) + 0.1 * rng.normal(size=2 * n)).reshape(n, 2)
        pick = (2 * order[:, None] + np.arange(2)).ravel()
        values += nees.landmark_nees(Map(order, xy[order], joint[np.ix_(pick, pick)]), truth, order[:0]).tolist()
    assert len(values) == 10 * n
    found = nees.nees_columns("nees", np.array(values), 2)
    assert found["nees"] == pytest.approx(1, abs=6 / np.sqrt(10 * n))  # the variance of chi-square(2) / 2 is 1
    assert found["nees_inside"] == pytest.approx(0.95, abs=6 * np.sqrt(0.95 * 0.05 / (10 * n)))


def test_landmark_nees_leaves_out_what_was_given_as_exact_and_counts_the_collapsed_as_outside() -> None:
    truth = Map(np.array([1, 2, 3]), np.zeros((3, 2)), None)
    found = Map(np.array([3, 1, 2]), np.full((3, 2), 0.1), np.diag([0.01, 0.01, 0, 0, 0, 0]))
    values = nees.landmark_nees(found, truth, np.array([1]))
    np.testing.assert_allclose(values, [np.nan, 2.0])
    assert nees.nees_columns("nees", values, 2) == pytest.approx({"nees": 1.0, "nees_inside": 0.5})
    assert not len(nees.landmark_nees(found._replace(cov=None), truth, np.array([1])))
    assert nees.nees_columns("nees", np.zeros(0), 2) == {}
    assert nees.nees_columns("nees", np.full(4, np.nan), 3) == {}
