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

Each particle has rows of its own: see `Landmarks`. `work` is that of `_proposal.py`, for `count` particles of a block
from `start` on.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import RangeBearing
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._own_maps import Decisions, Landmarks, Rows
from ._particles import BLOCK, cosine_sine
from ._proposal import ROWS, Motion, draw, fold, predict
from ._surprise import load, spread, weigh

ABSENT = -(2**31)
"""In place of a row: the particle has no landmark of the sighting's id."""

NAMELESS = -1
"""The id of a sighting without one: `UNKNOWN` of `core.factors`. Made-up ids are below it."""


class Candidates(NamedTuple):
    """Landmarks of a block of particles that sightings may be of, and the likeliest for the one in hand."""

    first: Ints  # (BLOCK + 1,) those of particle m are near[first[m]:first[m + 1]]
    near: Rows  # (n,) their rows, in any order
    where: Array  # (3, n) their mean and the trace of their covariance; x infinite where another sighting is of it
    beyond: NDArray[np.bool]  # (N,) scratch
    least: Array  # (BLOCK,) the two least surprises, both at most the gate
    second: Array  # (BLOCK,)
    entry: Ints  # (BLOCK,) the entry in `near` of the landmark with the least, or -1


@compiled
def find(
    work: Array, start: int, count: int, own: Landmarks, sightings: RangeBearing, i: int, decisions: Decisions
) -> None:
    """Takes the i-th sighting to be of each particle's landmark of its id; ABSENT where it has none."""
    filters, names, counts, homes = own
    rows, seen, surprise = decisions
    name = sightings.ids[i]
    for m in range(count):
        home, found = homes[start + m], -1
        for row in range(counts[home]):
            if names[home, row] == name:
                found = row
        load(work, m, filters, home, found)
        rows[i, start + m] = found if found >= 0 else ABSENT
    weigh(work, 0, count, sightings.z[i], sightings.cov[i])
    for m in range(count):
        if rows[i, start + m] >= 0:
            surprise[start + m] += work[17 * BLOCK + m]
            for j in range(5):
                seen[i, j, start + m] = work[(12 + j) * BLOCK + m]


