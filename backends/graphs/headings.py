"""Initial values of a path with loop closures: headings first, which are nearly linear.

Of the headings alone J is quadratic once each loop is known to a turn: the multiple of 2 pi next to what odometry has
there. Their minimum is one sparse linear system (L. Carlone, R. Aragues, J. A. Castellanos and B. Bona, "A fast and
accurate approximation for planar pose graph optimization", IJRR 33(7), 2014). The positions follow from odometry with
these headings; the first Gauss-Newton step from there is that paper's second linear system.
"""

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ...core.factors import Log
from ...core.se2 import Array, wrap


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
