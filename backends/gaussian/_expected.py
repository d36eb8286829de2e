"""Sightings that a joint Gaussian belief expects after a motion, in one compiled call that changes nothing of it."""

from math import sqrt

import numpy as np

from ...core.kernels._planar import propagate
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._expected import ROUNDING, cross_block, spread, within
from .._expected_arrays import expected_at
from .._rules import conclude
from .._vicinity import learn, note, places_at
from ._beliefs import belief_at
from ._ekf import ODOMETRY, POSE, advance
from ._triangle import row


@compiled
def sds(flat: Array, landmarks: int) -> Array:
    """The largest standard deviation of each landmark in any direction, (landmarks,) m."""
    out = np.empty(landmarks)
    for a in range(landmarks):
        i = 2 * a
        upper, lower = row(i), row(i + 1)
        out[a] = spread(flat[upper + i], flat[lower + i], flat[lower + i + 1])
    return out


@compiled
def remember(address: int, members: Ints, pairs: int, places: int) -> None:
    """Has the `Places` remember the landmarks of the belief at `address`: their rows there are `members` (pairs,).

    Pairs of kept poses are within no distance of a sighting.
    """
    g, known = belief_at(address), places_at(places)
    C, own = np.empty((3, 2)), np.empty((2, 2))
    for a in range(pairs):
        if g.agreed[a] == POSE:
            known.sd[members[a]] = np.nan
            continue
        i = 2 * a
        upper, lower = row(i), row(i + 1)
        own[0, 0], own[1, 0], own[1, 1] = g.flat[upper + i], g.flat[lower + i], g.flat[lower + i + 1]
        C[:] = g.cross[:, i : i + 2]
        learn(known, members[a], g.mean, g.pose, g.mean[3 + i], g.mean[4 + i], C, own)
    note(known.odometer, g.mean, g.pose)


@compiled
def expect(
    address: int,
    ids: Ints,
    pairs: int,
    moves: bool,
    motion: Array,
    where: int,
    z: Array,
    R: Array,
    gate: float,
    into: int,
) -> bool:
    """Expected sightings, after the `motion`, of landmarks that one of the sightings z (k, 2), R (k, 2, 2) may be of.

    The belief is that of `JointArrays` at `address`; `ids` (pairs,) are its landmarks, and pairs that it marks as of
    kept poses are passed over. Fills the `ExpectedArrays` at `into` and makes its decision; False if it has no room. A
    landmark far away is passed over by the bound of its deviation alone, which is as it was when the landmark was last
    near.
    """
    g, out = belief_at(address), expected_at(into)
    mean, cross, flat, agreed, bound = g.mean, g.cross, g.flat, g.agreed, g.bound
    x, point, P = mean[:3].copy(), g.points[:3].copy(), g.pose.copy()
    gx, gy = 0.0, 0.0
    if moves:
        gx, gy, turned = advance(x, point, motion, x, where)
        propagate(P, gx, gy, turned, motion)
    pose_sd, furthest, wide = spread(P[0, 0], P[1, 0], P[1, 1]), 0.0, sqrt(gate * ROUNDING)
    for i in range(len(z)):
        furthest = max(furthest, z[i, 0] + wide * sqrt(R[i, 0, 0]))
    room, m = len(out.ids), 0
    near, C, own = np.empty(room, np.int64), np.empty((room + 1, 3, 2)), np.empty((2, 2))
    H, T = np.empty((room + 1, 2, 2)), np.empty((room + 1, 2, 3))
    points, spot = (mean, x) if where == ODOMETRY else (g.points, point)  # with dead reckoning, of headings alone
    for a in range(pairs):
        i = 2 * a
        dx, dy = mean[3 + i] - x[0], mean[4 + i] - x[1]
        away, reach = dx * dx + dy * dy, furthest + wide * (pose_sd + bound[a])
        if away > reach * reach or agreed[a] == POSE:
            continue
        upper, lower = row(i), row(i + 1)
        own[0, 0], own[1, 0], own[1, 1] = flat[upper + i], flat[lower + i], flat[lower + i + 1]
        bound[a] = spread(own[0, 0], own[1, 0], own[1, 1])
        c = C[m]
        for h in range(2):
            c[0, h] = cross[0, i + h] + gx * cross[2, i + h]
            c[1, h] = cross[1, i + h] + gy * cross[2, i + h]
            c[2, h] = cross[2, i + h]
        apart = own[0, 0] + own[1, 1] + P[0, 0] + P[1, 1] - 2.0 * (c[0, 0] + c[1, 1])  # variance of their offset
        reach = furthest + wide * sqrt(max(0.0, apart))
        if away > reach * reach:
            continue
        dx, dy = points[3 + i] - spot[0], points[4 + i] - spot[1]
        if within(x, P, mean[3 + i], mean[4 + i], c, own, z, R, gate, dx, dy, H[m], T[m], out.z[min(m, room - 1)]):
            if m == room:
                return False
            near[m] = a
            m += 1
    cov = out.cov[: 4 * m * m].reshape((2 * m, 2 * m))
    for p in range(m):
        out.ids[p] = ids[near[p]]
        upper, lower = row(2 * near[p]), row(2 * near[p] + 1)
        for q in range(p + 1):
            j = 2 * near[q]
            l01 = flat[lower + j] if p == q else flat[upper + j + 1]  # above the diagonal, nothing is stored
            cross_block(
                H[p], T[p], C[q], flat[upper + j], l01, flat[lower + j], flat[lower + j + 1], H[q], 2 * p, 2 * q, cov
            )  # fmt: skip
    out.count[0] = m
    conclude(into, z, R)
    return True
