"""J_GraphSLAM of the survey: how badly a path and a map fit a log's factors.

    J = |x0 - prior|^2 + sum |x_t - g(u_t, x_t-1)|^2 + sum |z - h(m, x_t)|^2

each term a squared Mahalanobis distance in the factor's own covariance. The batch optimum has the least J there is.
"""

from typing import NamedTuple

import numpy as np

from ..backends.models import innovation, sight
from ..frontend.factors import UNKNOWN, Log, Map
from ..frontend.se2 import Array, between, wrap


class Cost(NamedTuple):
    """J by its terms."""

    prior: float
    odometry: float
    sightings: float
    loops: float

    @property
    def total(self) -> float:
        """J."""
        return sum(self)


TERMS = Cost._fields
"""The names of the terms."""


def cost(log: Log, path: Array, landmarks: Map) -> Cost | None:
    """J of `path` (n, 3) and `landmarks` on `log`; None where the map lacks a landmark that was sighted or given.

    A given map with covariance is a part of the prior.
    """
    given = log.prior.map
    if given is not None and not np.isin(given.ids, landmarks.ids).all():
        return None
    seen = log.ids != UNKNOWN
    order = np.argsort(landmarks.ids)
    place = np.searchsorted(landmarks.ids[order], log.ids[seen])
    if len(landmarks.ids) == 0:
        if seen.any():
            return None
    elif not np.array_equal(landmarks.ids[order][np.minimum(place, len(order) - 1)], log.ids[seen]):
        return None
    xy = landmarks.xy[order][place] if seen.any() else np.zeros((0, 2))
    z = log.z[seen]
    expected = sight(path[log.sighting_step[seen]], xy)[0] if len(z) else z
    step = log.loop_step
    return Cost(
        prior=_prior(log, path, landmarks),
        odometry=_squared(_wrapped(between(path[:-1], path[1:]) - log.delta[1:]), log.delta_cov[1:]),
        sightings=_squared(innovation(z.copy(), expected), log.z_cov[seen]),
        loops=_squared(_wrapped(between(path[log.loop_to], path[step]) - log.loop_delta), log.loop_cov),
    )


def _prior(log: Log, path: Array, landmarks: Map) -> float:
    known = log.prior.map
    off = _squared(_wrapped((path[0] - log.prior.pose)[None]), log.prior.cov[None])
    if known is None or known.cov is None:
        return off
    row = {landmark: k for k, landmark in enumerate(landmarks.ids.tolist())}
    xy = landmarks.xy[[row[landmark] for landmark in known.ids.tolist()]]
    return off + _squared((xy - known.xy).reshape(1, -1), known.cov[None])


def _wrapped(difference: Array) -> Array:
    difference[:, 2] = wrap(difference[:, 2])
    return difference


def _squared(error: Array, cov: Array) -> float:
    """Sum of e' C^-1 e over rows."""
    return float(np.einsum("ni,ni->", error, np.linalg.solve(cov, error[..., None])[..., 0])) if len(error) else 0.0
