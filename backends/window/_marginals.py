"""The joint marginal of the last pose and of some landmarks, from the chain of stages and the root.

With the columns E of the identity that select them, R' Y = E is solved along the chain, from the stage of the first of
them that was eliminated; their covariance is Y' Y, and their offsets Y' d (see `_estimates`).
"""

import numpy as np

from ...core.kernels._cholesky import row_of
from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._window import BEGIN, MANY, NAME, OWN, POSE, POSES, RETIRED, SLOT, SLOTS, STAGES, Window


@compiled
def gather(y: Array, d: float, mean: Array, cov: Array) -> None:
    """Accumulates a row of Y (columns,) and its part of d."""
    for a in range(len(y)):
        if y[a] != 0.0:
            mean[a] += y[a] * d
            for b in range(a + 1):
                cov[a, b] += y[a] * y[b]


@compiled
def through_stage(w: Window, t: int, E: Array, y: Array, mean: Array, cov: Array) -> None:
    """Propagates E (columns, m), in the front's order, through stage `t`; y (3, columns) is scratch."""
    k, n, o = int(w.stages[t, OWN]), int(w.stages[t, MANY]), int(w.stages[t, BEGIN])
    R, width, columns = w.reals, 3 if k == POSE else 2, len(E)
    c, own = width + 2 * n + 4, 0 if k == POSE else 3 + 2 * k
    for i in range(width):
        for a in range(columns):
            s = E[a, own + i]
            for j in range(i):
                s -= R[o + j * c + i] * y[j, a]
            y[i, a] = s / R[o + i * c + i]
        gather(y[i], R[o + i * c + c - 1], mean, cov)
    last = 3 + 2 * (n - 1)
    for a in range(columns):
        if k == POSE:
            E[a, 0] = E[a, 1] = E[a, 2] = 0.0
        for i in range(width):
            of = o + i * c + width
            if y[i, a] != 0.0:
                for j in range(3 + 2 * n):
                    E[a, j] -= y[i, a] * R[of + j]
        if k != POSE:
            for i in range(2):
                E[a, own + i] = E[a, last + i]
                E[a, last + i] = 0.0


@compiled
def joint(w: Window, landmarks: Ints, pose: Array, at: Array, cov: Array) -> None:
    """Estimates of the last pose and of c landmarks of the window, and their joint covariance.

    Fills pose (3,), at (c, 2) and cov (2c + 3, 2c + 3), the pose last. None of them is held fixed.
    """
    c, n, end = len(landmarks), w.state[SLOTS], w.state[STAGES]
    columns, m = 2 * c + 3, 2 * n + 3
    starts, slots, first = np.full(c, end), np.empty(c, np.int64), end
    for p in range(c):
        slots[p] = w.marks[landmarks[p], SLOT]
        if slots[p] == RETIRED:
            for t in range(end):
                if w.stages[t, NAME] == landmarks[p] and w.stages[t, OWN] != POSE:
                    starts[p], slots[p] = t, w.stages[t, OWN]
            first = min(first, starts[p])
    E, y, mean = np.zeros((columns, 2 * len(w.slots) + 3)), np.empty((3, columns)), np.zeros(columns)
    cov[:] = 0.0
    for t in range(first, end + 1):
        for p in range(c):
            if starts[p] == t:
                E[2 * p, 3 + 2 * slots[p]] = E[2 * p + 1, 4 + 2 * slots[p]] = 1.0
        if t < end:
            through_stage(w, t, E, y, mean, cov)
    for i in range(3):
        E[2 * c + i, i] = 1.0
    T = np.empty((m, columns))  # in the root's order
    for a in range(columns):
        for j in range(2 * n):
            T[j, a] = E[a, 3 + j]
        for i in range(3):
            T[2 * n + i, a] = E[a, i]
    for i in range(m):
        o = i * row_of(m)
        for a in range(columns):
            T[i, a] /= w.work[o + i]
        for j in range(i + 1, m):
            for a in range(columns):
                T[j, a] -= w.work[o + j] * T[i, a]
        d = float(w.work[o + row_of(m) - 1])
        gather(T[i], d, mean, cov)
    for a in range(columns):
        for b in range(a):
            cov[b, a] = cov[a, b]
    last = w.poses[w.state[POSES] - 1]
    for i in range(3):
        pose[i] = last[i] + mean[2 * c + i]
    pose[2] = wrap(pose[2])
    for p in range(c):
        for i in range(2):
            at[p, i] = w.places[landmarks[p], i] + mean[2 * p + i]
