"""Each particle's decision which of its own landmarks the sightings of a step are of: Montemerlo and Thrun (ICRA 2003).

Greedy maximum likelihood with exclusion: one sighting after another is taken to be of the particle's landmark that is
likeliest given its path, but of none that another sighting of the step is of, and of a new one where no likelihood is
above that of the gate. In FastSLAM 2.0 the likelihood is that given the motion and the sightings taken before, as the
proposal has it. With n, U and W of `_particles.py`, -2 log-likelihood is, up to what all landmarks have in common, the
surprise n' U^-1 n + log |U| / |W|; a new landmark's is the gate.

A distance test comes first. Let e be the distance of landmark and sighting in the world: no more than the way along an
arc and then a radius, so e^2 <= 2 |n|^2. As n' U^-1 n >= |n|^2 / tr U, a surprise is above e^2 / (2 tr U).

Each particle has rows of its own: `landmarks` (M, 5, N) are laid out as filters, `names` (M, N) are their ids, `counts`
(M,) their number. Particle m has those of `homes[m]`. `work` is that of `_proposal.py`.
"""

from math import inf, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from ._particles import BLOCK, arctan2, cosine_sine, place
from ._proposal import ROWS, draw, fold, predict

Rows = NDArray[np.int32]

NAMELESS = -1
"""The id of a sighting without one: `UNKNOWN` of `frontend.factors`. Made-up ids are below it."""


@compiled
def surprise_of(
    work: Array, m: int, mx: float, my: float, pxx: float, pxy: float, pyy: float, z: Array, cov: Array
) -> float:
    """The surprise of a sighting z (2,) of covariance (2, 2), if it is of that landmark; infinite at the very pose."""
    dx, dy = mx - work[m], my - work[BLOCK + m]
    q = dx * dx + dy * dy
    if not q > 0:
        return inf
    r = sqrt(q)
    rr, rb, bb = cov[0, 0], cov[0, 1], cov[1, 1]
    nr = z[0] - r
    nb = z[1] - arctan2(dy, dx) + work[2 * BLOCK + m]
    nb -= 2 * pi * np.floor(nb / (2 * pi) + 0.5)
    c, s = dx / r, dy / r
    nx, ny = c * nr - dy * nb, s * nr + dx * nb
    i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
    f1, f2, f3 = dy * i - work[3 * BLOCK + m], dy * j - work[4 * BLOCK + m], dy * o - work[5 * BLOCK + m]
    g1, g2, g3 = -dx * i - work[6 * BLOCK + m], -dx * j - work[7 * BLOCK + m], -dx * o - work[8 * BLOCK + m]
    uxx = pxx + c * c * rr - 2 * c * dy * rb + dy * dy * bb + f1 * f1 + f2 * f2 + f3 * f3
    uxy = pxy + c * s * rr + (c * dx - s * dy) * rb - dx * dy * bb + f1 * g1 + f2 * g2 + f3 * g3
    uyy = pyy + s * s * rr + 2 * s * dx * rb + dx * dx * bb + g1 * g1 + g2 * g2 + g3 * g3
    det_w = (rr * bb - rb * rb) * q
    det_u = max(uxx * uyy - uxy * uxy, det_w)
    return (uyy * nx * nx - 2 * uxy * nx * ny + uxx * ny * ny) / det_u + log(det_u / det_w)


@compiled
def spreads(work: Array, count: int, across: Array, turn: Array) -> None:
    """Bounds what the pose adds to tr U of a landmark r m away: `across` + r^2 `turn`, of `count` particles."""
    for m in range(count):
        square = 0.0
        for j in range(3, 9):
            square += work[j * BLOCK + m] * work[j * BLOCK + m]
        i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
        across[m], turn[m] = 2 * square, 2 * (i * i + j * j + o * o)


@compiled
def look(
    landmarks: Array, home: int, count: int, x: float, y: float, furthest: float, twice: float, rr: float, bb: float,
    beyond: Array, near: Rows, filled: int,
) -> int:  # fmt: skip
    """Appends to `near` the landmarks that a sighting of at most `furthest` m may be of; returns how many it then has.

    tr U is at most that of the landmark plus `rr` + r^2 `bb`; `twice` is twice the gate; `beyond` (N,) is overwritten.
    """
    for row in range(count):
        dx, dy = landmarks[home, 0, row] - x, landmarks[home, 1, row] - y
        q = dx * dx + dy * dy
        reach = furthest + sqrt(twice * (landmarks[home, 2, row] + landmarks[home, 4, row] + rr + q * bb))
        beyond[row] = q - reach * reach
    for row in range(count):
        if beyond[row] < 0:
            near[filled] = row
            filled += 1
    return filled


