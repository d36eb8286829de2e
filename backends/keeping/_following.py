"""Moves poses that are not variables any more with the landmarks around them."""

from math import atan2, cos, sin

import numpy as np

from ...core.kernels._planar import add_turned, levered, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._log import covariance_of, six


@compiled
def follow(
    poses: Array, left: Array, was: Array, now: Array, submaps: Ints, ends: Ints, around: Ints, reach: float
) -> None:
    """Moves `poses` (n, 3) by the rigid motion that fits best what landmarks around them have moved by since.

    These were at `was` (l, 2) and are at `now`. Those of submap i are around[ends[i] : ends[i + 1]]; one at distance d
    has the weight (d^2 + reach^2)^-2, so that the nearest say where the pose is, and those at `reach` its heading. The
    covariances `left` (n, 6) are turned likewise. The motion is that of Horn's closed form in the plane.
    """
    for k in range(len(poses)):
        x, y = poses[k, 0], poses[k, 1]
        total = ax = ay = bx = by = 0.0
        for t in range(ends[submaps[k]], ends[submaps[k] + 1]):
            i = around[t]
            if i < len(was):
                w = 1.0 / ((was[i, 0] - x) ** 2 + (was[i, 1] - y) ** 2 + reach * reach) ** 2
                total += w
                ax, ay = ax + w * (was[i, 0] - x), ay + w * (was[i, 1] - y)
                bx, by = bx + w * (now[i, 0] - x), by + w * (now[i, 1] - y)
        if total == 0.0:
            continue
        ax, ay, bx, by = ax / total, ay / total, bx / total, by / total
        along = across = 0.0
        for t in range(ends[submaps[k]], ends[submaps[k] + 1]):
            i = around[t]
            if i < len(was):
                w = 1.0 / ((was[i, 0] - x) ** 2 + (was[i, 1] - y) ** 2 + reach * reach) ** 2
                ux, uy, vx, vy = was[i, 0] - x - ax, was[i, 1] - y - ay, now[i, 0] - x - bx, now[i, 1] - y - by
                along += w * (ux * vx + uy * vy)
                across += w * (ux * vy - uy * vx)
        turn = atan2(across, along)
        c, s = cos(turn), sin(turn)
        poses[k, 0], poses[k, 1] = x + bx - (c * ax - s * ay), y + by - (s * ax + c * ay)
        poses[k, 2] = wrap(poses[k, 2] + turn)
        S = np.zeros(6)
        add_turned(S, c, s, left[k], 0)
        left[k] = S


@compiled
def with_frames(poses: Array, left: Array, frames: Array, shared: Array, submaps: Ints, out: Array) -> None:
    """Covariances `out` (n, 3, 3): those given the landmarks, `left` (n, 6), and what poses share with their submap.

    That is `shared` (f, 3, 3) at the frames (f, 3), carried from there to the pose.
    """
    S = np.empty(6)
    for k in range(len(poses)):
        f = submaps[k]
        six(shared[f], 0, S, 0)
        levered(S, frames[f, 1] - poses[k, 1], poses[k, 0] - frames[f, 0])
        for i in range(6):
            S[i] += left[k, i]
        covariance_of(S, 0, out[k])
