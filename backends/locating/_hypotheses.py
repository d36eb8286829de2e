"""Poses that lay a pair of places on a pair of landmarks as far apart, and the best of them.

A place that falls near a landmark counts the logarithm of its likelihood there over that of landmarks strewn about as
densely as there; one that does not costs MISS. Variances are half-traces: of the places and landmarks relative to the
pair that is laid.
"""

from math import atan2, cos, log, pi, sin, sqrt

import numpy as np

from ...core.kernels._arrays import Arrays, Integers, IntegerTable, Numbers, Table
from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._map_index import MapIndex, nearest
from ._places import SightedPlaces

MISS = 3.0
"""Cost of a place without a landmark: logarithm of the odds, 20 to 1, that what is sighted is on the map."""
ALIKE = 0.1
"""Headings (rad) nearer than this are of one hypothesis, where the places fall together too."""


class Hypotheses(Arrays):
    """Pairs of k places to be laid on pairs of landmarks, and the best poses that do."""

    pairs: IntegerTable  # (p, 2) of places
    low: Integers  # (p,) where the pairs of landmarks begin on which each may lie
    high: Integers  # (p,) and where they end
    lever: Numbers  # (k,) squared distance of each place from the middle of the pair that is laid, over the pair's
    spread: Numbers  # (k,) its variance, m^2
    best: Numbers  # (k + 1,) the most that it and all after it can add to a score
    kept: Table  # (m, 4) position of the places' mean, m, heading, and score


@compiled
def relative(half: Array, q: int, i: int, j: int) -> float:
    """Computes the variance of q's place relative to the middle of i and j, `half` being half-traces."""
    return half[q, q] + 0.25 * (half[i, i] + half[j, j] + 2 * half[i, j]) - half[q, i] - half[q, j]


@compiled
def expect(h: Hypotheses, places: SightedPlaces, i: int, j: int, widest: float) -> None:
    """Computes lever, spread and best of each place for the pair i, j, `widest` being the most room of a landmark."""
    xy, half, k = places.xy, places.half, len(places.xy)
    mx, my = 0.5 * (xy[i, 0] + xy[j, 0]), 0.5 * (xy[i, 1] + xy[j, 1])
    d2 = (xy[i, 0] - xy[j, 0]) ** 2 + (xy[i, 1] - xy[j, 1]) ** 2
    across = (half[i, i] + half[j, j] - 2 * half[i, j]) / d2
    h.best[k] = 0.0
    for q in range(k - 1, -1, -1):
        r2 = (xy[q, 0] - mx) ** 2 + (xy[q, 1] - my) ** 2
        h.lever[q] = r2 / d2
        h.spread[q] = max(relative(half, q, i, j), 0.25 * half[q, q] * 1e-6) + across * r2
        h.best[q] = h.best[q + 1] + max(widest - log(2 * pi * h.spread[q]), -MISS)


@compiled
def weigh(
    h: Hypotheses, places: SightedPlaces, on: MapIndex, pose: Array, a: int, b: int, least: float, gate: float
) -> float:
    """Scores the pose (x, y, cos, sin) laid on landmarks a and b; less than `least` where it cannot reach that."""
    spots, who, xy, half, total = places.xy, places.who, on.xy, on.half, 0.0
    x0, y0, c, s = pose
    across = half[a, a] + half[b, b] - 2 * half[a, b]
    about = 0.25 * (half[a, a] + half[b, b] + 2 * half[a, b])
    for q in range(len(spots)):
        x, y = x0 + c * spots[q, 0] - s * spots[q, 1], y0 + s * spots[q, 0] + c * spots[q, 1]
        seen = h.spread[q] + h.lever[q] * across
        n = who[q]
        if n < 0:
            reach = sqrt(gate * (seen + about + max(half[a, a], half[b, b])))
            n = nearest(on, x, y, reach)
        gain = -MISS
        if n >= 0:
            variance = seen + max(about + half[n, n] - half[n, a] - half[n, b], 0.0)
            e = ((xy[n, 0] - x) ** 2 + (xy[n, 1] - y) ** 2) / variance
            if e < gate:
                gain = max(on.room[n] - log(2 * pi * variance) - 0.5 * e, -MISS)
        total += gain
        if total + h.best[q + 1] < least:
            return total + h.best[q + 1]
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
def search(h: Hypotheses, places: SightedPlaces, on: MapIndex, gate: float, alike: float) -> int:
    """Lays the pairs of places on the pairs of landmarks low[p]:high[p], both ways; returns how many poses are kept.

    Positions nearer than `alike`, m, are of one hypothesis.
    """
    spots, seen, who, xy, kept = places.xy, places.half, places.who, on.xy, h.kept
    pose, count = np.empty(4), 0
    widest = on.room.max()
    cx, cy = spots[:, 0].mean(), spots[:, 1].mean()
    for p in range(len(h.pairs)):
        i, j = h.pairs[p]
        ex, ey = spots[i, 0] - spots[j, 0], spots[i, 1] - spots[j, 1]
        d, at = sqrt(ex * ex + ey * ey), atan2(ey, ex)
        v = seen[i, i] + seen[j, j] - 2 * seen[i, j]
        expect(h, places, i, j, widest)
        for n in range(h.low[p], h.high[p]):
            if (on.length[n] - d) ** 2 > gate * (v + on.variance[n]):
                continue
            for way in range(2):
                a, b = (on.pair_a[n], on.pair_b[n]) if way == 0 else (on.pair_b[n], on.pair_a[n])
                if (who[i] >= 0 and who[i] != a) or (who[j] >= 0 and who[j] != b):
                    continue
                heading = atan2(xy[a, 1] - xy[b, 1], xy[a, 0] - xy[b, 0]) - at
                c, s = cos(heading), sin(heading)
                mx, my = 0.5 * (spots[i, 0] + spots[j, 0]), 0.5 * (spots[i, 1] + spots[j, 1])
                pose[0] = 0.5 * (xy[a, 0] + xy[b, 0]) - c * mx + s * my
                pose[1] = 0.5 * (xy[a, 1] + xy[b, 1]) - s * mx - c * my
                pose[2], pose[3] = c, s
                least = kept[:, 3].min() if count == len(kept) else 0.0
                score = weigh(h, places, on, pose, a, b, least, gate)
                if score > least:
                    x, y = pose[0] + c * cx - s * cy, pose[1] + s * cx + c * cy
                    count = keep(kept, count, x, y, heading, score, alike)
    return count
