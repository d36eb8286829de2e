"""The UKF against a dense one that samples the whole state, its small matrices against plain ones."""

import numpy as np
import pytest

from dense_ukf import DenseUkf
from random_logs import random_log
from slamduel.backends.api import Diverged
from slamduel.backends.gaussian._ekf import OWED
from slamduel.backends.gaussian.joint import SPACE
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.backends.unscented import _transform
from slamduel.backends.unscented.ukf import Options, Ukf
from slamduel.core.factors import Log, Map, Prior
from slamduel.core.kernels._small import cholesky
from slamduel.core.se2 import Array, wrap
from tiers import first_quick


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
