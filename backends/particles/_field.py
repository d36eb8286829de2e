"""Weights of particles by a likelihood field: Probabilistic Robotics, table 6.3, over landmarks."""

from math import exp, log, pi, sqrt

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..locating._map_index import AREA, MapIndex, nearest
from ._particles import cosine_sine

ASTRAY = 0.05
"""Share of sightings that are not of the nearest landmark: they are equally likely anywhere (z_rand of the table)."""
GATE = 13.8
"""Squared standard deviations beyond which a landmark is not looked for: exp(-GATE / 2) is 0.001."""


@compiled
def weigh(on: MapIndex, poses: Array, who: Ints, z: Array, z_cov: Array, widen: float, log_weights: Array) -> None:
    """Adds to `log_weights` (M,) the logarithm of the likelihood of the sightings z (k, 2) at `poses` (5, M).

    `who` (k,) is the landmark of each by its row in the map, -1: the nearest. Standard
    deviations are `widen` times those of the sightings and landmarks.
    """
    xy, half = on.xy, on.half
    for i in range(len(z)):
        r = z[i, 0]
        cb, sb = cosine_sine(z[i, 1])
        widest = half[who[i], who[i]] if who[i] >= 0 else half.max()
        v = widen * widen * (0.5 * (z_cov[i, 0, 0] + r * r * z_cov[i, 1, 1]) + widest)
        reach, peak, floor = sqrt(GATE * v), (1 - ASTRAY) / (2 * pi * v), ASTRAY / on.box[AREA]
        for m in range(poses.shape[1]):
            x = poses[0, m] + r * (poses[3, m] * cb - poses[4, m] * sb)
            y = poses[1, m] + r * (poses[4, m] * cb + poses[3, m] * sb)
            n = who[i] if who[i] >= 0 else nearest(on, x, y, reach)
            likelihood = floor
            if n >= 0:
                likelihood += peak * exp(-0.5 * ((xy[n, 0] - x) ** 2 + (xy[n, 1] - y) ** 2) / v)
            log_weights[m] += log(likelihood)