@compiled
def likeliest(
    work: Array, m: int, landmarks: Array, names: Ints, home: int, near: Rows, first: int, last: int, x: float,
    y: float, across: float, turn: float, z: Array, cov: Array, name: int, gate: float,
) -> tuple[float, float, int]:  # fmt: skip
    """The least surprise of z (2,), seen at (x, y), the second least, and the entry of `near` of the least, or -1.

    Entries are `first` to `last`; those below 0 are taken. Both surprises are at most the `gate`. A sighting with an id
    `name` is of no landmark that has another one.
    """
    least, second, entry = gate, gate, -1
    rr, bb = cov[0, 0] + across, cov[1, 1] + turn
    for e in range(first, last):
        row = near[e]
        if row < 0:
            continue
        mx, my, pxx, pyy = (
            landmarks[home, 0, row],
            landmarks[home, 1, row],
            landmarks[home, 2, row],
            landmarks[home, 4, row],
        )
        ex, ey, dx, dy = mx - x, my - y, mx - work[m], my - work[BLOCK + m]
        if ex * ex + ey * ey >= 2 * second * (pxx + pyy + rr + (dx * dx + dy * dy) * bb):
            continue
        if name != NAMELESS and names[home, row] >= NAMELESS:
            continue
        surprise = surprise_of(work, m, mx, my, pxx, landmarks[home, 3, row], pyy, z, cov)
        if surprise < least:
            least, second, entry = surprise, least, e
        elif surprise < second:
            second = surprise
    return least, second, entry


