"""Inner loop of the comparison of two frames' surfaces."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..se2 import Array, Ints

AGREE, AGAINST, HIDDEN = range(3)


@compiled
def compared(
    seen: NDArray[np.float32],
    other: NDArray[np.float32],
    left: float,
    top: float,
    step: float,
    R: Array,
    t: Array,
    constant_sd: float,
    sd: float,
    gate: float,
    jump: float,
    counts: Ints,
) -> None:
    """Counts the points of `other` (h, w) that `seen` (h, w) shows, contradicts and hides, in `counts` (3,).

    Both are depths, m, on a grid of rays from (`left`, `top`) on, `step` apart; R, t takes points of `other` to `seen`.
    """
    rows, columns = seen.shape
    counts[:] = 0
    for v in range(rows):
        for u in range(columns):
            d = float(other[v, u])
            if not d > 0.0:
                continue
            a, b = (left + u * step) * d, (top + v * step) * d
            z = R[2, 0] * a + R[2, 1] * b + R[2, 2] * d + t[2]
            if not z > 0.1:
                continue
            x = ((R[0, 0] * a + R[0, 1] * b + R[0, 2] * d + t[0]) / z - left) / step
            y = ((R[1, 0] * a + R[1, 1] * b + R[1, 2] * d + t[1]) / z - top) / step
            if not (x >= 0.0 and y >= 0.0 and x < columns - 1 and y < rows - 1):
                continue
            i, j = int(y), int(x)
            p, q, r, s = float(seen[i, j]), float(seen[i, j + 1]), float(seen[i + 1, j]), float(seen[i + 1, j + 1])
            least, most = min(min(p, q), min(r, s)), max(max(p, q), max(r, s))
            if not (least > 0.0 and most - least < jump * least):
                continue
            y, x = y - i, x - j
            # inverse depth is linear on a plane
            there = 1.0 / ((1 - y) * ((1 - x) / p + x / q) + y * ((1 - x) / r + x / s))
            one, two = constant_sd + sd * d * d, constant_sd + sd * there * there
            off = (z - there) / np.sqrt(one * one + two * two)
            if abs(off) < gate:
                counts[AGREE] += 1
            elif off < 0.0:
                counts[AGAINST] += 1
            else:
                counts[HIDDEN] += 1
