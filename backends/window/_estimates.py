"""Estimates from a chain of stages: the root in triangular form, one variable with its covariance, and all of them.

J is |R x - d|^2. If E are the columns of the identity that select a variable, R' Y = E is solved along the chain from
that variable's stage on. The variable is then Y' d, and its covariance Y' Y.
"""

import numpy as np

from ...core.kernels._cholesky import factor, row_of, unsigned
from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ..smoothing._front import last_three, solve_rows
from ._chain import DONE, INDEFINITE
from ._window import AT, BEGIN, MANY, NAME, NOW, OWN, POSE, POSES, SLOTS, STAGES, Window, row


@compiled
def factor_front(w: Window) -> int:
    """Factors the front, its pose last, into [R d] in `work`."""
    n, r, F, T = 2 * w.state[SLOTS], row(w), w.front, w.work
    m = n + 3
    c = row_of(m)
    T[: m * c] = 0.0
    for i in range(n):
        to, of = unsigned(i * c), unsigned((3 + i) * r + 3)
        for j in range(unsigned(i), unsigned(n)):
            T[to + j] = F[of + j]
        for j in range(3):
            T[i * c + n + j] = F[j * r + 3 + i]
        T[i * c + c - 1] = F[(3 + i) * r + r - 1]
    for i in range(3):
        for j in range(i, 3):
            T[(n + i) * c + n + j] = F[i * r + j]
        T[(n + i) * c + c - 1] = F[i * r + r - 1]
    return DONE if factor(T, m, m) else INDEFINITE


@compiled
def collect(y0: float, y1: float, y2: float, d: float, mean: Array, cov: Array) -> None:
    """Adds one row y of Y to the estimate Y' d and to the covariance Y' Y."""
    mean[0] += y0 * d
    mean[1] += y1 * d
    mean[2] += y2 * d
    cov[0, 0] += y0 * y0
    cov[1, 1] += y1 * y1
    cov[2, 2] += y2 * y2
    cov[0, 1] = cov[1, 0] = cov[0, 1] + y0 * y1
    cov[0, 2] = cov[2, 0] = cov[0, 2] + y0 * y2
    cov[1, 2] = cov[2, 1] = cov[1, 2] + y1 * y2


@compiled
def through(w: Window, t: int, E: Array, mean: Array, cov: Array, y: Array) -> None:
    """Propagates E (3, m), in the front's order, through stage `t`; y (3, 3) is scratch."""
    k, n, o = int(w.stages[t, OWN]), int(w.stages[t, MANY]), int(w.stages[t, BEGIN])
    R, width = w.reals, 3 if k == POSE else 2
    c, own = width + 2 * n + 4, 0 if k == POSE else 3 + 2 * k
    for i in range(width):
        for a in range(3):
            s = E[a, own + i]
            for j in range(i):
                s -= R[o + j * c + i] * y[j, a]
            y[i, a] = s / R[o + i * c + i]
        collect(y[i, 0], y[i, 1], y[i, 2], R[o + i * c + c - 1], mean, cov)
    if k == POSE:
        for a in range(3):
            E[a, 0] = E[a, 1] = E[a, 2] = 0.0
    for i in range(width):
        of = unsigned(o + i * c + width)
        y0, y1, y2 = y[i, 0], y[i, 1], y[i, 2]
        for j in range(unsigned(3 + 2 * n)):
            E[0, j] -= y0 * R[of + j]
            E[1, j] -= y1 * R[of + j]
            E[2, j] -= y2 * R[of + j]
    if k != POSE:
        last = 3 + 2 * (n - 1)
        for a in range(3):
            for i in range(2):
                E[a, own + i] = E[a, last + i]
                E[a, last + i] = 0.0


@compiled
def through_root(w: Window, i: int, m: int, E: Array, mean: Array, cov: Array) -> None:
    """Likewise through row `i` of the root, E being in its order."""
    c = row_of(m)
    o = unsigned(i * c)
    d = w.work[o + unsigned(i)]
    y0, y1, y2 = E[0, i] / d, E[1, i] / d, E[2, i] / d
    for j in range(unsigned(i + 1), unsigned(m)):
        t = w.work[o + j]
        E[0, j] -= y0 * t
        E[1, j] -= y1 * t
        E[2, j] -= y2 * t
    collect(y0, y1, y2, w.work[o + unsigned(c - 1)], mean, cov)