@compiled
def look(
    work: Array, start: int, count: int, own: Landmarks, sightings: RangeBearing, gate: float, decisions: Decisions,
    candidates: Candidates,
) -> None:  # fmt: skip
    """Lists the landmarks of each particle that a sighting of the step may be of.

    Sightings at most move a pose by the root of their number times the gate.
    """
    ids, k, rows = sightings.ids, len(sightings.ids), decisions.rows
    filters, counts, homes = own.filters, own.counts, own.homes
    first, near, where, beyond = candidates.first, candidates.near, candidates.where, candidates.beyond
    furthest = sightings.z[:, 0].max() if k > 0 else 0.0
    rr = sightings.cov[:, 0, 0].max() if k > 0 else 0.0
    first[0] = filled = 0
    for m in range(count):
        home, x, y = homes[start + m], work[m], work[BLOCK + m]
        square, _ = spread(work, m)
        base, rest = furthest + sqrt(k * gate * square), gate * (rr + square)
        n = counts[home]
        mx, my, pxx, pyy = (
            filters[home, 0, :n],
            filters[home, 1, :n],
            filters[home, 2, :n],
            filters[home, 4, :n],
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
            where[0, e], where[1, e] = filters[home, 0, row], filters[home, 1, row]
            where[2, e] = filters[home, 2, row] + filters[home, 4, row]
            for i in range(k):
                if ids[i] != NAMELESS and rows[i, start + m] == row:
                    where[0, e] = inf  # another sighting is of it
        first[m + 1] = filled


@compiled
def likeliest(
    work: Array, start: int, count: int, own: Landmarks, sightings: RangeBearing, i: int, gate: float,
    candidates: Candidates,
) -> None:  # fmt: skip
    """Finds the landmark in view with the least surprise of the i-th sighting, for each particle.

    A sighting with an id is of no landmark that has another one.
    """
    z, cov, name = sightings.z[i], sightings.cov[i], sightings.ids[i]
    filters, names, homes = own.filters, own.names, own.homes
    first, near, where, beyond = candidates.first, candidates.near, candidates.where, candidates.beyond
    least, second, entry = candidates.least, candidates.second, candidates.entry
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
                    load(work, m, filters, home, near[e])
                    weigh(work, m, m + 1, z, cov)
                    found = work[17 * BLOCK + m]
                    if found < best:
                        best, next_, one = found, best, e
                    elif found < next_:
                        next_ = found
        load(work, m, filters, home, int(near[one]) if one >= 0 else -1)
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
    work: Array, start: int, count: int, own: Landmarks, sightings: RangeBearing, i: int, made_up: int,
    decisions: Decisions, candidates: Candidates,
) -> None:  # fmt: skip
    """Takes the i-th sighting to be of the likeliest landmark of each particle, or of a new one.

    One with an id only where that is ABSENT; the landmark gets the id. A new one without has the id `made_up`.
    """
    filters, names, counts, homes = own
    rows, seen, surprise = decisions
    near, where, least, entry = candidates.near, candidates.where, candidates.least, candidates.entry
    name = sightings.ids[i]
    for m in range(count):
        home, at = homes[start + m], start + m
        if name != NAMELESS and rows[i, at] != ABSENT:
            load(work, m, filters, home, -1)
            continue
        surprise[at] += least[m]
        row = int(near[entry[m]]) if entry[m] >= 0 else -1
        load(work, m, filters, home, row)
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
    poses: Array, moves: bool, motion: Motion, heaviest: int, sightings: RangeBearing, gate: float, made_up: int,
    own: Landmarks, decisions: Decisions,
) -> None:  # fmt: skip
    """Decides in every particle which landmark each of k sightings is of; where `moves` is set, samples poses, too.

    The i-th sighting makes up the id `made_up` - i. A new landmark has its row and id, and no filter yet.

    All particles take the sightings in one order: those with ids first, then those of which the heaviest is surest.
    """
    ids, z, cov = sightings
    rows, surprise = decisions.rows, decisions.surprise
    k, M = len(z), poses.shape[1]
    most = max(1, own.counts.max())
    work, room = np.zeros(ROWS * BLOCK), min(BLOCK, M) * most
    candidates = Candidates(
        np.empty(BLOCK + 1, np.int64), np.empty(room + 1, np.int32), np.empty((3, room)), np.empty(most, np.bool_),
        np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.int64),
    )  # fmt: skip
    ahead, order = np.empty(k), np.empty(k, np.int64)
    for part in range(-1, (M + BLOCK - 1) // BLOCK):  # first the heaviest alone, for the order
        start = heaviest if part < 0 else part * BLOCK
        count = 1 if part < 0 else min(BLOCK, M - start)
        if moves:
            predict(work, poses, start, count, motion)
        else:
            for m in range(count):
                for j in range(3):
                    work[j * BLOCK + m] = poses[j, start + m]
        surprise[start : start + count] = 0
        for i in range(k):
            if ids[i] != NAMELESS:
                find(work, start, count, own, sightings, i, decisions)
                if moves:
                    fold(work, count, z[i], cov[i])
        look(work, start, count, own, sightings, gate, decisions, candidates)
        if part >= 0:
            for p in range(k):
                i = int(order[p])
                if ids[i] != NAMELESS and rows[i, start : start + count].min() != ABSENT:
                    continue
                likeliest(work, start, count, own, sightings, i, gate, candidates)
                decide(work, start, count, own, sightings, i, made_up - i, decisions, candidates)
                if moves:
                    fold(work, count, z[i], cov[i])
            if moves:
                draw(work, poses, start, count, motion.noise)
            continue
        for i in range(k):
            ahead[i] = inf
            if ids[i] == NAMELESS:
                likeliest(work, start, 1, own, sightings, i, gate, candidates)
                ahead[i] = candidates.second[0] - candidates.least[0]
        surest_first(ahead, order)
