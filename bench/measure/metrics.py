"""Metrics of a path, a map and a belief, as pure functions; paths are (m, 3) poses at the truth's times."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Map
from ...core.se2 import Array, Ints, act, compose, wrap
from ...core.truth_errors import difference, rows_of

INSIDE_95 = {2: 5.991464547107982, 3: 7.814727903251178}  # chi-square's 95 % points of a landmark, a pose
ROUNDING = 1e-14  # ratio of a covariance's smallest to largest variance below which the smallest may be zero
SYMMETRIC = 1e-9  # share of its largest entry by which a covariance may differ from its transpose

LEAST = 1.0  # m and rad, of the numbers that an estimate is made of
FINEST = float(np.finfo(np.float64).eps)
"""Standard deviation below which a covariance is none, relative to the estimate's coordinate. Neighbouring numbers at x
are up to eps |x| apart, and a path of some metres and turns is a sum of numbers of LEAST or more, whatever it is at
the time: an estimate cannot be better than such a step, 2e-16 m near the origin and 1e-9 m in UTM coordinates. Sensors
are worse by ten orders of magnitude, so that what falls below is zero, or meant for it."""

STRAIGHT = 1e-12  # share of a path's extent that it may extend to the side and still be straight
ULPS = 16  # rounding error of a coordinate less the mean of its column, summed in any order


class Alignment(NamedTuple):
    """The rigid motion applied to an estimate before it is compared with the truth."""

    motion: Array  # (3,) x, y, heading
    translation_only: bool  # the path is straight or standing, so that no rotation was looked for


def align(estimate: Array, truth: Array) -> Alignment:
    """Finds the motion with the least sum of squared position errors: no reflection, no scale.

    With the centred positions e and t, the rotation is atan2(sum e x t, sum e . t): Umeyama's solution (PAMI 13(4),
    1991) in two dimensions, where the best proper rotation has this closed form even if a reflection would fit better.
    A path on one line, or one point, but for rounding, is only shifted.
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
    """Bounds the Frobenius norm of what rounding does to the centred `positions` (m, 2)."""
    return float(ULPS * np.finfo(np.float64).eps * np.abs(positions).max(initial=0.0) * np.sqrt(positions.size))


def aligned(alignment: Alignment, estimate: Array) -> Array:
    """Returns the poses (m, 3) of `estimate` after the alignment."""
    return compose(np.broadcast_to(alignment.motion, estimate.shape), estimate)


