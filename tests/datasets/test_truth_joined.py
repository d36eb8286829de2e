"""A log and its ground truth: a start that nobody gave is the truth's."""

import numpy as np

from slamduel.core.factors import Log, Map, Prior, Truth
from slamduel.core.se2 import compose
from slamduel.datasets.truth import with_truth


def made(prior: Prior) -> tuple[Log, Truth]:
    """A log of five steps without sightings, and its truth, known from 1.5 s on, in another frame."""
    delta = np.array([[0.4, 0.0, 0.3]] * 5)
    none = np.zeros(0, np.int64)
    log = Log.from_arrays(
        "<made>", prior, np.arange(5.0), delta, np.tile(1e-4 * np.eye(3), (5, 1, 1)), none, none, np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
    )  # fmt: skip
    poses = [np.array([5.0, -3.0, 2.0])]
    for one in delta[1:]:
        poses.append(compose(poses[-1], one))
    return log, Truth(np.arange(5.0)[2:], np.array(poses)[2:])


def test_a_start_that_nobody_gave_is_that_of_the_truth() -> None:
    log, truth = made(Prior(np.zeros(3), 1e-6 * np.eye(3)))
    joined = with_truth(log, truth, start_given=False)
    np.testing.assert_allclose(joined.log.prior.pose, [5.0, -3.0, 2.0], atol=1e-12)
    np.testing.assert_array_equal(joined.log.prior.cov, log.prior.cov)
    assert joined.truth is not None
    np.testing.assert_array_equal(joined.truth.poses, truth.poses)


def test_a_given_start_and_one_on_a_map_stay() -> None:
    log, truth = made(Prior(np.zeros(3), 1e-6 * np.eye(3)))
    assert with_truth(log, truth).log is log
    on_map, truth = made(Prior(np.zeros(3), 1e-6 * np.eye(3), Map(np.array([1]), np.zeros((1, 2)), None)))
    assert with_truth(on_map, truth, start_given=False).log is on_map
    late = truth._replace(t=truth.t + 100)  # no pose at the log's times
    np.testing.assert_array_equal(with_truth(log, late, start_given=False).log.prior.pose, np.zeros(3))
