"""What a path, a map and a belief are judged by; every function is pure, its definition in its docstring.

Paths are (m, 3) poses at the same m times as the truth's.
"""

from typing import NamedTuple

import numpy as np

from ...frontend.factors import Map
from ...frontend.se2 import Array, Ints, act, compose, wrap
from ...frontend.truth_errors import difference, rows_of

INSIDE_95 = {2: 5.991464547107982, 3: 7.814727903251178}
"""The 95 % points of chi-square by degrees of freedom: 2 of a landmark, 3 of a pose."""

ROUNDING = 1e-14
"""Where a covariance's variances along its axes differ by more than this, the smallest cannot be told from zero."""


STRAIGHT = 1e-12
"""Share of a path's extent that it may extend to the side and still be straight."""

ULPS = 16
"""By which a coordinate less the mean of its column may be off: its own rounding, and that of a sum of any order."""


class Alignment(NamedTuple):
    """The rigid motion of the plane that is put on an estimate before it is compared with the truth."""

    motion: Array  # (3,) x, y, heading
    translation_only: bool  # the path is straight or standing, so that no rotation was looked for


def align(estimate: Array, truth: Array) -> Alignment:
    """The motion with the least sum of squared position errors: rotation and translation, no reflection, no scale.

    With the centred positions e and t, the rotation is atan2(sum e x t, sum e . t): Umeyama's solution (PAMI 13(4),
    1991) in two dimensions, in which the best proper rotation has this closed form even where a reflection would fit
    better. A path whose points lie on one line, or on one point, but for the rounding of its coordinates, is only
    shifted.
    """
    e, t = estimate[:, :2], truth[:, :2]
    mean_e, mean_t = e.mean(axis=0), t.mean(axis=0)
    together = (e - mean_e).T @ (t - mean_t)
    spread = np.linalg.svd(together, compute_uv=False)
    # |(e + de)' (t + dt) - e' t| <= |de| |t| + |e| |dt|, to first order, in Frobenius norms.
    by_rounding = _rounding(e) * np.linalg.norm(t - mean_t) + _rounding(t) * np.linalg.norm(e - mean_e)
    flat = bool(spread[1] <= STRAIGHT * spread[0] + by_rounding)
    heading = 0.0
    if not flat:
        heading = float(np.arctan2(together[0, 1] - together[1, 0], together[0, 0] + together[1, 1]))
    motion = np.array((0.0, 0.0, heading))
    motion[:2] = mean_t - act(motion, mean_e)
    return Alignment(motion, flat)


def _rounding(positions: Array) -> float:
    """The Frobenius norm, at most, of what rounding does to the centred `positions` (m, 2)."""
    return float(ULPS * np.finfo(np.float64).eps * np.abs(positions).max(initial=0.0) * np.sqrt(positions.size))


def aligned(alignment: Alignment, estimate: Array) -> Array:
    """The poses (m, 3) of `estimate` after the alignment."""
    return compose(np.broadcast_to(alignment.motion, estimate.shape), estimate)


def ate(estimate: Array, truth: Array) -> float:
    """Absolute trajectory error, m: the root mean square of the distance between the positions."""
    return float(np.sqrt(((estimate[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


def heading_error(estimate: Array, truth: Array) -> float:
    """Root mean square of the wrapped difference of the headings, rad."""
    return float(np.sqrt((wrap(estimate[:, 2] - truth[:, 2]) ** 2).mean()))


def map_rmse(estimate: Map, truth: Map, alignment: Alignment) -> float | None:
    """Root mean square distance, m, of the landmarks both maps have, after the path's alignment; None with none."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if not len(mine):
        return None
    xy = act(np.broadcast_to(alignment.motion, (len(mine), 3)), estimate.xy[mine])
    return float(np.sqrt(((xy - truth.xy[theirs]) ** 2).sum(axis=1).mean()))


def own_map_rmse(estimate: Map, truth: Map) -> float | None:
    """As `map_rmse`, the landmarks that both maps have aligned by themselves; None with fewer than three of them."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if len(mine) < 3:
        return None
    return map_rmse(estimate, truth, align(estimate.xy[mine], truth.xy[theirs]))


def missed(estimate: Map, truth: Map, sighted: Ints) -> int:
    """How many of the known landmarks that were sighted, by the ids (s,) of the sightings, are not in the map."""
    return len(np.setdiff1d(np.intersect1d(truth.ids, sighted), estimate.ids))


def spurious(estimate: Map, truth: Map) -> int:
    """How many landmarks of the map are none of the known ones."""
    return len(np.setdiff1d(estimate.ids, truth.ids))


def landmark_nees(estimate: Map, truth: Map, fixed: Ints) -> Array:
    """NEES (m,), of 2 degrees of freedom, of each landmark both maps have, in its block of the map's covariance.

    As `nees`: from the known start, not aligned. Landmarks whose ids are among `fixed` were given without covariance
    and are left out; empty where the map has no covariance.
    """
    if estimate.cov is None:
        return np.zeros(0)
    shared = np.setdiff1d(np.intersect1d(estimate.ids, truth.ids), fixed)
    mine, theirs = rows_of(estimate.ids, shared), rows_of(truth.ids, shared)
    return squared_distances(estimate.xy[mine] - truth.xy[theirs], covariances(estimate.cov)[mine])


def covariances(joint: Array) -> Array:
    """The blocks (n, 2, 2) on the diagonal of a map's joint covariance (2n, 2n)."""
    n = len(joint) // 2
    return joint.reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n)]


def nees(estimate: Array, cov: Array, truth: Array) -> Array:
    """Normalised estimation error squared (m,) of each pose: e' C^-1 e, which is chi-square with 3 dof where C is true.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), eq. (5.4.2-3). `cov`
    is (m, 3, 3). NaN where there is no covariance, or none that is positive definite. The error is taken from the known
    start, not aligned: it is the belief in the world frame that is judged.
    """
    return squared_distances(difference(estimate, truth), cov)


def squared_distances(error: Array, cov: Array) -> Array:
    """Mahalanobis distances squared (m,): e' C^-1 e of each error (m, k); NaN where C (m, k, k) is not definite."""
    known = np.flatnonzero(np.isfinite(cov).all(axis=(1, 2)))
    spread, axes = np.linalg.eigh(cov[known])
    definite = spread[:, 0] > ROUNDING * spread[:, -1]
    along = np.einsum("mij,mi->mj", axes[definite], error[known[definite]])  # the error along the axes of the ellipsoid
    values = np.full(len(error), np.nan)
    values[known[definite]] = (along**2 / spread[definite]).sum(axis=1)
    return values


class Consistency(NamedTuple):
    """How a belief's errors compare with its covariances."""

    mean: float  # of NEES over its degrees of freedom: 1 where the belief is as wide as its errors
    inside: float  # share inside the belief's own 95 % bound


def consistency(values: Array, dof: int) -> Consistency | None:
    """Of the NEES (m,), each with `dof` degrees of freedom; None where none is known.

    A belief that has no usable covariance has no bound to be inside of, and counts as outside: a filter that has
    collapsed must not be judged by its better moments.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    return Consistency(float(known.mean() / dof), float((known <= INSIDE_95[dof]).sum() / len(values)))
