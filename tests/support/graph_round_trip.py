"""A log with every kind of factor and their truth, and its comparison with what came back from a file."""

from dataclasses import replace

import numpy as np

from laps import laps
from random_logs import random_covariance
from slamduel.core.factors import UNKNOWN, Dataset, Log, Map, Prior, Truth
from slamduel.core.fixes import FixTable
from slamduel.core.partial import PartialTable
from slamduel.core.se2 import Array
from slamduel.core.truth.errors import sighted_from
from slamduel.datasets.false_loops import planted


def all_kinds(seed: int) -> Dataset:
    """Laps with loop closures, some of them false, and sightings of 20 landmarks, each with a covariance of its own."""
    rng = np.random.default_rng(seed)
    log, truth = planted(laps(rng, 2), 0.1, rng)
    assert truth is not None
    places = Map(np.arange(3, 63, 3), rng.uniform(-2, 12, (20, 2)), None)
    step = np.repeat(np.arange(0, len(log), 5), 2)
    seen = np.concatenate([rng.choice(20, 2, replace=False) for _ in range(len(step) // 2)])
    z_cov = np.array([random_covariance(rng, [0.05, 0.02]) for _ in step])
    z = sighted_from(truth.poses[step], places.xy[seen])
    z += np.array([rng.multivariate_normal(np.zeros(2), cov) for cov in z_cov])
    z[:, 0] = np.maximum(z[:, 0], 0.3)
    z[:, 1] = np.arctan2(np.sin(z[:, 1]), np.cos(z[:, 1]))
    start = Prior(truth.poses[0], random_covariance(rng, [0.03, 0.01, 0.01]))
    full = Log.from_arrays(
        "laps", start, log.t + 0.5, log.delta, log.delta_cov, step, places.ids[seen], z, z_cov,
        loop_step=log.loop_step, loop_to=log.loop_to, loop_delta=log.loop_delta, loop_cov=log.loop_cov,
    )  # fmt: skip
    return Dataset(full, Truth(full.t, truth.poses, places, false_loops=truth.false_loops))


def with_parts(dataset: Dataset, kind: int) -> Dataset:
    """With four sightings of that kind alone, the first of an unknown landmark, and three fixes of whole poses."""
    log, rng = dataset.log, np.random.default_rng(5)
    n, ids = len(log), np.array([UNKNOWN, 3, 9, 3])
    z, var = rng.uniform(0.5, 3, 4), rng.uniform(1, 2, 4)
    partial = PartialTable.from_arrays(n, np.array([0, 0, 4, 7]), ids, np.full(4, kind), z, var)
    cov = np.array([random_covariance(rng, [0.1, 0.2, 0.05]) for _ in range(3)])
    fixes = FixTable.from_arrays(n, np.array([0, 4, 4]), rng.uniform(-3, 3, (3, 3)), cov)
    return dataset._replace(log=replace(log, partial=partial, fixes=fixes))


def assert_same_parts(found: Log, expected: Log) -> None:
    """The same sightings of a part alone, of known landmarks, and the same fixes; covariances up to rounding."""
    expected = expected.identified()
    assert found.partial is not None
    assert expected.partial is not None
    for name, column in expected.partial.columns.items():
        np.testing.assert_allclose(found.partial.columns[name], column, rtol=1e-14)
    assert found.fixes is not None
    assert expected.fixes is not None
    np.testing.assert_array_equal(found.fixes.step, expected.fixes.step)
    np.testing.assert_array_equal(found.fixes.z, expected.fixes.z)
    np.testing.assert_allclose(found.fixes.cov, expected.fixes.cov, rtol=1e-9, atol=1e-12)


def assert_same_graph(found: Dataset, expected: Dataset, *, times: bool) -> None:
    """The same graph, numbers up to rounding, and the truth of the same steps and landmarks."""
    one, other = found.log, expected.log
    for column in ("sighting_first", "ids", "loop_first", "loop_to"):
        np.testing.assert_array_equal(getattr(one, column), getattr(other, column))
    if times:
        np.testing.assert_array_equal(one.t, other.t)
    for a, b in ((one.delta[1:], other.delta[1:]), (one.loop_delta, other.loop_delta), (one.z, other.z)):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(one.prior.pose, other.prior.pose, rtol=1e-12, atol=1e-14)
    covs = ((one.delta_cov[1:], other.delta_cov[1:]), (one.loop_cov, other.loop_cov), (one.z_cov, other.z_cov))
    for a, b in (*covs, (one.prior.cov[None], other.prior.cov[None])):
        _assert_close(a, b)
    if expected.truth is not None:
        assert found.truth is not None
        np.testing.assert_array_equal(found.truth.poses, expected.truth.poses)
        if expected.truth.map is not None:
            assert found.truth.map is not None
            wanted = np.isin(expected.truth.map.ids, found.truth.map.ids)
            np.testing.assert_array_equal(found.truth.map.ids, expected.truth.map.ids[wanted])
            np.testing.assert_array_equal(found.truth.map.xy, expected.truth.map.xy[wanted])
            assert set(other.ids.tolist()) <= set(found.truth.map.ids.tolist())


def _assert_close(cov: Array, expected: Array) -> None:
    sd = np.sqrt(np.einsum("nii->ni", expected))
    assert (np.abs(cov - expected) <= 1e-11 * sd[:, :, None] * sd[:, None, :]).all()
