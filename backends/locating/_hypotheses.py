"""Poses that lay a pair of places on a pair of landmarks as far apart, and the best of them.

A place that falls near a landmark counts the logarithm of its likelihood there over that of landmarks strewn about as
densely as there; one that does not costs MISS. Variances are half-traces: of the places and landmarks relative to the
pair that is laid.
"""

from math import atan2, cos, log, pi, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._landmark_grid import nearest

MISS = 3.0
"""Cost of a place without a landmark: logarithm of the odds, 20 to 1, that what is sighted is on the map."""
ALIKE = 0.1
"""Headings (rad) nearer than this are of one hypothesis, where the places fall together too."""


@compiled
def relative(half: Array, q: int, i: int, j: int) -> float:
    """Computes the variance of q's place relative to the middle of i and j, `half` being half-traces."""
    return half[q, q] + 0.25 * (half[i, i] + half[j, j] + 2 * half[i, j]) - half[q, i] - half[q, j]


@compiled
def expect(xy: Array, half: Array, i: int, j: int, widest: float, lever: Array, spread: Array, best: Array) -> None:
    """Computes for each place (k, 2) its squared distance from the middle of i and j over theirs, its variance, and the
    most that it and all after it can add to a score, `best` (k + 1,), `widest` being the most room of a landmark."""
    k = len(xy)
    mx, my = 0.5 * (xy[i, 0] + xy[j, 0]), 0.5 * (xy[i, 1] + xy[j, 1])
    d2 = (xy[i, 0] - xy[j, 0]) ** 2 + (xy[i, 1] - xy[j, 1]) ** 2
    across = (half[i, i] + half[j, j] - 2 * half[i, j]) / d2
    best[k] = 0.0
    for q in range(k - 1, -1, -1):
        r2 = (xy[q, 0] - mx) ** 2 + (xy[q, 1] - my) ** 2
        lever[q] = r2 / d2
        spread[q] = max(relative(half, q, i, j), 0.25 * half[q, q] * 1e-6) + across * r2
        best[q] = best[q + 1] + max(widest - log(2 * pi * spread[q]), -MISS)


@compiled
def weigh(
    pose: Array, a: int, b: int, places: Array, who: Ints, lever: Array, spread: Array, best: Array, least: float,
    gate: float, room: Array, xy: Array, half: Array, corner: Array, cell: float, first: Ints, members: Ints,
) -> float:  # fmt: skip
    """Scores the pose (x, y, cos, sin) laid on landmarks a and b; less than `least` where it cannot reach that."""
    total = 0.0
    x0, y0, c, s = pose
    across = half[a, a] + half[b, b] - 2 * half[a, b]
    about = 0.25 * (half[a, a] + half[b, b] + 2 * half[a, b])
    for q in range(len(places)):
        x, y = x0 + c * places[q, 0] - s * places[q, 1], y0 + s * places[q, 0] + c * places[q, 1]
        seen = spread[q] + lever[q] * across
        n = who[q]
        if n < 0:
            reach = sqrt(gate * (seen + about + max(half[a, a], half[b, b])))
            n = nearest(x, y, reach, xy, corner, cell, first, members)
        gain = -MISS
        if n >= 0:
            variance = seen + max(about + half[n, n] - half[n, a] - half[n, b], 0.0)
            e = ((xy[n, 0] - x) ** 2 + (xy[n, 1] - y) ** 2) / variance
            if e < gate:
                gain = max(room[n] - log(2 * pi * variance) - 0.5 * e, -MISS)
        total += gain
        if total + best[q + 1] < least:
            return total + best[q + 1]
    return total


@compiled
def keep(kept: Array, count: int, x: float, y: float, heading: float, score: float, alike: float) -> int:
    """Puts a pose into `kept` (m, 4), x, y, heading, score; returns how many are there.

    It takes the place of one that is alike, or of the worst, where it is better.
    """
    worst = 0
    for h in range(count):
        turn = wrap(heading - kept[h, 2])
        if (kept[h, 0] - x) ** 2 + (kept[h, 1] - y) ** 2 < alike * alike and abs(turn) < ALIKE:
            if score > kept[h, 3]:
                kept[h, 0], kept[h, 1], kept[h, 2], kept[h, 3] = x, y, heading, score
            return count
        worst = h if kept[h, 3] < kept[worst, 3] else worst
    if count < len(kept):
        worst = count
    elif score <= kept[worst, 3]:
        return count
    kept[worst, 0], kept[worst, 1], kept[worst, 2], kept[worst, 3] = x, y, heading, score
    return min(count + 1, len(kept))


@compiled
def search(
    places: Array, seen: Array, who: Ints, pairs: Ints, low: Ints, high: Ints, gate: float, room: Array, alike: float,
    pair_a: Ints, pair_b: Ints, length: Array, variance: Array,
    xy: Array, half: Array, corner: Array, cell: float, first: Ints, members: Ints, kept: Array,
) -> int:  # fmt: skip
    """Lays the `pairs` (p, 2) of `places` (k, 2) on the pairs of landmarks low[i]:high[i], sorted, both ways.

    Fills `kept` (m, 4) with the best: position of the places' mean (m), heading, score; returns how many there are.
    """
    k, count = len(places), 0
    lever, spread, best, pose = np.empty(k), np.empty(k), np.empty(k + 1), np.empty(4)
    widest = room.max()
    cx, cy = places[:, 0].mean(), places[:, 1].mean()
    for p in range(len(pairs)):
        i, j = pairs[p]
        ex, ey = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
        d, at = sqrt(ex * ex + ey * ey), atan2(ey, ex)
        v = seen[i, i] + seen[j, j] - 2 * seen[i, j]
        expect(places, seen, i, j, widest, lever, spread, best)
        for n in range(low[p], high[p]):
            if (length[n] - d) ** 2 > gate * (v + variance[n]):
                continue
            for way in range(2):
                a, b = (pair_a[n], pair_b[n]) if way == 0 else (pair_b[n], pair_a[n])
                if (who[i] >= 0 and who[i] != a) or (who[j] >= 0 and who[j] != b):
                    continue
                heading = atan2(xy[a, 1] - xy[b, 1], xy[a, 0] - xy[b, 0]) - at
                c, s = cos(heading), sin(heading)
                mx, my = 0.5 * (places[i, 0] + places[j, 0]), 0.5 * (places[i, 1] + places[j, 1])
                pose[0] = 0.5 * (xy[a, 0] + xy[b, 0]) - c * mx + s * my
                pose[1] = 0.5 * (xy[a, 1] + xy[b, 1]) - s * mx - c * my
                pose[2], pose[3] = c, s
                least = kept[:, 3].min() if count == len(kept) else 0.0
                score = weigh(
                    pose, a, b, places, who, lever, spread, best, least, gate, room,
                    xy, half, corner, cell, first, members,
                )  # fmt: skip
                if score > least:
                    x, y = pose[0] + c * cx - s * cy, pose[1] + s * cx + c * cy
                    count = keep(kept, count, x, y, heading, score, alike)
    return count
