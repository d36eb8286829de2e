"""Sightings of one landmark at several steps as one place, and the rows of a joint covariance."""

from ...core.kernels._arrays import Arrays, Integers, Table
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints


class SightedPlaces(Arrays):
    """Landmarks as sighted: k places."""

    xy: Table  # (k, 2) m, in the frame of the last step's pose
    cov: Table  # (2k, 2k)
    half: Table  # (k, k) half-traces of its blocks
    who: Integers  # (k,) the landmark by its row in the map, -1: any
    chosen: Integers  # (s,) the place of each sighting, -1: not used


@compiled
def apart(xy: Array, cov: Array, i: int, j: int) -> float:
    """Computes the squared Mahalanobis distance of places i and j of `xy` (k, 2), jointly of `cov` (2k, 2k)."""
    a, b = 2 * i, 2 * j
    xx = cov[a, a] + cov[b, b] - 2 * cov[a, b]
    yy = cov[a + 1, a + 1] + cov[b + 1, b + 1] - 2 * cov[a + 1, b + 1]
    xy_ = cov[a, a + 1] + cov[b, b + 1] - cov[a, b + 1] - cov[a + 1, b]
    x, y = xy[i, 0] - xy[j, 0], xy[i, 1] - xy[j, 1]
    determinant = xx * yy - xy_ * xy_
    return (yy * x * x - 2 * xy_ * x * y + xx * y * y) / determinant if determinant > 0 else 0.0


@compiled
def grouped(ids: Ints, named: Ints, step: Ints, xy: Array, cov: Array, gate: float, group: Ints) -> int:
    """Numbers the landmark of each sighting in `group` (k,); returns how many there are.

    Those of one id belong together where `named` (k,) is 1. Another joins the nearest within `gate` of what was seen at
    earlier steps; two of a step are two.
    """
    groups = 0
    for i in range(len(ids)):
        group[i] = -1
        best = gate
        for j in range(i):
            if named[i] == 1:
                if named[j] == 1 and ids[j] == ids[i]:
                    group[i] = group[j]
            elif named[j] == 0 and step[j] < step[i]:
                taken = False
                for other in range(i - 1, -1, -1):
                    if step[other] < step[i]:
                        break
                    taken = taken or group[other] == group[j]
                d2 = best if taken else apart(xy, cov, i, j)
                if d2 < best:
                    best, group[i] = d2, group[j]
        if group[i] < 0:
            group[i] = groups
            groups += 1
    return groups


@compiled
def merge(group: Ints, xy: Array, cov: Array, weight: Array, to: Array, to_cov: Array) -> None:
    """Averages the sightings of each group by `weight` (k,), which is overwritten, into `to` (g, 2) and its joint
    covariance `to_cov` (2g, 2g), both zero before."""
    k = len(group)
    for g in range(len(to)):
        total = 0.0
        for i in range(k):
            total += weight[i] if group[i] == g else 0.0
        for i in range(k):
            if group[i] == g:
                weight[i] /= total
    for i in range(k):
        a = 2 * group[i]
        to[group[i], 0] += weight[i] * xy[i, 0]
        to[group[i], 1] += weight[i] * xy[i, 1]
        for j in range(k):
            b, w = 2 * group[j], weight[i] * weight[j]
            for g in range(2):
                for h in range(2):
                    to_cov[a + g, b + h] += w * cov[2 * i + g, 2 * j + h]
