"""Normalised squared errors of a log's factors at its ground truth, by a covariance's inverse."""

from typing import NamedTuple

import numpy as np

from slamduel.core.factors import Dataset
from slamduel.core.se2 import Array, between, wrap
from slamduel.core.truth.errors import odometry_errors, sighting_errors


class Squared(NamedTuple):
    """Each factor's e' C^-1 e."""

    motions: Array  # (m,) of 3 degrees of freedom
    loops: Array  # (l,) likewise, without false ones
    sightings: Array  # (s,) of 2

    @property
    def mean(self) -> float:
        """Of a degree of freedom: 1 where covariances are as stated."""
        return sum(map(np.sum, self)) / self.freedom

    @property
    def freedom(self) -> int:
        """Degrees of freedom of all factors."""
        return 3 * (len(self.motions) + len(self.loops)) + 2 * len(self.sightings)


def squared(dataset: Dataset) -> Squared:
    """Those of a log with a true pose at every step."""
    log, truth = dataset
    assert truth is not None
    assert truth.t.tolist() == log.t.tolist()
    motions, sightings = odometry_errors(log, truth), sighting_errors(log, truth)
    loops = log.loop_delta - between(truth.poses[log.loop_to], truth.poses[log.loop_step])
    loops[:, 2] = wrap(loops[:, 2])
    good = np.ones(len(loops), bool)
    if truth.false_loops is not None:
        good[truth.false_loops] = False
    return Squared(
        _squared(motions.values, log.delta_cov[motions.row]),
        _squared(loops[good], log.loop_cov[good]),
        _squared(sightings.values, log.z_cov[sightings.row]),
    )


def _squared(errors: Array, cov: Array) -> Array:
    return np.einsum("ri,rij,rj->r", errors, np.linalg.inv(cov), errors)
