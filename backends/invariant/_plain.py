"""The invariant filter's belief in plain coordinates, and the sightings that it expects after a motion."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._expected_arrays import expected_at
from .._rules import conclude
from .._vicinity import choose, expect, places_at
from ..gaussian._triangle import row
from ._arrays import group_at
from ._invariant import RANK


@compiled
def plain_joint(belief: int, slots: Ints, at: Array, cov: Array) -> None:
    """Places, m from the origin, and joint covariance in plain coordinates of n landmarks and the pose, that last.

    Fills at (n, 2) and cov (2n + 3, 2n + 3). An error of a place is that of the group plus the heading's times J f.
    """
    g = group_at(belief)
    pose, mean, strip, flat, owed, owing = g.pose, g.mean, g.strip, g.flat, g.owed, g.owing
    n = len(slots)
    c = 2 * n
    lever = np.empty(c + 2)
    for a in range(n):
        i = 2 * slots[a]
        at[a, 0], at[a, 1] = mean[i], mean[i + 1]
        lever[2 * a], lever[2 * a + 1] = -mean[i + 1], mean[i]
    lever[c], lever[c + 1] = -pose[1], pose[0]
    turn, w = strip[2, 2], np.empty(c)
    for a in range(c):
        i = 2 * slots[a // 2] + a % 2
        for b in range(a + 1):
            j = 2 * slots[b // 2] + b % 2
            cov[a, b] = flat[row(i) + j] if i >= j else flat[row(j) + i]
    for m in range(RANK):
        less = m < owing[0]
        if not less and m < RANK - owing[1]:
            continue
        for a in range(c):
            w[a] = owed[m, 2 * slots[a // 2] + a % 2]
        for a in range(c):
            weight, entries = -w[a] if less else w[a], cov[a]
            for b in range(a + 1):
                entries[b] += weight * w[b]
    for a in range(c):
        i = 2 * slots[a // 2] + a % 2
        for b in range(a + 1):
            j = 2 * slots[b // 2] + b % 2
            value = cov[a, b]
            value += lever[a] * strip[2, 3 + j] + lever[b] * strip[2, 3 + i] + turn * lever[a] * lever[b]
            cov[a, b] = cov[b, a] = value
        for h in range(3):
            value = strip[h, 3 + i] + lever[a] * strip[h, 2]
            if h < 2:
                value += lever[c + h] * (strip[2, 3 + i] + lever[a] * turn)
            cov[a, c + h] = cov[c + h, a] = value
    for h in range(3):
        for i in range(3):
            value = strip[h, i]
            if h < 2:
                value += lever[c + h] * strip[2, i]
            if i < 2:
                value += lever[c + i] * strip[h, 2]
            if h < 2 and i < 2:
                value += lever[c + h] * lever[c + i] * turn
            cov[c + h, c + i] = value


# The question comes as its numbers, as to `_vicinity.choose`.
@compiled
def ask(
    belief: int, places: int, landmarks: int, slots: Ints, follows: bool, moves: bool, motion: Array, z: Array,
    R: Array, gate: float, into: int,
) -> int:  # fmt: skip
    """Fills the `ExpectedArrays` at `into` with the landmarks within the gate after a motion, and decides.

    See `_vicinity`, for `follows`, too; `belief` is the address of `GroupArrays`; `places` is the address of the
    `Places`, of which the first `landmarks` rows are those of its landmarks `slots`. Returns the number of landmarks
    whose joint covariance was computed; minus that, and nothing is filled, where there is no room for them.
    """
    origin = group_at(belief).origin
    here, own = group_at(belief).pose.copy(), np.empty((3, 3))
    if not follows:
        plain_joint(belief, slots[:0], np.empty((0, 2)), own)
    here[0] += origin[0]
    here[1] += origin[1]
    n, out = choose(places, landmarks, here, own, follows, moves, motion, z, R, gate), expected_at(into)
    if n > len(out.ids):
        return -n
    out.count[0] = 0
    if n > 0:
        at, together = np.empty((n, 2)), np.empty((2 * n + 3, 2 * n + 3))
        plain_joint(belief, slots[places_at(places).asked[:n]], at, together)
        for a in range(n):
            at[a, 0] += origin[0]
            at[a, 1] += origin[1]
        expect(places, here, at, together, moves, motion, z, R, gate, into)
    conclude(into, z, R)
    return n
