"""The UKF against a dense one that samples the whole state, its small matrices against plain ones."""

from collections.abc import Callable

import numpy as np
import pytest

from random_logs import random_log
from slamduel.backends.api import Diverged
from slamduel.backends.gaussian._ekf import OWED
from slamduel.backends.gaussian.joint import SPACE
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.backends.unscented import _transform
from slamduel.backends.unscented.ukf import Options, Ukf
from slamduel.core.factors import Log, Map, Odometry, Prior, Step
from slamduel.core.kernels._small import cholesky
from slamduel.core.se2 import Array, compose, wrap
from tiers import first_quick


class DenseUkf:
    """The scaled UKF as Wan and van der Merwe print it, over the whole state (x, y, heading, landmarks) and the noise.

    The whole has more dimensions than a model touches, so kappa is made smaller by as many: then alpha^2 (dims +
    kappa), and with it how far out the points lie, is that of a filter which samples the touched dimensions alone. With
    the touched dimensions first in the Cholesky factor the other points see nothing of the model's curvature.
    """

    def __init__(self, prior: Prior, options: Options) -> None:
        self.options = options
        self.mean, self.cov, self.ids = np.array(prior.pose), np.array(prior.cov), list[int]()
        if prior.map is not None:
            n = 3 + 2 * len(prior.map.ids)
            cov = np.zeros((n, n))
            cov[:3, :3], cov[3:, 3:] = prior.cov, prior.map.cov
            self.mean, self.cov, self.ids = (
                np.concatenate((prior.pose, prior.map.xy.ravel())),
                cov,
                prior.map.ids.tolist(),
            )
        self.nis = 0.0

    def transform(
        self, model: Callable[[Array], Array], angle: int, mean: Array, cov: Array, touched: list[int]
    ) -> tuple[Array, Array, Array]:
        """Mean, covariance and cross-covariance with x of model(x) (points, .), whose column `angle` is one."""
        alpha, beta, kappa = self.options.alpha, self.options.beta, self.options.kappa
        n = len(mean)
        lam = alpha**2 * (n + (len(touched) + kappa - n)) - n
        order = touched + [i for i in range(n) if i not in touched]
        root = np.empty((n, n))
        root[order] = np.linalg.cholesky(cov[np.ix_(order, order)])
        off = np.sqrt(n + lam) * np.concatenate((np.zeros((1, n)), root.T, -root.T))
        first = np.full(2 * n + 1, 1 / (2 * (n + lam)))
        first[0] = lam / (n + lam)
        second = first.copy()
        second[0] += 1 - alpha**2 + beta
        y = model(mean + off)
        away = y - y[0]
        away[:, angle] = wrap(away[:, angle])
        shift = first @ away
        away -= shift
        out = y[0] + shift
        out[angle] = wrap(out[angle])
        return out, (away.T * second) @ away, (off.T * second) @ away

    def step(self, step: Step) -> Array:
        if step.odometry is not None:
            self.move(step.odometry)
        self.nis = 0.0
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark in self.ids:
                self.correct(landmark, z, R)
            else:
                self.add(landmark, z, R)
        return self.mean[:3].copy()

    def widened(self, cov: Array) -> Array:
        n, m = len(self.mean), len(cov)
        both = np.zeros((n + m, n + m))
        both[:n, :n], both[n:, n:] = self.cov, cov
        return both

    def move(self, odometry: Odometry) -> None:
        n = len(self.mean)
        mean = np.concatenate((self.mean, odometry.delta))

        def model(x: Array) -> Array:
            return np.hstack((compose(x[:, :3], x[:, n:]), x[:, 3:n]))

        touched = [0, 1, 2, n, n + 1, n + 2]
        self.mean, self.cov, _ = self.transform(model, 2, mean, self.widened(odometry.cov), touched)

    def correct(self, landmark: int, z: Array, R: Array) -> None:
        j = 3 + 2 * self.ids.index(landmark)

        def model(x: Array) -> Array:
            dx, dy = x[:, j] - x[:, 0], x[:, j + 1] - x[:, 1]
            return np.stack((np.hypot(dx, dy), np.arctan2(dy, dx) - x[:, 2]), axis=1)

        expected, spread, cross = self.transform(model, 1, self.mean, self.cov, [0, 1, 2, j, j + 1])
        S = spread + R
        nu = z - expected
        nu[1] = wrap(nu[1])
        K = cross @ np.linalg.inv(S)
        self.mean = self.mean + K @ nu
        self.mean[2] = wrap(self.mean[2])
        self.cov = self.cov - K @ S @ K.T
        self.nis += nu @ np.linalg.inv(S) @ nu

    def add(self, landmark: int, z: Array, R: Array) -> None:
        n = len(self.mean)

        def model(x: Array) -> Array:
            r, angle = x[:, n], x[:, 2] + x[:, n + 1]
            xy = np.stack((x[:, 0] + r * np.cos(angle), x[:, 1] + r * np.sin(angle)), axis=1)
            return np.hstack((x[:, :n], xy))

        mean = np.concatenate((self.mean, z))
        self.mean, self.cov, _ = self.transform(model, 2, mean, self.widened(R), [0, 1, 2, n, n + 1])
        self.ids.append(landmark)


