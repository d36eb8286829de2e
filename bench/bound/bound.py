"""The Cramér-Rao bound of a log: how near to the truth an unbiased estimator can come, with the noise as stated.

The error's covariance is no smaller than the inverse of the information that all factors and priors have, linearised at
the true path and landmarks (Tichavsky, Muravchik and Nehorai, IEEE Transactions on Signal Processing 46(5), 1998).
Constant errors of sensors are unknowns with their priors, and so is the bias of a gyro, which walks. Ids are the true
ones, so that it bounds those who have to find them, too. The bound of an aligned path is without the part of that
covariance that the alignment takes away.
"""

from typing import NamedTuple

import numpy as np

from ...backends.api import Diverged
from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints
from .filtered import filtered
from .known_log import KnownLog, known_log, missing

LARGEST = 800
"""Most numbers of landmarks and of poses that loop closures come back to: a step of the filter costs their square."""

LONGEST = 50_000
"""Most steps: six sightings each take 1 GB and a minute then, as measured."""

STRAIGHT = 1e-6  # share of a path's extent that it may extend to the side and still be straight

VAGUE = 1e-9
"""1/m^2, 1/rad^2; information of every variable besides: a landmark that one range alone tells of has none else."""


class Bound(NamedTuple):
    """Bounds of the root mean square error of the position over the steps whose true pose is known, m."""

    online: float  # of the poses given step by step, each by the measurements so far; aligned with the truth
    final: float  # of those given at the end, by all; likewise
    online_origin: float  # from the known start, not aligned
    final_origin: float  # likewise


def bound(log: Log, truth: Truth | None) -> Bound | None:
    """Computes it; None where truth or precision does not suffice, or where the log is too large."""
    if no_bound(log, truth) or (known := known_log(log, truth)) is None:
        return None
    try:
        found, final = filtered(known, _alignment(known.path, known.at)), _smoothed(known)
    except (Diverged, np.linalg.LinAlgError):
        return None
    m = len(known.at)
    squares = np.array([np.trace(cov[known.at, :2, :2], axis1=1, axis2=2).sum() for cov in (found.cov, final)])
    aligned = squares - (found.online.sum(), found.final.sum())
    if not (aligned > 0).all():
        return None
    return Bound(*np.sqrt(np.concatenate((aligned, squares)) / m).tolist())


def no_bound(log: Log, truth: Truth | None) -> str:
    """Says why a log has none; "" where only its precision can be the reason."""
    if len(log) > LONGEST:
        return f"the log has more than {LONGEST:,} steps"
    if log.prior.start != "known":
        return "the robot's start is unknown"
    known = known_log(log, truth)
    if known is None:
        return missing(log, truth)
    if 2 * len(known.landmarks.ids) + 3 * len(np.unique(known.log.loop_to)) > LARGEST:
        return "there are too many landmarks, or poses that loop closures come back to"
    return ""


def _smoothed(known: KnownLog) -> Array:
    """(n, 3, 3) covariances of the poses by all factors, linearised at the truth."""
    from ...backends.graphs.batch import Batch  # numba
    from ...backends.graphs.gauss_newton import eliminate

    batch = Batch(known.log, 0, 0.0)
    batch.start_at(known.path, known.landmarks)
    if not eliminate(batch.forest, VAGUE):
        raise Diverged("the information at the truth is not positive definite")
    return batch.forest.pose_covariances()


def _alignment(path: Array, at: Ints) -> Array:
    """(3, n, 2) orthonormal shifts of the positions at the steps `at`: along x, along y, and turned about their middle.

    An alignment takes away what of the errors is along these, to first order. A straight path is not turned: (2, n, 2).
    """
    out = np.zeros((3, len(path), 2))
    out[0, at, 0] = out[1, at, 1] = 1 / np.sqrt(len(at))
    xy = path[at, :2] - path[at, :2].mean(axis=0)
    out[2, at] = xy[:, ::-1] * (-1, 1) / max(float(np.linalg.norm(xy)), 1e-300)
    spread = np.linalg.svd(xy, compute_uv=False)
    return out[: 3 if len(at) > 1 and spread[1] > STRAIGHT * spread[0] else 2]
