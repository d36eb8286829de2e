"""Each particle's decision which of its own landmarks the sightings of a step are of: Montemerlo and Thrun (ICRA 2003).

Greedy maximum likelihood with exclusion: one sighting after another is taken to be of the particle's landmark that is
likeliest given its path, but of none that another sighting of the step is of, and of a new one where no likelihood is
above that of the gate. In FastSLAM 2.0 the likelihood is that given the motion and the sightings taken before, as the
proposal has it. It is low where the surprise of `_surprise.py` is high; a new landmark's surprise is the gate.

Distance tests come first, for many landmarks at once. As n' U^-1 n >= (a' n)^2 / a' U a for every a, the surprise
exceeds the gate if

    nr^2 > gate (tr P + rr + s^2)   or   (e^2 - nr^2) r > gate zr (tr P + r^2 bb + 2 s^2 + 2 r^2 t^2)

where nr is the error of the range zr of a landmark r m away, and e its distance from the sighting in the world: e^2 -
nr^2 = 4 r zr sin^2(nb / 2) is at most r zr nb^2. The pose's standard deviations are at most s m and t rad.

Each particle has rows of its own: `landmarks` (M, 5, N) are laid out as filters, `names` (M, N) are their ids, `counts`
(M,) their number. Particle m has those of `homes[m]`. `work` is that of `_proposal.py`, for the particles of a block.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._particles import BLOCK, cosine_sine
from ._proposal import ROWS, draw, fold, predict
from ._surprise import load, spread, weigh

Rows = NDArray[np.int32]
Flags = NDArray[np.bool]

ABSENT = -(2**31)
"""In place of a row: the particle has no landmark of the sighting's id."""

NAMELESS = -1
"""The id of a sighting without one: `UNKNOWN` of `core.factors`. Made-up ids are below it."""


@compiled
def find(
    work: Array, start: int, count: int, landmarks: Array, names: Ints, counts: Ints, homes: Ints, i: int, z: Array,
    cov: Array, name: int, rows: Rows, seen: Array, surprise: Array,
) -> None:  # fmt: skip
    """Takes the i-th sighting, of id `name`, to be of each particle's landmark of that id; ABSENT where it has none."""
    for m in range(count):
        home, found = homes[start + m], -1
        for row in range(counts[home]):
            if names[home, row] == name:
                found = row
        load(work, m, landmarks, home, found)
        rows[i, start + m] = found if found >= 0 else ABSENT
    weigh(work, 0, count, z, cov)
    for m in range(count):
        if rows[i, start + m] >= 0:
            surprise[start + m] += work[17 * BLOCK + m]
            for j in range(5):
                seen[i, j, start + m] = work[(12 + j) * BLOCK + m]


@compiled
def look(
    work: Array, start: int, count: int, landmarks: Array, counts: Ints, homes: Ints, furthest: float, rr: float,
    gate: float, rows: Rows, ids: Ints, first: Ints, near: Rows, where: Array, beyond: Flags,
) -> None:  # fmt: skip
    """Lists the landmarks of each particle that a sighting of at most `furthest` m may be of, in any order.

    Those of particle m are near[first[m]:first[m + 1]], and `where` (3, n) their mean and the trace of their
    covariance. Sightings at most move a pose by the root of their number times the gate.
    """
    k = len(ids)
    first[0] = filled = 0
    for m in range(count):
        home, x, y = homes[start + m], work[m], work[BLOCK + m]
        square, _ = spread(work, m)
        base, rest = furthest + sqrt(k * gate * square), gate * (rr + square)
        n = counts[home]
        mx, my, pxx, pyy = (
            landmarks[home, 0, :n],
            landmarks[home, 1, :n],
            landmarks[home, 2, :n],
            landmarks[home, 4, :n],
        )
        for row in range(len(mx)):
            dx, dy = mx[row] - x, my[row] - y
            reach = base + sqrt(gate * (pxx[row] + pyy[row]) + rest)
            beyond[row] = dx * dx + dy * dy > reach * reach
        for row in range(n):
            near[filled] = row
            filled += not beyond[row]
        for e in range(first[m], filled):
            row = near[e]
            where[0, e], where[1, e] = landmarks[home, 0, row], landmarks[home, 1, row]
            where[2, e] = landmarks[home, 2, row] + landmarks[home, 4, row]
            for i in range(k):
                if ids[i] != NAMELESS and rows[i, start + m] == row:
                    where[0, e] = inf  # another sighting is of it
        first[m + 1] = filled


