"""Computes J, the misfit of a path and a map to a log's factors: J_GraphSLAM of the survey.

    J = |x0 - prior|^2 + sum |x_t - g(u_t, x_t-1)|^2 + sum |z - h(m, x_t)|^2

each term a squared Mahalanobis distance in the factor's own covariance. The batch optimum has the least J. Sightings of
a range or a bearing alone are terms of one dimension, fixes terms of what they measure. Constant errors of sensors are
variables like path and map, with their priors: where an estimate has none, J is the least over them.
"""

from typing import NamedTuple

import numpy as np

from ...backends.api import Constant, Diverged
from ...backends.constant_errors import (
    fitted,
    fix_residuals,
    partial_residuals,
    prior_cost,
    squared_fixes,
    squared_partial,
    turn_cost,
)
from ...backends.models import innovation, sight
from ...core.factors import UNKNOWN, Log, Map
from ...core.se2 import Array, between
from ...core.truth.errors import difference, rows_of

BLOCK = 1 << 16  # sightings or motions that are worked on at once: the Jacobians of all may not fit

STEPS = 20  # of the batch solver, from an estimate whose J is judged


class Misfit(NamedTuple):
    """J by its terms."""

    prior: float  # what is known of the world: of the start, of given landmarks, by fixes, of constant errors
    odometry: float
    sightings: float  # whole and partial ones
    loops: float

    @property
    def total(self) -> float:
        """J."""
        return sum(self)


TERMS = Misfit._fields  # the names of the terms


def misfit(log: Log, path: Array, landmarks: Map, constant: Constant | None = None) -> Misfit | None:
    """Computes J, a given map being part of the prior; None where a sighted or given landmark is not mapped."""
    given = log.prior.map
    if given is not None and not np.isin(given.ids, landmarks.ids).all():
        return None
    constant = fitted(log, path, landmarks) if constant is None else constant
    sighted, parts = misfits(log, path, landmarks), partial_misfits(log, path, landmarks, constant)
    if sighted is None or parts is None:
        return None
    return Misfit(
        prior=_prior(log, path, landmarks) + _fixed(log, path, constant),
        odometry=float(motion_misfits(log, path).sum()),
        sightings=float(sighted.sum() + parts.sum()),
        loops=float(loop_misfits(log, path).sum()),
    )


def lowest_near(log: Log, path: Array, landmarks: Map, constant: Constant | None = None) -> float | None:
    """Computes the least J to which a few steps of the batch solver lead from a path and a map; None if they fail."""
    from ...backends.graphs.batch import Batch  # numba

    try:
        batch = Batch(log.identified(), 0, 0.0)
        batch.start_at(path, landmarks, constant)
        return batch.fit(0.0, STEPS).cost
    except Diverged:
        return None


def misfits(log: Log, path: Array, landmarks: Map) -> Array | None:
    """Computes the squared Mahalanobis distance (s,) of each sighting with an id; None where one is not mapped."""
    seen = np.flatnonzero(log.ids != UNKNOWN)
    row, step = rows_of(landmarks.ids, log.ids[seen]), log.sighting_step
    if (row < 0).any():
        return None
    squares = np.empty(len(seen))
    for first in range(0, len(seen), BLOCK):
        some, of = seen[first : first + BLOCK], slice(first, first + BLOCK)
        expected = sight(path[step[some]], landmarks.xy[row[of]])[0]
        squares[of] = _each_squared(innovation(log.z[some], expected), log.z_cov[some])
    return squares


def partial_misfits(log: Log, path: Array, landmarks: Map, constant: Constant | None = None) -> Array | None:
    """Computes the squared Mahalanobis distance of each partial sighting with an id; None where one is not mapped."""
    constant = fitted(log, path, landmarks) if constant is None else constant
    off = partial_residuals(log, path, landmarks, constant)
    if off is None or log.partial is None:
        return off
    return squared_partial(log.partial, off)[log.partial.ids != UNKNOWN]


def loop_misfits(log: Log, path: Array) -> Array:
    """Computes the squared Mahalanobis distance (l,) of each loop closure."""
    return _each_squared(difference(between(path[log.loop_to], path[log.loop_step]), log.loop_delta), log.loop_cov)


def motion_misfits(log: Log, path: Array) -> Array:
    """Computes the squared Mahalanobis distance (n - 1,) of each motion."""
    squares = np.empty(max(len(log) - 1, 0))
    for first in range(0, len(squares), BLOCK):
        to = slice(first + 1, first + 1 + BLOCK)
        off = difference(between(path[first : first + len(path[to])], path[to]), log.delta[to])
        squares[first : first + BLOCK] = _each_squared(off, log.delta_cov[to])
    return squares


def _prior(log: Log, path: Array, landmarks: Map) -> float:
    known, off = log.prior.map, 0.0
    if log.prior.start == "known":
        off = _squared(difference(path[:1], log.prior.pose[None]), log.prior.cov[None])
    if known is None or known.cov is None:
        return off
    row = {landmark: k for k, landmark in enumerate(landmarks.ids.tolist())}
    xy = landmarks.xy[[row[landmark] for landmark in known.ids.tolist()]]
    return off + _squared((xy - known.xy).reshape(1, -1), known.cov[None])


def _fixed(log: Log, path: Array, constant: Constant) -> float:
    """The terms of fixes, of a gyro's turns and of the constant errors' priors."""
    off = 0.0 if log.fixes is None else float(squared_fixes(log.fixes, fix_residuals(log.fixes, path, constant)).sum())
    off += 0.0 if log.gyro is None else turn_cost(log.gyro, path)
    return off + prior_cost(log, constant)


def _squared(error: Array, cov: Array) -> float:
    return float(_each_squared(error, cov).sum())


def _each_squared(error: Array, cov: Array) -> Array:
    """Computes e' C^-1 e (n,) of every row."""
    if not len(error):
        return np.zeros(0)
    return np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0])