@compiled
def look(w: Window, t: int, at: int, mean: Array, cov: Array) -> None:
    """Offset of the variable at row `at` of the front, mean (3,), and its covariance (3, 3), at stage `t`.

    Of a landmark, only the first two entries are used.
    """
    n, y = w.state[SLOTS], np.empty((3, 3))
    E = np.zeros((3, 2 * len(w.slots) + 3))
    for a in range(3):
        mean[a] = cov[a, 0] = cov[a, 1] = cov[a, 2] = 0.0
        if at == 0 or a < 2:
            E[a, at + a] = 1.0
    first = 0 if t < w.state[STAGES] else (2 * n if at == 0 else at - 3)
    for s in range(t, w.state[STAGES]):
        through(w, s, E, mean, cov, y)
    m = 2 * n + 3
    for a in range(3):
        x0, x1, x2 = E[a, 0], E[a, 1], E[a, 2]
        for j in range(2 * n):
            E[a, j] = E[a, j + 3]
        E[a, 2 * n], E[a, 2 * n + 1], E[a, 2 * n + 2] = x0, x1, x2
    for i in range(first, m):
        through_root(w, i, m, E, mean, cov)


@compiled
def look_at_pose(w: Window, i: int, pose: Array, cov: Array) -> None:
    """Pose `i`'s estimate (3,) and its covariance (3, 3)."""
    if i < w.state[POSES] - 1:
        first_row = 0 * i  # a literal 0 has a type of its own: `look` would be compiled twice
        look(w, w.rows[i, AT], first_row, pose, cov)
        for a in range(3):
            pose[a] += w.poses[i, a]
        pose[2] = wrap(pose[2])
    else:
        last_pose(w, pose, cov)


@compiled
def last_pose(w: Window, pose: Array, cov: Array) -> None:
    """The last pose's estimate (3,) and its covariance (3, 3)."""
    last_three(w.work, 2 * w.state[SLOTS] + 3, pose, cov)
    at = w.poses[w.state[POSES] - 1]
    pose[0], pose[1], pose[2] = at[0] + pose[0], at[1] + pose[1], wrap(at[2] + pose[2])


@compiled
def offsets(w: Window, poses: Array, places: Array) -> None:
    """Offsets of all poses (P, 3) and landmarks (V, 2) in the chain from their linearisation points."""
    n = w.state[SLOTS]
    m = 2 * n + 3
    y, z = np.empty(m), np.empty(2 * len(w.slots) + 6)
    solve_rows(w.work, 0, row_of(m), m, m, y)
    now = np.empty(2 * len(w.slots) + 3)  # in the front's order
    for k in range(n):
        v = w.slots[k, NOW]
        places[v, 0], places[v, 1] = y[2 * k], y[2 * k + 1]
        now[3 + 2 * k], now[4 + 2 * k] = y[2 * k], y[2 * k + 1]
    for a in range(3):
        poses[w.state[POSES] - 1, a] = now[a] = y[2 * n + a]
    for t in range(w.state[STAGES] - 1, -1, -1):
        k, n, v = w.stages[t, OWN], w.stages[t, MANY], w.stages[t, NAME]
        width, size = 3 if k == POSE else 2, 3 + 2 * n
        if k != POSE:
            now[size - 2], now[size - 1] = now[3 + 2 * k], now[4 + 2 * k]
            now[3 + 2 * k] = now[4 + 2 * k] = 0.0  # unused by the row, but possibly NaN
        for j in range(size):
            z[width + j] = now[j]
        solve_rows(w.reals, w.stages[t, BEGIN], width + size + 1, width, width + size, z)
        for a in range(width):
            if k == POSE:
                poses[v, a] = now[a] = z[a]
            else:
                places[v, a] = now[3 + 2 * k + a] = z[a]
