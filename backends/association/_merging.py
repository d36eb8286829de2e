"""Which recent landmarks are old ones: the likeliest group of pairs whose differences agree, in compiled code."""

from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

ALONE = -1
"""In place of an old landmark: none."""

TWO = 2  # pairs that a group has at least


@compiled
def difference(xy: Array, cov: Array, i: int, a: int, old: int, chosen: Ints, m: int, row: Array, h: Array) -> None:
    """The covariance `row` (2, 2m + 2) of pair (i, a) with the m chosen ones and itself, and its difference h (2,).

    A pair's difference is the place of the recent landmark i less that of the old one a, which is at entries
    2 (`old` + a) of `cov`; `chosen` (m, 2) are pairs.
    """
    p, q = 2 * i, 2 * (old + a)
    for g in range(2):
        h[g] = xy[i, g] - xy[old + a, g]
    for k in range(m + 1):
        r = p if k == m else 2 * chosen[k, 0]
        s = q if k == m else 2 * (old + chosen[k, 1])
        for g in range(2):
            for e in range(2):
                row[g, 2 * k + e] = cov[p + g, r + e] - cov[p + g, s + e] - cov[q + g, r + e] + cov[q + g, s + e]


@compiled
def weigh(L: Array, y: Array, m: int, row: Array, h: Array, floor: float) -> tuple[float, float]:
    """Squared distance and logarithm of the density of a difference, given those of m pairs: and how L and y go on.

    L (2m, 2m) is the Cholesky factor of their covariance, y what is left of them by it. `row` and `h` are overwritten
    by the next rows of L and y. `floor` (m²) is added to the covariance of each difference.
    """
    n = 2 * m
    for g in range(2):
        row[g, n + g] += floor
    for g in range(2):
        for j in range(n):
            total = row[g, j]
            for k in range(j):
                total -= row[g, k] * L[j, k]
            row[g, j] = total / L[j, j]
            h[g] -= row[g, j] * y[j]
    s00, s10, s11 = row[0, n], row[1, n], row[1, n + 1]
    for j in range(n):
        s00 -= row[0, j] * row[0, j]
        s10 -= row[1, j] * row[0, j]
        s11 -= row[1, j] * row[1, j]
    s00 = max(s00, floor)
    l00 = sqrt(s00)
    l10 = s10 / l00
    l11 = sqrt(max(s11 - l10 * l10, floor))
    row[0, n], row[0, n + 1], row[1, n], row[1, n + 1] = l00, 0.0, l10, l11
    h[0] = h[0] / l00
    h[1] = (h[1] - l10 * h[0]) / l11
    d2 = h[0] * h[0] + h[1] * h[1]
    return d2, -0.5 * d2 - log(2 * pi * l00 * l11)


@compiled
def extend(L: Array, y: Array, m: int, row: Array, h: Array) -> None:
    """Appends the rows that `weigh` has left."""
    n = 2 * m
    for g in range(2):
        for j in range(n + 2):
            L[n + g, j] = row[g, j]
        y[n + g] = h[g]


@compiled
def likeliest_group(
    xy: Array, cov: Array, allowed: NDArray[np.bool], gates: Array, density: float, floor: float, seeds: int,
    most_weighed: int, against: Ints, pair: Ints,
) -> float:  # fmt: skip
    """Finds which of b recent landmarks are old ones, and by the logarithm how much likelier that is than none.

    xy (b + n, 2) and cov (2 (b + n), 2 (b + n)) are of the recent landmarks, then of the old; `allowed` (b, n) pairs
    may be one. A group is grown from each two pairs, of the first `seeds` recent landmarks, as long as a pair raises
    its likelihood over chance: that of old landmarks strewn by `density` (1/m²). Its squared distance is within
    gates[pairs]. A group that has half of its pairs or more in common with `against` (b,) is passed over. `pair` (b,)
    gets the best group; none where more than `most_weighed` pairs would have to be weighed.
    """
    b, n = allowed.shape
    L, y, row, h = np.zeros((2 * b, 2 * b)), np.zeros(2 * b), np.zeros((2, 2 * b + 2)), np.zeros(2)
    chosen, used, most, own = np.zeros((b + 1, 2), np.int64), np.zeros(n, np.bool_), 0.0, np.full(b, ALONE)
    chance = log(density)
    pair[:] = ALONE
    weighed = 0
    for i in range(min(seeds, b)):
        for a in range(n):
            if not allowed[i, a]:
                continue
            difference(xy, cov, i, a, b, chosen, 0, row, h)
            first, gain0 = weigh(L, y, 0, row, h, floor)
            if first > gates[1]:
                continue
            for j in range(i + 1, b):
                for c in range(n):
                    if not allowed[j, c] or c == a:
                        continue
                    weighed += 1
                    if weighed > most_weighed:
                        pair[:] = ALONE
                        return 0.0
                    difference(xy, cov, i, a, b, chosen, 0, row, h)
                    weigh(L, y, 0, row, h, floor)
                    extend(L, y, 0, row, h)
                    chosen[0, 0], chosen[0, 1] = i, a
                    difference(xy, cov, j, c, b, chosen, 1, row, h)
                    second, gain1 = weigh(L, y, 1, row, h, floor)
                    if first + second > gates[TWO] or gain1 < chance:
                        continue
                    extend(L, y, 1, row, h)
                    chosen[1, 0], chosen[1, 1] = j, c
                    used[:] = False
                    used[a] = used[c] = True
                    own[:] = ALONE
                    own[i], own[j] = a, c
                    m, d2, gain = 2, first + second, gain0 + gain1 - 2 * chance
                    for k in range(b):
                        if own[k] != ALONE:
                            continue
                        best, best_gain = ALONE, chance
                        for e in range(n):
                            if not allowed[k, e] or used[e]:
                                continue
                            weighed += 1
                            difference(xy, cov, k, e, b, chosen, m, row, h)
                            more, likelier = weigh(L, y, m, row, h, floor)
                            if likelier > best_gain and d2 + more <= gates[m + 1]:
                                best, best_gain = e, likelier
                        if best == ALONE:
                            continue
                        difference(xy, cov, k, best, b, chosen, m, row, h)
                        more, likelier = weigh(L, y, m, row, h, floor)
                        extend(L, y, m, row, h)
                        chosen[m, 0], chosen[m, 1] = k, best
                        own[k], used[best] = best, True
                        m, d2, gain = m + 1, d2 + more, gain + likelier - chance
                    if gain > most:
                        same = 0
                        for k in range(b):
                            same += own[k] != ALONE and own[k] == against[k]
                        if 2 * same < m:
                            most = gain
                            pair[:] = own
    return most
