"""A simulated log's measurement errors, and tests of them against their stated covariances."""

from typing import NamedTuple

import numpy as np

from slamduel.backends.api import WantsTruth
from slamduel.bench.measure.nees import nees
from slamduel.bench.plan.spec import backend_variants
from slamduel.core.factors import Dataset, Map, Truth
from slamduel.core.se2 import Array, between, wrap


class Errors(NamedTuple):
    """Measured minus true."""

    sightings: Array  # (s, 2)
    motions: Array  # (n - 1, 3)
    sightings_squared: Array  # (s,) Mahalanobis distances, squared
    motions_squared: Array  # (n - 1,)


def known(made: Dataset) -> tuple[Truth, Map]:
    assert made.truth is not None
    assert made.truth.map is not None
    return made.truth, made.truth.map


def seen(poses: Array, xy: Array) -> Array:
    """(s, 2) the true ranges and bearings, wrapped."""
    x, y = (xy - poses[:, :2]).T
    return np.stack((np.hypot(x, y), wrap(np.arctan2(y, x) - poses[:, 2])), axis=-1)


def errors(made: Dataset) -> Errors:
    """Errors of a log with landmarks 0, 1, 2 ..., all sighted under their own ids."""
    truth, landmarks = known(made)
    sighted = made.log.z - seen(truth.poses[made.log.sighting_step], landmarks.xy[made.log.ids])
    moved = made.log.delta[1:] - between(truth.poses[:-1], truth.poses[1:])
    sighted[:, 1], moved[:, 2] = wrap(sighted[:, 1]), wrap(moved[:, 2])
    return Errors(sighted, moved, _squared(sighted, made.log.z_cov), _squared(moved, made.log.delta_cov[1:]))


def _squared(error: Array, cov: Array) -> Array:
    return np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0])


def run(backend: str, made: Dataset) -> tuple[Array, Array]:
    """The online path (n, 3) of a filter, and the NEES (n,) of its poses."""
    (variant,) = backend_variants(backend)
    filter_ = variant.builder.make(made.log.prior, variant.options, np.random.default_rng(0))
    truth, _ = known(made)
    if isinstance(filter_, WantsTruth):
        filter_.tell(truth)
    poses, covs = np.zeros((len(made.log), 3)), np.zeros((len(made.log), 3, 3))
    for k, step in enumerate(made.log):
        pose = filter_.step(step)
        belief = filter_.belief()
        poses[k], covs[k] = pose, belief.cov
    return poses, nees(poses, covs, truth.poses)