def make(prior: Prior, options: Options | None = None) -> Ukf:
    return Ukf(prior, options or Options(), np.random.default_rng(0))


def with_map(log: Log, cov: float, rng: np.random.Generator) -> Log:
    """The log with a given map of half of its landmarks, off by the covariance it claims."""
    ids = np.unique(log.ids)[::2]
    filtered = make(log.prior)
    for step in log:
        filtered.step(step)
    found = filtered.map()
    xy = np.array([found.xy[found.ids.tolist().index(i)] for i in ids.tolist()])
    xy = xy + np.sqrt(cov) * rng.standard_normal(xy.shape)
    return Log.from_steps("given", log.prior._replace(map=Map(ids, xy, cov * np.eye(xy.size))), list(log))


@pytest.mark.parametrize(
    "options",
    first_quick(
        [Options(), Options(alpha=0.5, kappa=1.0), Options(beta=0.0), Options(alpha=0.03), Options(alpha=1.4)], 2
    ),
    ids=str,
)
@pytest.mark.parametrize("given", [False, True])
def test_touched_sigma_points_are_as_good_as_all(options: Options, given: bool) -> None:
    log = random_log(np.random.default_rng(2), 120, 6, radius=8.0, blind=0.1).log
    log = with_map(log, 0.1**2, np.random.default_rng(3)) if given else log
    ukf, dense = make(log.prior, options), DenseUkf(log.prior, options)
    for step in log:
        pose, expected = ukf.step(step), dense.step(step)
        belief = ukf.belief()
        assert pose[:2] == pytest.approx(expected[:2], abs=1e-9)
        assert abs(wrap(pose[2] - expected[2])) < 1e-9
        assert belief.cov == pytest.approx(dense.cov[:3, :3], abs=1e-11, rel=1e-7)
        assert (belief.nis or 0.0) == pytest.approx(dense.nis, abs=1e-7, rel=1e-7)
    found = ukf.map()
    assert found.ids.tolist() == dense.ids
    assert found.xy.ravel() == pytest.approx(dense.mean[3:], abs=1e-9)
    assert found.cov == pytest.approx(dense.cov[3:, 3:], abs=1e-10, rel=1e-7)


def test_a_map_that_outgrows_its_room_and_frames_that_outgrow_what_may_be_owed() -> None:
    log = random_log(np.random.default_rng(4), 5, 80, radius=30.0).log
    assert max(len(step.sightings.ids) for step in log) > OWED / 2
    assert len(np.unique(log.ids)) > SPACE
    ukf, dense = make(log.prior), DenseUkf(log.prior, Options())
    for step in log:
        assert ukf.step(step)[:2] == pytest.approx(dense.step(step)[:2], abs=1e-9)
    assert ukf.map().cov == pytest.approx(dense.cov[3:, 3:], abs=1e-10, rel=1e-7)


def test_it_is_the_ekf_where_models_are_straight_enough() -> None:
    """What the transform adds is of second order in the noise: a tenth of it leaves a hundredth of the difference."""
    apart: list[float] = []
    for noise in (1e-2, 1e-3):
        log = random_log(np.random.default_rng(5), 80, 8, noise=noise, errors=1.0).log
        ukf, ekf = make(log.prior), TextbookEkf(log.prior)
        apart.append(max(float(np.abs(ukf.step(step) - ekf.step(step))[:2].max()) for step in log))
    assert 0 < apart[1] < apart[0] / 30
    assert apart[0] < 1e-4


