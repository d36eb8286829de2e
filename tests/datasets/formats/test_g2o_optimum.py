"""A g2o file written from a log has, in GTSAM, the optimum of `graph[solver=gtsam]`: by two readers not ours."""

from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

import graph_in_gtsam
from driven import final
from random_logs import random_log
from recorded import at_hand
from slamduel.backends.api import Solution
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import UNKNOWN, Log, Map
from slamduel.core.se2 import between, rotation, wrap
from slamduel.datasets import registry as datasets
from slamduel.datasets.cache import generator
from slamduel.datasets.formats.g2o_write import write_g2o
from small_log import positive_definite


def made(name: str, **options: Any) -> Log:
    source = datasets.find(name)
    return source.make(source.options(**options), generator(name, 3)).log


def with_loops() -> Log:
    """Correlated noise everywhere, some ids unknown, and loop closures: between neighbours and over long stretches."""
    rng = np.random.default_rng(8)
    log, truth = random_log(rng, 60, 12, noise=0.5)
    step = np.array([1, 7, 20, 20, 31, 44, 59])
    to = np.array([0, 6, 3, 11, 2, 30, 1])
    delta = between(truth.poses[to], truth.poses[step]) + 0.01 * rng.normal(size=(7, 3))
    delta[:, 2] = wrap(delta[:, 2])
    ids = np.where(rng.random(len(log.ids)) < 0.05, UNKNOWN, log.ids)
    cov = 0.01 * positive_definite(rng, 7, 3)
    columns = (log.t, log.delta, log.delta_cov, log.sighting_step, ids, log.z, log.z_cov)
    return Log.from_arrays("loops", log.prior, *columns, loop_step=step, loop_to=to, loop_delta=delta, loop_cov=cov)


def localisation() -> Log:
    """Half of the landmarks given, and held fixed."""
    log, truth = random_log(np.random.default_rng(9), 60, 12, noise=0.5)
    known = Map(truth.map.ids[::2], truth.map.xy[::2], None)
    columns = (log.t, log.delta, log.delta_cov, log.sighting_step, log.ids, log.z, log.z_cov)
    return Log.from_arrays("given", log.prior._replace(map=known), *columns)


def freiburg() -> Log:
    return made("freiburg", path=str(at_hand("freiburg")))


LOGS = {
    "city": lambda: made("city", landmarks=40, steps=150),
    "circle": lambda: made("circle", steps=120),
    "loops": with_loops,
    "given": localisation,
    "freiburg": freiburg,
    "pose2example": lambda: made("gtsam", path="pose2example.txt"),
    "w100": lambda: made("gtsam", path="w100.graph"),
    "victoria-park": lambda: made("victoria-park").head(1200),
}


def optimum(log: Log) -> Solution:
    return final("graph", log.identified(), solver="gtsam")


@pytest.mark.parametrize("name", LOGS)
def test_gtsam_finds_the_optimum_of_graph_in_the_file(name: str, tmp_path: Path) -> None:
    log = LOGS[name]()
    left_out = write_g2o(tmp_path / "log.g2o", log)
    assert left_out == (log.ids == UNKNOWN).sum()
    graph = graph_in_gtsam.read(tmp_path / "log.g2o")
    given = 0 if log.prior.map is None else len(log.prior.map.ids)
    assert graph.factors.size() == len(log) + len(log.loop_to) + len(log.ids) - left_out + given

    path, landmarks, *_ = optimum(log)
    places = dict(zip(landmarks.ids.tolist(), landmarks.xy, strict=True))
    rng = np.random.default_rng(4)
    near = {i: xy + 1e-2 * rng.normal(size=2) for i, xy in places.items()}
    start = graph.values(path + 1e-3 * rng.normal(size=path.shape), near)
    error, found, points = graph.optimised(start)
    assert graph.factors.error(start) > error * (1 + 1e-4)
    assert graph.factors.error(graph.values(path, places)) == pytest.approx(error, rel=1e-6)
    size = np.ptp(path[:, :2])
    np.testing.assert_allclose(found[:, :2], path[:, :2], atol=1e-6 * size)
    np.testing.assert_allclose(wrap(found[:, 2] - path[:, 2]), 0, atol=1e-6)
    for landmark, xy in points.items():
        np.testing.assert_allclose(xy, places[landmark], atol=1e-6 * size)


def test_gtsam_s_own_reader_finds_it_too_where_it_reads_every_row(tmp_path: Path) -> None:
    """It passes over EDGE_SE2_XY in silence, and reads BR; of the prior, which it has no row for, it is told."""
    log = made("city", landmarks=40, steps=100)
    assert write_g2o(tmp_path / "log.g2o", log, for_gtsam=True) == 0
    factors, _ = gtsam.readG2o(str(tmp_path / "log.g2o"), False)
    assert factors.size() == len(log) - 1 + len(log.ids)
    path, landmarks, *_ = optimum(log)
    first = int(log.ids.max()) + 1
    R = rotation(log.prior.pose[2])
    model = gtsam.noiseModel.Gaussian.Covariance(R.T @ log.prior.cov @ R)
    factors.add(gtsam.PriorFactorPose2(first, gtsam.Pose2(*log.prior.pose), model))
    values = gtsam.Values()
    for k, pose in enumerate(path):
        values.insert(first + k, gtsam.Pose2(*pose))
    for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
        values.insert(gtsam.symbol("l", landmark), xy)
    before = factors.error(values)
    after = factors.error(gtsam.LevenbergMarquardtOptimizer(factors, values).optimize())
    assert after == pytest.approx(before, rel=1e-6)
    found = misfit(log, path, landmarks)
    assert found is not None
    assert sum(found) / 2 == pytest.approx(after, rel=1e-4)  # J counts in the world's coordinates, not in the tangent's
