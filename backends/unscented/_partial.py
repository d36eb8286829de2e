"""Measurements of few entries of a joint belief by the unscented transform: a range, a bearing, a position, a heading.

As in `_ukf`, a model is the line A x + shift over the entries x that it depends on, with a residual covariance; A and
the residual correct the belief as the Jacobian and the noise do in `_partial`, from which the models are.
"""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky
from ...core.kernels.compiled import compiled
from ...core.partial import BEARING
from ...core.se2 import Array, Ints
from ..gaussian._beliefs import JointArrays, belief_at
from ..gaussian._ekf import AT_ROBOT, INDEFINITE
from ..gaussian._partial import NO_ENTRY, correct, expectation, gather
from ..gaussian._triangle import entry
from ._transform import ROUNDING, regress, unroot

FIX = 2
"""A kind of measurement beside RANGE and BEARING: x and y of the antenna, and heading."""


@compiled
def covariance(b: JointArrays, i: int, j: int) -> float:
    """The covariance of two entries."""
    if i < 0 and j < 0:
        return b.pose[3 + i, 3 + j]
    if i < 0:
        return b.cross[3 + i, j]
    return b.cross[3 + j, i] if j < 0 else entry(b.flat, i, j)


@compiled
def measured(kind: int, at: Array, arm: Array, out: Array) -> bool:
    """Writes what is expected of a measurement at the values of its entries to `out` (3,); False if at the robot.

    A partial sighting has the entries (7,) of `expectation`; a fix by an antenna at `arm` (2,) in the body has the
    pose's, and the heading's constant error.
    """
    if kind == FIX:
        c, s = cos(at[2]), sin(at[2])
        out[0] = at[0] + c * arm[0] - s * arm[1]
        out[1] = at[1] + s * arm[0] + c * arm[1]
        out[2] = at[2] + at[3]
        return True
    there, out[0] = expectation(kind, at, np.empty((1, 7)))
    return there


# The belief, the entries, the model, the measurement and the transform's settings, none of them an object here.
@compiled
def transformed(
    b: JointArrays, n: int, entries: Ints, at: Array, kind: int, arm: Array, rows: Ints, z: Array, R: Array,
    scaling: Array, gate: float,
) -> tuple[int, float]:  # fmt: skip
    """Corrects by z (k,), rows (k,) of what is `measured` at the mean `at` (e,) of entries (e,); its noise is R (k, k).

    `scaling` holds alpha^2, kappa and beta - alpha^2. Returns the outcome and the squared distance.
    """
    k, own, dims = len(rows), np.empty(len(entries), np.int64), 0
    for e in range(len(entries)):  # those that vary
        if entries[e] != NO_ENTRY and covariance(b, entries[e], entries[e]) > 0.0:
            own[dims] = e
            dims += 1
    cov, root, varying = np.empty((dims, dims)), np.zeros((dims, dims)), np.empty(dims, np.int64)
    for i in range(dims):
        varying[i] = entries[own[i]]
        for j in range(i + 1):
            cov[i, j] = covariance(b, varying[i], varying[j])
    if not cholesky(cov, root, dims, 0.0, ROUNDING):
        return INDEFINITE, 0.0
    spread = scaling[0] * (dims + scaling[1])
    centre, value, x = np.empty(3), np.empty(3), np.empty(len(at))
    if not measured(kind, at, arm, centre):
        return AT_ROBOT, 0.0
    away = np.empty((2, dims, k))
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        for q in range(dims):
            x[:] = at
            for i in range(q, dims):
                x[own[i]] += far * root[i, q]
            if not measured(kind, x, arm, value):
                return AT_ROBOT, 0.0
            for a in range(k):
                moved = float(value[rows[a]] - centre[rows[a]])
                away[side, q, a] = wrap(moved) if kind == BEARING or rows[a] == 2 else moved
    slope, shift, rest = regress(away[0], away[1], dims, k, spread, scaling[2])
    unroot(slope, root, k, dims)
    off = np.empty(k)
    for a in range(k):
        unexpected = z[a] - centre[rows[a]] - shift[a]
        off[a] = wrap(unexpected) if kind == BEARING or rows[a] == 2 else unexpected
        for c in range(k):
            rest[a, c] += R[a, c]
    return correct(b, n, varying, slope, off, rest, gate)


@compiled
def partly(
    belief: int, n: int, entries: Ints, place: Array, kind: int, z: float, var: float, scaling: Array, gate: float
) -> tuple[int, float]:
    """Corrects the joint belief at an address by one partial sighting of the entries (7,).

    `place` (2,) is the landmark's where it is held fixed, and has no entries.
    """
    b, at, R, of = belief_at(belief), np.empty(7), np.empty((1, 1)), np.zeros(1, np.int64)
    gather(b.mean, entries, at)
    if entries[3] == NO_ENTRY:
        at[3], at[4] = place[0], place[1]
    R[0, 0] = var
    return transformed(b, n, entries, at, kind, place, of, np.full(1, z), R, scaling, gate)


@compiled
def fixed(
    belief: int, n: int, entries: Ints, z: Array, cov: Array, arm: Array, scaling: Array, gate: float
) -> tuple[int, float, int]:
    """Corrects by a fix z (3,), NaN where nothing is measured; entries (4,): pose and heading's offset.

    Returns the outcome, the squared distance and the number of entries measured.
    """
    b, at = belief_at(belief), np.empty(4)
    gather(b.mean, entries, at)
    rows = np.flatnonzero(~np.isnan(z))
    k = len(rows)
    R = np.empty((k, k))
    for a in range(k):
        for c in range(k):
            R[a, c] = cov[rows[a], rows[c]]
    why, distance = transformed(b, n, entries, at, FIX, arm, rows, z[rows], R, scaling, gate)
    return why, distance, k
