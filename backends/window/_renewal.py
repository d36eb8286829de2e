"""Moves the prior and the linearisation points, and eliminates everything again.

Variables that share a factor with a marginalised one keep their linearisation points, since that factor cannot be
relinearised: two linearisations of one variable add information that no sighting gave (Dong-Si and Mourikis, ICRA
2011). If moved nevertheless, paths on Huang's circle are 8 % worse. The prior at step 0 is linear and may move.
"""

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._chain import DONE, chain, copy
from ._estimates import offsets
from ._window import (
    BEFORE,
    BOTTOM,
    FIRST,
    FREE,
    HELD,
    IN,
    KNOWN,
    LEFT,
    NOW,
    OLD_POSES,
    POSES,
    PRESENCE,
    SLOTS,
    STAYS,
    Window,
    row,
)  # fmt: skip


@compiled
def settle(w: Window, start: int) -> None:
    """Makes the front, which is about pose `start`, the prior."""
    n = w.state[SLOTS]
    for s in range(w.rows[w.state[BOTTOM], FIRST], w.rows[start, FIRST]):
        if w.sightings[s] != HELD:
            w.marks[w.sightings[s], STAYS] = 1
            if w.parts[s] >= 0:
                w.marks[w.parts[s], STAYS] = 1
    w.state[BOTTOM], w.state[KNOWN] = start, n
    for k in range(n):
        w.slots[k, BEFORE] = w.slots[k, NOW]
    copy(w.front, w.prior, n, row(w))
    for v in range(len(w.marks)):
        if w.marks[v, PRESENCE] == LEFT:
            w.marks[v, PRESENCE] = FREE


@compiled
def free(w: Window, start: int, poses: Array, places: Array, threshold: float) -> float:
    """Keeps only the offsets of variables that may move and are off by more than `threshold` (m, rad).

    Those poses are the ones from `start` on, except one with a prior. Returns the largest offset.
    """
    most = 0.0
    for i in range(len(poses)):
        off = max(abs(poses[i, 0]), abs(poses[i, 1]), abs(poses[i, 2]))
        may = i >= start and (i > w.state[BOTTOM] or w.state[OLD_POSES] + i == 0)
        if may:
            most = max(most, off)
        if not may or off <= threshold:
            poses[i, 0] = poses[i, 1] = poses[i, 2] = 0.0
    for v in range(len(places)):
        off = max(abs(places[v, 0]), abs(places[v, 1]))
        may = w.marks[v, PRESENCE] == IN and w.marks[v, STAYS] == 0
        if may:
            most = max(most, off)
        if not may or off <= threshold:
            places[v, 0] = places[v, 1] = 0.0
    return most


@compiled
def move(w: Window, poses: Array, places: Array) -> None:
    """Moves the linearisation points by the given offsets, and shifts the prior's right-hand side accordingly."""
    for i in range(len(poses)):
        for a in range(3):
            w.poses[i, a] += poses[i, a]
        w.poses[i, 2] = wrap(w.poses[i, 2])
    for v in range(len(places)):
        for a in range(2):
            w.places[v, a] += places[v, a]
    m, r, F = 3 + 2 * w.state[KNOWN], row(w), w.prior
    by = np.empty(m)
    for a in range(3):
        by[a] = poses[w.state[BOTTOM], a]
    for i in range(3, m):
        by[i] = places[w.slots[(i - 3) // 2, BEFORE], (i - 3) % 2]
    for i in range(m):
        if by[i] != 0.0:
            for j in range(m):
                F[j * r + r - 1] -= F[min(i, j) * r + max(i, j)] * by[i]


@compiled
def renew(w: Window, start: int, kept: int, threshold: float, anyway: bool) -> tuple[int, float]:
    """Relinearises and eliminates all poses but the last; or just eliminates them, with `start` -1.

    Variables that have left, and the poses before `start`, are first absorbed by the prior. Nothing is done if nothing
    is off by more than `threshold` (m, rad), unless `anyway`. Landmarks not sighted from the last `kept` poses leave
    the front. Returns the outcome, and the largest offset of a variable that may move.
    """
    last, most, settling = w.state[POSES] - 1, 0.0, start >= 0
    poses, places = np.zeros((last + 1, 3)), np.zeros(w.places.shape)
    if settling:
        offsets(w, poses, places)
        most = free(w, start, poses, places, threshold)
        if most <= threshold and not anyway:
            return DONE, most
    for turn in range(2):
        if turn == 0 and not settling:
            continue
        ended = chain(w, start if turn == 0 else last, -1 if turn == 0 else last - kept)
        if ended != DONE:
            return ended, most
        if turn == 0:
            settle(w, start)
            free(w, start, poses, places, threshold)
            move(w, poses, places)
    return DONE, most