@compiled
def likeliest(
    work: Array, start: int, count: int, landmarks: Array, names: Ints, homes: Ints, first: Ints, near: Rows,
    where: Array, z: Array, cov: Array, name: int, gate: float, least: Array, second: Array, entry: Ints,
    beyond: Flags,
) -> None:  # fmt: skip
    """Finds the landmark in view with the least surprise of a sighting z (2,), for each particle.

    Fills `least` and `second`, the two least surprises, both at most the `gate`, and `entry`, that of the landmark in
    `near`, or -1. A sighting of an id `name` is of no landmark that has another one. `beyond` is overwritten.
    """
    range_, rr, bb = z[0], cov[0, 0], cov[1, 1]
    cb, sb = cosine_sine(z[1])
    for m in range(count):
        c, s = cosine_sine(work[2 * BLOCK + m])
        least[m], second[m] = range_ * (c * cb - s * sb), range_ * (s * cb + c * sb)
    for m in range(count):
        x, y, ahead, aside = work[m], work[BLOCK + m], least[m], second[m]
        home, begin, end = homes[start + m], first[m], first[m + 1]
        square, turn = spread(work, m)
        mx, my, trace = where[0, begin:end], where[1, begin:end], where[2, begin:end]
        for e in range(len(mx)):
            dx, dy = mx[e] - x, my[e] - y
            q = dx * dx + dy * dy
            r = sqrt(q)
            along = (range_ - r) * (range_ - r)
            across = ((dx - ahead) * (dx - ahead) + (dy - aside) * (dy - aside) - along) * r
            far = across > gate * range_ * (trace[e] + q * bb + 2 * square + 2 * q * turn)
            beyond[e] = far | (along > gate * (trace[e] + rr + square))
        one, next_, rivals = -1, gate, 0
        for e in range(begin, end):
            if not beyond[e - begin] and (name == NAMELESS or names[home, near[e]] < NAMELESS):
                rivals += 1
                one = e
        if rivals > 1:
            best = gate
            for e in range(begin, end):
                if not beyond[e - begin] and (name == NAMELESS or names[home, near[e]] < NAMELESS):
                    load(work, m, landmarks, home, near[e])
                    weigh(work, m, m + 1, z, cov)
                    found = work[17 * BLOCK + m]
                    if found < best:
                        best, next_, one = found, best, e
                    elif found < next_:
                        next_ = found
        load(work, m, landmarks, home, int(near[one]) if one >= 0 else -1)
        second[m], entry[m] = next_, one
    weigh(work, 0, count, z, cov)
    for m in range(count):
        found = work[17 * BLOCK + m]
        within = found < gate
        least[m], entry[m] = (found, entry[m]) if within else (gate, -1)


@compiled
def surest_first(ahead: Array, order: Ints) -> None:
    """Fills `order` (k,) so that `ahead` (k,) falls: how far the likeliest landmark is ahead of the second."""
    for i in range(len(ahead)):
        p = i
        while p > 0 and ahead[order[p - 1]] < ahead[i]:
            order[p] = order[p - 1]
            p -= 1
        order[p] = i


