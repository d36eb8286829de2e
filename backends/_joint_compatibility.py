"""Joint compatibility branch and bound: Neira and Tardos, IEEE Trans. Robotics and Automation 17(6), 2001.

A hypothesis pairs sightings with landmarks so that the joint distance of all its pairs, with their correlations, is
within the gate of their number. The best one has the most pairs, and of these the least distance. Each new pair adds
its squared distance conditional on the earlier pairs, which takes two more rows of the Cholesky factor.

Two tests differ from the paper's. An error that all pairs have in common, such as a heading that is off by three
standard deviations, puts each of them far off, though jointly they fit: a narrow gate for each alone would turn all
down, and a wrong pair would be left. So the gate of a pair alone is wider for the sightings of one step. For those of
several it is not: odometry makes their own covariances so large that a wide gate would let wrong landmarks in. The
distance of a part of a hypothesis is compared with the gate of the pairs that it may still get, and each pair's
conditional distance, given those before, has a narrow gate.

Signatures err independently of all else: that of a pair adds its own squared distance, whatever the other pairs are.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.kernels._planar import wrap
from ..core.kernels.compiled import compiled
from ..core.se2 import Array, Ints


class Frame(NamedTuple):
    """k sightings, and c landmarks that are expected."""

    z: Array  # (k, 2) range (m), bearing (rad)
    noise: Array  # (2k, 2k) their joint covariance
    expected: Array  # (c, 2)
    cov: Array  # (2c, 2c)


class Gates(NamedTuple):
    """Squared distances below which pairs are taken, and how long a better hypothesis is looked for."""

    alone: float  # of a pair, before it is known which others there are
    match: float  # of a pair, conditional on those before
    joint: Array  # (n,) of m pairs together, by m
    nodes: int  # of the search, at most


@compiled
def search(frame: Frame, of: Ints, d2: Array, gates: Gates, pair: Ints, signed: Array | None = None) -> int:
    """Fills `pair` (k,) with the best hypothesis, -1 for a sighting that is in none; returns the nodes visited.

    `of` (k,) is the step of each sighting, without gaps from 0: a landmark is sighted once per step. d2 (k, c) are the
    individual distances; `signed` (k, c, 2) has the part of signatures in them first. After the most nodes the best one
    so far is taken.
    """
    alone, match, joint, most = gates
    z, noise, expected, cov = frame
    k, c = d2.shape
    rows, m = np.zeros((7, k + 1), np.int64), 0  # in one array: allocating takes as long as a node of the search
    count, order, chosen, tried = rows[0], rows[1], rows[2], rows[3]
    pairs, sighting, landmark = rows[4], rows[5], rows[6]
    for i in range(k):
        pair[i] = -1
        for a in range(c):
            if d2[i, a] < alone:
                count[i] += 1
        if count[i] > 0:  # the sightings with the fewest candidates first
            p = m
            while p > 0 and count[order[p - 1]] > count[i]:
                order[p] = order[p - 1]
                p -= 1
            order[p] = i
            m += 1
    if m == 0:
        return 0
    candidates = np.empty((m, c), np.int64)  # of each level, the nearest first
    for p in range(m):
        i, n = order[p], 0
        for a in range(c):
            if d2[i, a] < alone:
                q = n
                while q > 0 and d2[i, candidates[p, q - 1]] > d2[i, a]:
                    candidates[p, q] = candidates[p, q - 1]
                    q -= 1
                candidates[p, q] = a
                n += 1
    chosen[:m] = -1
    L = np.empty((2 * m + 2, 2 * m + 2))
    w, total = L[2 * m], L[2 * m + 1]
    total[0] = 0.0
    taken = np.zeros((c, k), np.bool_)
    best_pairs, best, nodes, p = 0, np.inf, 0, 0
    while p >= 0:
        if p == m:
            fewer = pairs[m] < best_pairs or (pairs[m] == best_pairs and total[m] >= best)
            if not fewer and total[m] < joint[pairs[m]]:
                best_pairs, best = pairs[m], total[m]
                for q in range(m):
                    pair[order[q]] = chosen[q]
            p -= 1
            continue
        i = order[p]
        if chosen[p] >= 0:  # back at this level: its last choice is undone
            taken[chosen[p], of[i]] = False
            chosen[p] = -1
        nodes += 1
        if nodes > most:
            break
        reach, down = pairs[p] + m - p, False
        if reach > best_pairs or (reach == best_pairs and total[p] < best):
            while tried[p] < count[i]:
                a = candidates[p, tried[p]]
                tried[p] += 1
                if taken[a, of[i]]:
                    continue
                n = pairs[p]
                more = extended(z, noise, expected, cov, i, a, sighting, landmark, n, L, w)
                if signed is not None:
                    more += signed[i, a, 0]
                reached = total[p] + more
                if reached < joint[reach] and (n == 0 or more < match):
                    sighting[n], landmark[n] = i, a
                    pairs[p + 1], total[p + 1] = n + 1, reached
                    chosen[p], taken[a, of[i]] = a, True
                    down = True
                    break
            if not down and tried[p] == count[i]:  # last, the sighting is left alone
                tried[p] += 1
                pairs[p + 1], total[p + 1] = pairs[p], total[p]
                down = True
        if down:
            p += 1
            tried[p] = 0
        else:
            p -= 1
    return nodes


# Takes the arrays of a `Frame`: it is called at each node, and taking a tuple apart counts references.
@compiled
def extended(
    z: Array, noise: Array, expected: Array, cov: Array, i: int, a: int, sighting: Ints, landmark: Ints, n: int,
    L: Array, w: Array,
) -> float:  # fmt: skip
    """Squared distance of sighting i from landmark a, conditional on n pairs; infinite where there is none.

    Fills rows 2n and 2n + 1 of the Cholesky factor L of the pairs' joint covariance, and of the whitened residuals w.
    """
    top = 2 * n
    for t in range(n):
        j, b = sighting[t], landmark[t]
        for h in range(2):
            for g in range(2):
                value = cov[2 * a + h, 2 * b + g] + noise[2 * i + h, 2 * j + g]
                for e in range(2 * t + g):
                    value -= L[top + h, e] * L[2 * t + g, e]
                L[top + h, 2 * t + g] = value / L[2 * t + g, 2 * t + g]
    s00 = cov[2 * a, 2 * a] + noise[2 * i, 2 * i]
    s10 = cov[2 * a + 1, 2 * a] + noise[2 * i + 1, 2 * i]
    s11 = cov[2 * a + 1, 2 * a + 1] + noise[2 * i + 1, 2 * i + 1]
    y0, y1 = z[i, 0] - expected[a, 0], wrap(z[i, 1] - expected[a, 1])
    for e in range(top):
        s00 -= L[top, e] * L[top, e]
        s10 -= L[top, e] * L[top + 1, e]
        s11 -= L[top + 1, e] * L[top + 1, e]
        y0 -= L[top, e] * w[e]
        y1 -= L[top + 1, e] * w[e]
    if not s00 > 0.0:
        return np.inf
    l00 = sqrt(s00)
    l10 = s10 / l00
    rest = s11 - l10 * l10
    if not rest > 0.0:
        return np.inf
    l11 = sqrt(rest)
    w[top] = y0 / l00
    w[top + 1] = (y1 - l10 * w[top]) / l11
    L[top, top], L[top + 1, top], L[top + 1, top + 1] = l00, l10, l11
    return w[top] * w[top] + w[top + 1] * w[top + 1]
