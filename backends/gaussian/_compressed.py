"""Transfers between the whole state and its active part: fetch a landmark, and write the part back.

The equations are in `compressed.py`; here P is the whole covariance at the part's last write-back, A the active part,
in the order of `members`, and `transition`, `information` and `pull` are Phi, Psi and theta. `whole` and `part` are the
addresses of their `JointArrays`.
"""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._joint_arrays import belief_at
from ._triangle import entry, put, row, take


@compiled
def load(whole: int, part: int, members: Ints, a: int) -> None:
    """Copies the landmarks `members[:a]` from a whole without deferred updates."""
    w, p = belief_at(whole), belief_at(part)
    mean, cross, flat, part_mean, part_cross, part_flat = w.mean, w.cross, w.flat, p.mean, p.cross, p.flat
    for i in range(2 * a):
        at = 2 * members[i // 2] + i % 2
        part_mean[3 + i] = mean[3 + at]
        for j in range(3):
            part_cross[j, i] = cross[j, at]
        own = row(i)
        for j in range(i + 1):
            part_flat[own + j] = entry(flat, at, 2 * members[j // 2] + j % 2)


@compiled
def fetch(whole: int, part: int, members: Ints, a: int) -> None:
    """Makes `members[a]` the part's landmark a: its rows are P - P_mA Psi P_A, and P_mA Phi' with the part."""
    w, p = belief_at(whole), belief_at(part)
    mean, cross, flat, part_mean, part_cross, part_flat = w.mean, w.cross, w.flat, p.mean, p.cross, p.flat
    transition, information, pull = p.transition, p.information, p.pull
    m = 3 + 2 * a
    d, e = np.empty((2, m)), np.zeros((2, m))
    for h in range(2):
        at = 2 * members[a] + h
        for j in range(3):
            d[h, j] = cross[j, at]
        for j in range(2 * a):
            d[h, 3 + j] = entry(flat, at, 2 * members[j // 2] + j % 2)
        gained = 0.0
        for j in range(m):
            gained += d[h, j] * pull[j]
        part_mean[3 + 2 * a + h] = mean[3 + at] + gained
    for i in range(m):  # of Psi, the lower triangle
        for h in range(2):
            for j in range(i):
                e[h, j] += d[h, i] * information[i, j]
                e[h, i] += d[h, j] * information[i, j]
            e[h, i] += d[h, i] * information[i, i]
    for h in range(2):
        at, i = 2 * members[a] + h, 2 * a + h
        for j in range(m):
            total = 0.0
            for q in range(m):
                total += transition[j, q] * d[h, q]
            if j < 3:
                part_cross[j, i] = total
            else:
                part_flat[row(i) + j - 3] = total
        for g in range(h + 1):
            own = entry(flat, at, 2 * members[a] + g)
            for j in range(m):
                own -= e[h, j] * d[g, j]
            part_flat[row(i) + 2 * a + g] = own
        for j in range(m):
            transition[3 + i, j] = -e[h, j]
        transition[3 + i, 3 + i] = 1.0


@compiled
def rows_of(cross: Array, flat: Array, members: Ints, a: int, n: int, out: Array) -> None:
    """P_A, the whole's rows of the pose and of the part's landmarks, into out (3 + 2a, n)."""
    for j in range(n):
        for i in range(3):
            out[i, j] = cross[i, j]
    for i in range(a):
        take(flat, 2 * members[i], n, out[3 + 2 * i : 5 + 2 * i])


@compiled
def give_back(whole: int, part: int, n: int, members: Ints, a: int, rows: Array) -> None:
    """Writes the part back: its own blocks, and `rows` (3 + 2a, n), Phi P_A, its covariance with the rest."""
    w, p = belief_at(whole), belief_at(part)
    mean, cross, flat, part_mean, part_cross, part_flat = w.mean, w.cross, w.flat, p.mean, p.cross, p.flat
    for i in range(2 * a):
        at = 2 * members[i // 2] + i % 2
        mean[3 + at] = part_mean[3 + i]
        for j in range(3):
            rows[j, at] = part_cross[j, i]
        for j in range(2 * a):
            rows[3 + i, 2 * members[j // 2] + j % 2] = entry(part_flat, i, j)
    for j in range(n):
        for i in range(3):
            cross[i, j] = rows[i, j]
    for i in range(a):
        put(flat, 2 * members[i], n, rows[3 + 2 * i : 5 + 2 * i])
