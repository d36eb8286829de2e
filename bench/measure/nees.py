"""Computes the NEES of poses and landmarks, and tells covariances from what is none."""

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Log, Map
from ...core.se2 import Array, Ints
from ...core.truth.errors import difference, rows_of

INSIDE_95 = {2: 5.991464547107982, 3: 7.814727903251178}  # chi-square's 95 % points of a landmark, a pose
ROUNDING = 1e-14  # ratio of a covariance's smallest to largest variance below which the smallest may be zero
SYMMETRIC = 1e-9  # share of its largest entry by which a covariance may differ from its transpose

LEAST = 1.0  # m and rad, of the numbers that an estimate is made of
FINEST = float(np.finfo(np.float64).eps)
"""Standard deviation below which a covariance is none, relative to the estimate's coordinate. Neighbouring numbers at x
are up to eps |x| apart, and a path of some metres and turns is a sum of numbers of LEAST or more, whatever it is at
the time: an estimate cannot be better than such a step, 2e-16 m near the origin and 1e-9 m in UTM coordinates. Sensors
are worse by ten orders of magnitude, so that what falls below is zero, or meant for it."""


def nees_columns(name: str, values: Array, dof: int) -> dict[str, float]:
    """Sums up NEES (m,) with `dof` degrees of freedom: mean over `dof`, and share inside the 95 % bound, by column.

    Empty where none is known. A step without a usable covariance counts as outside: a filter that has collapsed must
    not be judged by its better moments.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return {}
    inside = float((known <= INSIDE_95[dof]).sum() / len(values))
    return {name: float(known.mean() / dof), f"{name}_inside": inside}


def not_covariances(
    log: Log, path: Array | None, cov: Array | None, landmarks: Map
) -> tuple[dict[str, int], list[str]]:
    """Counts by column the covariances of poses (n, 3, 3) and landmarks that are none; and remarks on these."""
    columns, said = dict[str, int](), list[str]()
    known = 0 if cov is None else int(np.isfinite(cov).all(axis=(1, 2)).sum())
    if known and cov is not None and path is not None:
        wrong = columns["nees_void"] = counted_void(cov, path)
        said += [f"NEES: not a covariance at {wrong} of {known} step{'s' * (known != 1)}"] * bool(wrong)
    if landmarks.cov is not None:
        given = log.prior.map
        exact = given.ids if given is not None and given.cov is None else ()
        drawn = np.isin(landmarks.ids, exact, invert=True)
        blocks = covariances(landmarks.cov)[drawn]
        wrong, known = counted_void(blocks, landmarks.xy[drawn]), len(blocks)
        columns["landmark_nees_void"] = wrong
        said += [f"landmark NEES: not a covariance at {wrong} of {known} landmark{'s' * (known != 1)}"] * bool(wrong)
    return columns, said


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
    """The diagonal blocks (n, 2, 2) of a map's joint covariance (2n, 2n)."""
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
    """True (m,) where C (m, k, k), finite, is a covariance of the estimate (m, k).

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


def counted_void(cov: Array, estimate: Array) -> int:
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