@compiled
def choose(
    poses: Array, moves: bool, delta: Array, motion: Array, noise: Array, heaviest: int, z: Array, cov: Array,
    ids: Ints, landmarks: Array, names: Ints, counts: Ints, homes: Ints, gate: float, call: int,
    rows: Rows, seen: Array, surprise: Array,
) -> None:  # fmt: skip
    """Decides in every particle which landmark each of k sightings is of; where it `moves`, samples poses, too.

    `delta`, `motion` and `noise` are those of `propose`, z (k, 2), cov (k, 2, 2) and `ids` (k,) the sightings; the i-th
    makes the id `call` - i. Fills `rows` (k, M) with the landmark, -1 - row of a new one, `seen` (k, 5, M) with its
    filter as it was, and adds to `surprise` (M,). A new landmark has its row and id, and no filter yet.

    All particles take the sightings in one order: those with ids first, the others in that of `surest_first`.
    """
    k, M = len(z), poses.shape[1]
    furthest, rr, bb = 0.0, 0.0, 0.0
    for i in range(k):
        furthest, rr, bb = max(furthest, z[i, 0]), max(rr, cov[i, 0, 0]), max(bb, cov[i, 1, 1])
    work = np.zeros(ROWS * BLOCK)
    wx, wy, across, turn = np.empty(BLOCK), np.empty(BLOCK), np.zeros(BLOCK), np.zeros(BLOCK)
    first, beyond = np.empty(BLOCK + 1, np.int64), np.empty(landmarks.shape[2])
    near = np.empty(min(BLOCK, M) * max(1, counts.max()), np.int32)
    order = np.empty(k, np.int64)
    for part in range(-1, (M + BLOCK - 1) // BLOCK):  # first the heaviest alone, for the order
        start = heaviest if part < 0 else part * BLOCK
        count = 1 if part < 0 else min(BLOCK, M - start)
        if moves:
            predict(work, poses, start, count, delta, motion)
        else:
            for m in range(count):
                for j in range(3):
                    work[j * BLOCK + m] = poses[j, start + m]
        spreads(work, count, across, turn)
        first[0] = 0
        for m in range(count):
            home = homes[start + m]
            first[m + 1] = look(
                landmarks, home, counts[home], work[m], work[BLOCK + m], furthest, 2 * gate, rr + across[m],
                bb + turn[m], beyond, near, first[m],
            )  # fmt: skip
        if part < 0:
            surest_first(
                work, landmarks, names, homes[start], near, first[1], across[0], turn[0], z, cov, ids, gate, order
            )
            continue
        for i in order:
            if moves:
                spreads(work, count, across, turn)
            cb, sb = cosine_sine(z[i, 1])
            for m in range(count):
                c, s = cosine_sine(work[2 * BLOCK + m])
                wx[m] = work[m] + z[i, 0] * (c * cb - s * sb)
                wy[m] = work[BLOCK + m] + z[i, 0] * (s * cb + c * sb)
            for m in range(count):
                home, row, least = homes[start + m], -1, 0.0
                if ids[i] != NAMELESS:
                    row, least = named(
                        work,
                        m,
                        landmarks,
                        names,
                        home,
                        counts[home],
                        near,
                        first[m],
                        first[m + 1],
                        z[i],
                        cov[i],
                        ids[i],
                    )
                if row < 0:
                    least, _, e = likeliest(
                        work, m, landmarks, names, home, near, first[m], first[m + 1], wx[m], wy[m], across[m],
                        turn[m], z[i], cov[i], ids[i], gate,
                    )  # fmt: skip
                    if e >= 0:
                        row, near[e] = near[e], -1
                        if ids[i] != NAMELESS:
                            names[home, row] = ids[i]
                surprise[start + m] += least
                if row >= 0:
                    rows[i, start + m] = row
                    for j in range(5):
                        work[(12 + j) * BLOCK + m] = seen[i, j, start + m] = landmarks[home, j, row]
                    continue
                rows[i, start + m] = -1 - counts[home]
                names[home, counts[home]] = call - i if ids[i] == NAMELESS else ids[i]
                counts[home] += 1
                for j in range(5):  # a landmark at its very position leaves a pose as it is
                    work[(12 + j) * BLOCK + m] = seen[i, j, start + m] = work[j * BLOCK + m] if j < 2 else 0.0
            if moves:
                fold(work, count, z[i], cov[i])
        if moves:
            draw(work, poses, start, count, noise)


@compiled
def named(
    work: Array, m: int, landmarks: Array, names: Ints, home: int, count: int, near: Rows, first: int, last: int,
    z: Array, cov: Array, name: int,
) -> tuple[int, float]:  # fmt: skip
    """The row of the landmark with the id `name`, -1 if the particle has none, and the surprise; takes its entry."""
    for row in range(count):
        if names[home, row] == name:
            for e in range(first, last):
                if near[e] == row:
                    near[e] = -1
            at = landmarks[home, :, row]
            return row, surprise_of(work, m, at[0], at[1], at[2], at[3], at[4], z, cov)
    return -1, 0.0


@compiled
def surest_first(
    work: Array, landmarks: Array, names: Ints, home: int, near: Rows, last: int, across: float, turn: float, z: Array,
    cov: Array, ids: Ints, gate: float, order: Ints,
) -> None:  # fmt: skip
    """Fills `order` (k,): sightings with ids, then those whose likeliest landmark is furthest ahead of the second."""
    k = len(z)
    ahead = np.empty(k)
    for i in range(k):
        c, s = cosine_sine(work[2 * BLOCK])
        cb, sb = cosine_sine(z[i, 1])
        x, y = work[0] + z[i, 0] * (c * cb - s * sb), work[BLOCK] + z[i, 0] * (s * cb + c * sb)
        least, second, _ = likeliest(
            work, 0, landmarks, names, home, near, 0, last, x, y, across, turn, z[i], cov[i], ids[i], gate
        )
        ahead[i] = second - least if ids[i] == NAMELESS else inf
        p = i
        while p > 0 and ahead[order[p - 1]] < ahead[i]:
            order[p] = order[p - 1]
            p -= 1
        order[p] = i


@compiled
def keep(poses: Array, z: Array, cov: Array, landmarks: Array, homes: Ints, rows: Rows, seen: Array) -> None:
    """Stores the corrected landmarks `seen` (k, 5, M) in their `rows` (k, M), and places new ones, rows -1 - row."""
    fresh = np.empty((1, 5, rows.shape[1]))
    for i in range(len(rows)):
        if rows[i].min() < 0:
            place(poses, fresh, 0, z[i], cov[i])
        for m in range(rows.shape[1]):
            row, new = rows[i, m], rows[i, m] < 0
            if new:
                row = rows[i, m] = -1 - row
            for j in range(5):
                landmarks[homes[m], j, row] = fresh[0, j, m] if new else seen[i, j, m]


@compiled
def inherit(landmarks: Array, names: Ints, counts: Ints, homes: Ints, ancestors: Ints) -> Ints:
    """Gives each particle m the landmarks of particle ancestors[m]; returns the new `homes` (M,).

    `ancestors` are sorted. Of the copies of one the first takes over its home, the others copy its landmarks to homes
    of particles that have none.
    """
    M = len(homes)
    wanted, after = np.zeros(M, np.bool_), np.empty(M, np.int64)
    for m in range(M):
        wanted[ancestors[m]] = True
    free = 0
    for m in range(M):
        old = homes[ancestors[m]]
        if m == 0 or ancestors[m] != ancestors[m - 1]:
            after[m] = old
            continue
        while wanted[free]:
            free += 1
        new = after[m] = homes[free]
        free += 1
        counts[new] = count = counts[old]
        landmarks[new, :, :count] = landmarks[old, :, :count]
        names[new, :count] = names[old, :count]
    return after