@compiled
def decide(
    work: Array, start: int, count: int, landmarks: Array, names: Ints, counts: Ints, homes: Ints, near: Rows,
    where: Array, least: Array, entry: Ints, i: int, name: int, made_up: int, rows: Rows, seen: Array, surprise: Array,
) -> None:  # fmt: skip
    """Takes the i-th sighting to be of the likeliest landmark of each particle, or of a new one.

    One of an id `name` only where that is ABSENT; the landmark gets the id. A new one without has the id `made_up`.
    """
    for m in range(count):
        home, at = homes[start + m], start + m
        if name != NAMELESS and rows[i, at] != ABSENT:
            load(work, m, landmarks, home, -1)
            continue
        surprise[at] += least[m]
        row = int(near[entry[m]]) if entry[m] >= 0 else -1
        load(work, m, landmarks, home, row)
        for j in range(5):
            seen[i, j, at] = work[(12 + j) * BLOCK + m]
        if row >= 0:
            where[0, entry[m]] = inf
            rows[i, at] = row
            if name != NAMELESS:
                names[home, row] = name
        else:
            rows[i, at] = -1 - counts[home]
            names[home, counts[home]] = made_up if name == NAMELESS else name
            counts[home] += 1


@compiled
def choose(
    poses: Array, moves: bool, delta: Array, motion: Array, noise: Array, heaviest: int, z: Array, cov: Array,
    ids: Ints, landmarks: Array, names: Ints, counts: Ints, homes: Ints, gate: float, made_up: int,
    rows: Rows, seen: Array, surprise: Array,
) -> None:  # fmt: skip
    """Decides in every particle which landmark each of k sightings is of; where `moves` is set, samples poses, too.

    `delta`, `motion` and `noise` are those of `propose`, z (k, 2), cov (k, 2, 2) and `ids` (k,) the sightings; the i-th
    makes up the id `made_up` - i. Fills `rows` (k, M) with the landmark, -1 - row of a new one, `seen` (k, 5, M) with
    its filter as it was, and `surprise` (M,). A new landmark has its row and id, and no filter yet.

    All particles take the sightings in one order: those with ids first, then those of which the heaviest is surest.
    """
    k, M = len(z), poses.shape[1]
    furthest = z[:, 0].max() if k > 0 else 0.0
    rr = cov[:, 0, 0].max() if k > 0 else 0.0
    most = max(1, counts.max())
    work, least, second, beyond = np.zeros(ROWS * BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(most, np.bool_)
    first, entry = np.empty(BLOCK + 1, np.int64), np.empty(BLOCK, np.int64)
    near, where = np.empty(min(BLOCK, M) * most + 1, np.int32), np.empty((3, min(BLOCK, M) * most))
    ahead, order = np.empty(k), np.empty(k, np.int64)
    for part in range(-1, (M + BLOCK - 1) // BLOCK):  # first the heaviest alone, for the order
        start = heaviest if part < 0 else part * BLOCK
        count = 1 if part < 0 else min(BLOCK, M - start)
        if moves:
            predict(work, poses, start, count, delta, motion)
        else:
            for m in range(count):
                for j in range(3):
                    work[j * BLOCK + m] = poses[j, start + m]
        surprise[start : start + count] = 0
        for i in range(k):
            if ids[i] != NAMELESS:
                find(work, start, count, landmarks, names, counts, homes, i, z[i], cov[i], ids[i], rows, seen, surprise)
                if moves:
                    fold(work, count, z[i], cov[i])
        look(work, start, count, landmarks, counts, homes, furthest, rr, gate, rows, ids, first, near, where, beyond)
        if part >= 0:
            for p in range(k):
                i = int(order[p])
                if ids[i] != NAMELESS and rows[i, start : start + count].min() != ABSENT:
                    continue
                likeliest(
                    work, start, count, landmarks, names, homes, first, near, where, z[i], cov[i], ids[i], gate,
                    least, second, entry, beyond,
                )  # fmt: skip
                decide(
                    work, start, count, landmarks, names, counts, homes, near, where, least, entry, i, ids[i],
                    made_up - i, rows, seen, surprise,
                )  # fmt: skip
                if moves:
                    fold(work, count, z[i], cov[i])
            if moves:
                draw(work, poses, start, count, noise)
            continue
        for i in range(k):
            ahead[i] = inf
            if ids[i] == NAMELESS:
                likeliest(
                    work, start, 1, landmarks, names, homes, first, near, where, z[i], cov[i], ids[i], gate,
                    least, second, entry, beyond,
                )  # fmt: skip
                ahead[i] = second[0] - least[0]
        surest_first(ahead, order)
