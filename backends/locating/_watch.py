"""The likelihood of a step's sightings at a pose on the map, over chance."""

from math import cos, log, pi, sin, sqrt

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._hypotheses import MISS
from ._map_index import AREA, MapIndex, largest_variance, nearest

GATE = 13.8
"""The 99.9 % point of chi-square with two degrees of freedom: farther landmarks are not looked at."""


@compiled
def evidence(on: MapIndex, pose: Array, drift: Array, who: Ints, z: Array, z_cov: Array) -> float:
    """Computes the logarithm of the likelihood over chance of the sightings z (k, 2) at the pose (3,), -MISS each at
    least.

    `who` (k,) is the landmark of each by its row, -1: any, -2: one that is not on the map, which says nothing. The pose
    is taken to be as unsure as a sighting, and less sure by `drift` (2,), the variances of a step's position (m^2) and
    heading (rad^2).
    """
    xy, total, widest = on.xy, 0.0, largest_variance(on)
    for i in range(len(z)):
        if who[i] == -2:
            continue
        r, at = z[i, 0], pose[2] + z[i, 1]
        x, y = pose[0] + r * cos(at), pose[1] + r * sin(at)
        seen = z_cov[i, 0, 0] + r * r * z_cov[i, 1, 1] + drift[0] + r * r * drift[1]
        n, space = who[i], log(on.box[AREA])
        if n < 0:
            n = nearest(on, x, y, sqrt(GATE * (seen + widest)))
            space = on.room[n] if n >= 0 else 0.0
        gain = -MISS
        if n >= 0:
            v = seen + on.half[n, n]
            gain = space - log(2 * pi * v) - 0.5 * ((xy[n, 0] - x) ** 2 + (xy[n, 1] - y) ** 2) / v
        total += max(gain, -MISS)
    return total