def test_a_map_held_fixed_is_the_limit_of_a_certain_one() -> None:
    log = random_log(np.random.default_rng(7), 100, 8, radius=8.0).log
    sure = with_map(log, 1e-14, np.random.default_rng(8))
    given = sure.prior.map
    held = make(sure.prior._replace(map=given._replace(cov=None)))
    limit = make(sure.prior)
    for step in sure:
        assert held.step(step) == pytest.approx(limit.step(step), abs=1e-7)
        assert held.belief().cov == pytest.approx(limit.belief().cov, abs=1e-9)
    found, m = held.map(), len(given.ids)
    assert np.array_equal(found.ids[:m], given.ids)
    assert np.array_equal(found.xy[:m], given.xy)
    assert found.ids.tolist()[m:] == limit.map().ids.tolist()[m:]
    assert not found.cov[: 2 * m].any()
    assert np.linalg.eigvalsh(found.cov[2 * m :, 2 * m :])[0] > 0


def test_no_options_make_a_covariance_indefinite() -> None:
    """What a line leaves over has a covariance for any curvature, at the ends of the options' ranges and between."""
    rng = np.random.default_rng(9)
    for _ in range(300):
        dims, outs = int(rng.integers(1, 7)), int(rng.integers(1, 4))
        alpha, beta, kappa = (
            rng.choice([1e-3, 0.1, 1.0, 2.0]),
            rng.choice([0.0, 0.3, 2.0, 10.0]),
            rng.choice([0.0, 3.0]),
        )
        spread, excess = alpha**2 * (dims + kappa), beta - alpha**2
        bend = np.ones((dims, 1)) * rng.standard_normal(outs)  # the same in all directions: the worst there is
        bend = spread * (bend + rng.choice([0.0, 1.0]) * rng.standard_normal((dims, outs)))
        slant = rng.standard_normal((dims, outs))
        _, shift, rest = _transform.regress(bend + slant, bend - slant, dims, outs, spread, excess)
        assert np.linalg.eigvalsh(rest)[0] >= -1e-11 * (1 + np.abs(rest).max() + abs(excess) * (shift**2).max())


@pytest.mark.parametrize("n", [2, 3, 5])
def test_a_root_is_a_covariance_s_and_comes_off_a_slope_again(n: int) -> None:
    rng = np.random.default_rng(n)
    factor = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-3, 3, (n, 1))
    cov, root, line = factor @ factor.T, np.zeros((5, 5)), rng.standard_normal((2, n))
    assert cholesky(cov, root, n, 0.0, _transform.ROUNDING)
    assert root[:n, :n] == pytest.approx(np.linalg.cholesky(cov), rel=1e-6)
    slope = np.hstack((line @ root[:n, :n], np.ones((2, 1))))
    _transform.unroot(slope, root, 2, n)
    assert slope[:, :n] == pytest.approx(line, rel=1e-6)
    assert np.array_equal(slope[:, n], (1.0, 1.0))


def test_a_wide_prior_leaves_precise_sightings_their_worth() -> None:
    """Where the whole lies says nothing of its shape: with 100 m or with 1 km, the path from the first pose is one."""
    log = random_log(np.random.default_rng(7), 150, 12, noise=0.1, blind=0.2).log
    paths: list[Array] = []
    for sd in (1e2, 1e3):
        ukf = make(log.prior._replace(cov=np.diag([sd**2, sd**2, 1e-2])))
        paths.append(np.array([ukf.step(step) for step in log]))
        cov = ukf.map().cov
        assert cov is not None
        assert np.linalg.eigvalsh(cov)[0] > 0
    assert np.abs(wrap(paths[1] - paths[0])).max() < 1e-3


def test_numbers_that_left_their_domain_end_it() -> None:
    log = random_log(np.random.default_rng(10), 5, 8, radius=8.0, blind=0.0).log
    odometry, sightings = log[1].odometry, log[1].sightings
    bad = {
        "predicted pose": log[1]._replace(odometry=odometry._replace(cov=-odometry.cov)),
        "innovation": log[1]._replace(sightings=sightings._replace(cov=-1e3 * sightings.cov)),
    }
    for reason, step in bad.items():
        ukf = make(log.prior)
        ukf.step(log[0])
        with pytest.raises(Diverged, match=reason):
            ukf.step(step)
    with pytest.raises(Diverged, match="new landmark"):
        make(log.prior).step(log[0]._replace(sightings=log[0].sightings._replace(cov=-log[0].sightings.cov)))