def ate(estimate: Array, truth: Array) -> float:
    """Computes the absolute trajectory error, m: the root mean square distance between the positions."""
    return float(np.sqrt(((estimate[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


def heading_error(estimate: Array, truth: Array) -> float:
    """Computes the root mean square of the wrapped heading differences, rad."""
    return float(np.sqrt((wrap(estimate[:, 2] - truth[:, 2]) ** 2).mean()))


def map_rmse(estimate: Map, truth: Map, alignment: Alignment) -> float | None:
    """Computes the RMS distance, m, of the landmarks in both maps, aligned as the path; None without any."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if not len(mine):
        return None
    xy = act(np.broadcast_to(alignment.motion, (len(mine), 3)), estimate.xy[mine])
    return float(np.sqrt(((xy - truth.xy[theirs]) ** 2).sum(axis=1).mean()))


def own_map_rmse(estimate: Map, truth: Map) -> float | None:
    """Computes as `map_rmse`, the shared landmarks aligned by themselves; None with fewer than three."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if len(mine) < 3:
        return None
    return map_rmse(estimate, truth, align(estimate.xy[mine], truth.xy[theirs]))


def missed(estimate: Map, truth: Map, sighted: Ints) -> int:
    """Counts the known landmarks that were sighted, by the ids (s,) of the sightings, and are not in the map."""
    return len(np.setdiff1d(np.intersect1d(truth.ids, sighted), estimate.ids))


def spurious(estimate: Map, truth: Map) -> int:
    """Counts the landmarks of the map that are none of the known ones."""
    return len(np.setdiff1d(estimate.ids, truth.ids))


def landmark_nees(estimate: Map, truth: Map, fixed: Ints) -> Array:
    """Computes the NEES (m,), 2 degrees of freedom, of each landmark in both maps.

    From the known start, not aligned, as `nees`. Landmarks with ids in `fixed` were given without covariance and are
    left out; empty where the map has no covariance.
    """
    if estimate.cov is None:
        return np.zeros(0)
    shared = np.setdiff1d(np.intersect1d(estimate.ids, truth.ids), fixed)
    mine, theirs = rows_of(estimate.ids, shared), rows_of(truth.ids, shared)
    xy = estimate.xy[mine]
    return squared_distances(xy - truth.xy[theirs], covariances(estimate.cov)[mine], xy)


def covariances(joint: Array) -> Array:
    """Returns the diagonal blocks (n, 2, 2) of a map's joint covariance (2n, 2n)."""
    n = len(joint) // 2
    return joint.reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n)]


def nees(estimate: Array, cov: Array, truth: Array) -> Array:
    """Computes the NEES (m,) of each pose: e' C^-1 e, chi-square with 3 degrees of freedom if C is right.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), eq. (5.4.2-3). `cov`
    is (m, 3, 3). NaN where it is none by `are_covariances`. The error is in the world frame, from the known start, not
    aligned.
    """
    return squared_distances(difference(estimate, truth), cov, estimate)


def are_covariances(cov: Array, estimate: Array) -> NDArray[np.bool]:
    """Returns True (m,) where C (m, k, k), finite, is a covariance of the estimate (m, k).

    It is symmetric, positive definite beyond rounding, and no standard deviation in any direction is below FINEST.
    """
    largest = np.abs(cov).max(axis=(1, 2))
    with np.errstate(over="ignore"):
        symmetric = np.abs(cov - cov.swapaxes(1, 2)).max(axis=(1, 2)) <= SYMMETRIC * largest
    spread = np.linalg.eigvalsh(cov)
    finest = np.zeros_like(cov)
    at = np.arange(cov.shape[-1])
    finest[:, at, at] = (FINEST * np.maximum(np.abs(estimate), LEAST)) ** 2
    coarse = np.linalg.eigvalsh(cov - finest)[:, 0] > 0
    return symmetric & (spread[:, 0] > ROUNDING * spread[:, -1]) & coarse


def not_covariances(cov: Array, estimate: Array) -> int:
    """Counts those of C (m, k, k) that are known, so finite, and no covariances of the estimate (m, k)."""
    known = np.isfinite(cov).all(axis=(1, 2))
    return int((~are_covariances(cov[known], estimate[known])).sum())


def squared_distances(error: Array, cov: Array, estimate: Array) -> Array:
    """Computes e' C^-1 e (m,) of each error (m, k) of the estimate (m, k); NaN where C (m, k, k) is no covariance."""
    known = np.flatnonzero(np.isfinite(cov).all(axis=(1, 2)))
    spread, axes = np.linalg.eigh(cov[known])
    definite = are_covariances(cov[known], estimate[known])
    along = np.einsum("mij,mi->mj", axes[definite], error[known[definite]])  # the error along the axes of the ellipsoid
    values = np.full(len(error), np.nan)
    with np.errstate(over="ignore"):  # a landmark may be anywhere
        values[known[definite]] = (along**2 / spread[definite]).sum(axis=1)
    return values


class Consistency(NamedTuple):
    """The errors of a belief relative to its covariances."""

    mean: float  # of NEES over its degrees of freedom: 1 if consistent
    inside: float  # share inside the belief's own 95 % bound


def consistency(values: Array, dof: int) -> Consistency | None:
    """Summarises NEES (m,) with `dof` degrees of freedom; None where none is known.

    A step without a usable covariance counts as outside: a filter that has collapsed must not be judged by its better
    moments.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    return Consistency(float(known.mean() / dof), float((known <= INSIDE_95[dof]).sum() / len(values)))
