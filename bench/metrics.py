"""What a path, a map and a belief are judged by; every function is pure, its definition in its docstring.

Paths are (m, 3) poses at the same m times as the truth's.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from ..frontend.factors import Map
from ..frontend.se2 import Array, act, compose, wrap
from ..frontend.truth_errors import difference

INSIDE_95 = float(chdtri(3, 0.05))
"""The 95 % point of chi-square with 3 degrees of freedom."""

ROUNDING = 1e-14
"""Where a covariance's variances along its axes differ by more than this, the smallest cannot be told from zero."""

RPE_DISTANCE = 1.0
"""m of path over which the relative pose error is taken."""


class Alignment(NamedTuple):
    """The rigid motion of the plane that is put on an estimate before it is compared with the truth."""

    motion: Array  # (3,) x, y, heading
    translation_only: bool  # the path is straight or standing, so that no rotation was looked for


def align(estimate: Array, truth: Array) -> Alignment:
    """The motion with the least sum of squared position errors: rotation and translation, no reflection, no scale.

    With the centred positions e and t, the rotation is atan2(sum e x t, sum e . t): Umeyama's solution (PAMI 13(4),
    1991) in two dimensions, in which the best proper rotation has this closed form even where a reflection would fit
    better. A path whose points lie on one line, or on one point, is only shifted.
    """
    e, t = estimate[:, :2], truth[:, :2]
    mean_e, mean_t = e.mean(axis=0), t.mean(axis=0)
    together = (e - mean_e).T @ (t - mean_t)
    spread = np.linalg.svd(together, compute_uv=False)
    flat = bool(spread[1] <= 1e-12 * spread[0] or spread[0] == 0)
    heading = 0.0
    if not flat:
        heading = float(np.arctan2(together[0, 1] - together[1, 0], together[0, 0] + together[1, 1]))
    motion = np.array((0.0, 0.0, heading))
    motion[:2] = mean_t - act(motion, mean_e)
    return Alignment(motion, flat)


def aligned(alignment: Alignment, estimate: Array) -> Array:
    """The poses (m, 3) of `estimate` after the alignment."""
    return compose(np.broadcast_to(alignment.motion, estimate.shape), estimate)


def ate(estimate: Array, truth: Array) -> float:
    """Absolute trajectory error, m: the root mean square of the distance between the positions."""
    return float(np.sqrt(((estimate[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


def heading_error(estimate: Array, truth: Array) -> float:
    """Root mean square of the wrapped difference of the headings, rad."""
    return float(np.sqrt((wrap(estimate[:, 2] - truth[:, 2]) ** 2).mean()))


def rpe(t: Array, estimate: Array, truth: Array) -> float | None:
    """Relative pose error, m: how far the motion over each metre of the true path is off, root mean square, by evo.

    Pairs of poses follow one another along the path (evo_rpe -d 1 -u m --pairs_from_reference); None where the path
    has no metre in it.
    """
    from evo.core import filters, metrics

    relative = metrics.RPE(
        metrics.PoseRelation.translation_part, RPE_DISTANCE, metrics.Unit.meters, pairs_from_reference=True
    )
    try:
        relative.process_data((_evo(t, truth), _evo(t, estimate)))
    except (filters.FilterException, metrics.MetricsException):
        return None
    return float(relative.get_statistic(metrics.StatisticsType.rmse))


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


def nees(estimate: Array, cov: Array, truth: Array) -> Array:
    """Normalised estimation error squared (m,) of each pose: e' C^-1 e, which is chi-square with 3 dof where C is true.

    `cov` is (m, 3, 3). NaN where there is no covariance, or none that is positive definite. The error is taken from the
    known start, not aligned: it is the belief in the world frame that is judged.
    """
    error = difference(estimate, truth)
    known = np.flatnonzero(np.isfinite(cov).all(axis=(1, 2)))
    spread, axes = np.linalg.eigh(cov[known])
    definite = spread[:, 0] > ROUNDING * spread[:, 2]
    along = np.einsum("mij,mi->mj", axes[definite], error[known[definite]])  # the error along the axes of the ellipsoid
    values = np.full(len(error), np.nan)
    values[known[definite]] = (along**2 / spread[definite]).sum(axis=1)
    return values


def _evo(t: Array, poses: Array):
    from evo.core.trajectory import PoseTrajectory3D

    xyz = np.column_stack((poses[:, :2], np.zeros(len(poses))))
    half = poses[:, 2] / 2
    wxyz = np.column_stack((np.cos(half), np.zeros((len(poses), 2)), np.sin(half)))
    return PoseTrajectory3D(xyz, wxyz, t)
