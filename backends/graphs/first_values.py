"""Initial values: of landmarks from their first sightings, of a path from headings by motions and loop closures.

Of the headings alone J is quadratic once each loop is known to a turn: the multiple of 2 pi next to what odometry has
there. Their minimum is one sparse linear system (L. Carlone, R. Aragues, J. A. Castellanos and B. Bona, "A fast and
accurate approximation for planar pose graph optimization", IJRR 33(7), 2014). The positions follow from odometry with
these headings; the first Gauss-Newton step from there is that paper's second linear system.
"""

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ...core.factors import Log
from ...core.se2 import Array, Ints, wrap
from ..incremental.smoother import NEAREST


def first_values(poses: Array, z: Array, cov: Array, which: Ints, landmarks: int) -> Array:
    """(landmarks, 2) the mean of the sighted positions, each weighted by its information.

    Sighting i, z (s, 2) with covariance (s, 2, 2), is of landmark `which[i]`, from the pose (s, 3).
    """
    r, angle = np.maximum(z[:, 0], NEAREST), poses[:, 2] + z[:, 1]
    c, s = np.cos(angle), np.sin(angle)
    xy = poses[:, :2] + r[:, None] * np.stack((c, s), axis=-1)
    rr, rb, bb = cov[:, 0, 0], (cov[:, 0, 1] + cov[:, 1, 0]) / 2, cov[:, 1, 1]
    along, mixed, across = np.stack((bb, -rb / r, rr / r**2)) / (rr * bb - rb**2)  # to the line of sight
    information = np.stack(
        (
            c * c * along - 2 * c * s * mixed + s * s * across,
            c * s * (along - across) + (c * c - s * s) * mixed,
            s * s * along + 2 * c * s * mixed + c * c * across,
        ),
        axis=-1,
    )
    total, moment = np.zeros((landmarks, 3)), np.zeros((landmarks, 2))
    np.add.at(total, which, information)
    np.add.at(moment, which, _times(information, xy))
    xx, xy, yy = total.T
    return _times(np.stack((yy, -xy, xx), axis=-1) / (xx * yy - xy * xy)[:, None], moment)


def _times(A: Array, x: Array) -> Array:
    """Products (n, 2) of symmetric matrices, xx, xy, yy in A (n, 3), with x (n, 2)."""
    return np.stack((A[:, 0] * x[:, 0] + A[:, 1] * x[:, 1], A[:, 1] * x[:, 0] + A[:, 2] * x[:, 1]), axis=-1)


def by_headings(log: Log) -> Array:
    """(n, 3) a path with the headings that fit motions and loop closures best, each weighted by its information."""
    heading = _headings(log)
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    x, y = log.delta[1:, 0], log.delta[1:, 1]
    steps = np.concatenate((log.prior.pose[None, :2], np.column_stack((c * x - s * y, s * x + c * y))))
    return np.column_stack((np.cumsum(steps, axis=0), wrap(heading)))


def _headings(log: Log) -> Array:
    """(n,) headings, not wrapped; those of odometry where the system has no solution."""
    n = len(log)
    start = _reckoned(log)
    off = wrap(log.loop_delta[:, 2] - start[log.loop_step] + start[log.loop_to])
    a, b = np.concatenate((np.arange(n - 1), log.loop_to)), np.concatenate((np.arange(1, n), log.loop_step))
    with np.errstate(divide="ignore"):
        weight = 1 / np.concatenate((log.delta_cov[1:, 2, 2], log.loop_cov[:, 2, 2]))
    if not np.isfinite(weight).all() or not np.isfinite(off).all():
        return start
    pulls = weight * np.concatenate((np.zeros(n - 1), off))
    total = np.bincount(a, weight, n) + np.bincount(b, weight, n)
    every = np.arange(n)
    entries = np.concatenate((total, -weight, -weight))
    rows, columns = np.concatenate((every, a, b)), np.concatenate((every, b, a))
    laplacian = csc_matrix((entries, (rows, columns)), shape=(n, n))[1:, 1:]  # the first heading is the prior's
    try:
        solver = splu(laplacian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # singular, to rounding
        return start
    turned = solver.solve((np.bincount(b, pulls, n) - np.bincount(a, pulls, n))[1:])
    return start + np.concatenate(([0.0], turned))


def _reckoned(log: Log) -> Array:
    """(n,) headings of odometry, not wrapped."""
    return log.prior.pose[2] + np.concatenate(([0.0], np.cumsum(log.delta[1:, 2])))
