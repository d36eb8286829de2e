"""Ancestry: maps from particles to their ancestors, stored over many resamplings.

Each resampling begins an epoch. The map of epoch e gives the particle of epoch e - 1 that each of its M particles was
copied from. Maps are also stored over 2^k epochs, one for every epoch that 2^k divides, so that a trace back over n
epochs takes at most 2 log2 n steps. `hops` (2 W, M) is a ring: it holds those maps for the last W epochs, W a power of
two, the W of single epochs first, then the W / 2 over two of them, and so on.
"""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

Hops = NDArray[np.int32]
Values = NDArray[np.float64] | NDArray[np.int32]


@compiled
def hop(ring: int, level: int, epoch: int) -> int:
    """The row in which a ring of `ring` epochs stores the map from `epoch` to 2^`level` epochs before."""
    many = ring >> level
    return 2 * ring - 2 * many + ((epoch >> level) & (many - 1))


@compiled
def remember(hops: Hops, epoch: int, ancestors: Ints) -> None:
    """Stores `ancestors` (M,), the map of `epoch`, and the maps over 2, 4, 8 ... epochs that end with it."""
    ring = len(hops) // 2
    hops[hop(ring, 0, epoch)] = ancestors
    level, span = 1, 2
    while span <= ring and epoch % span == 0:
        recent = hops[hop(ring, level - 1, epoch)]
        before = hops[hop(ring, level - 1, epoch - span // 2)]
        both = hops[hop(ring, level, epoch)]
        for m in range(len(both)):
            both[m] = before[recent[m]]
        level, span = level + 1, 2 * span


@compiled
def trace(hops: Hops, epoch: int, since: int, ancestor: Hops) -> None:
    """Writes to `ancestor` (M,) the particle of epoch `since` that each particle of `epoch` descends from."""
    ring = len(hops) // 2
    for m in range(len(ancestor)):
        ancestor[m] = m
    while epoch > since:
        level, span = 0, 1
        while epoch % (2 * span) == 0 and epoch - 2 * span >= since:
            level, span = level + 1, 2 * span
        back = hops[hop(ring, level, epoch)]
        for m in range(len(ancestor)):
            ancestor[m] = back[ancestor[m]]
        epoch -= span


@compiled
def catch_up(filters: Array, slots: Ints, written: Ints, spare: int, rows: Ints, hops: Hops, epoch: int) -> int:
    """Updates the landmarks in `rows` to the particles of `epoch`; returns the slot that is spare afterwards.

    A landmark's `filters` in slot `slots[row]` belong to the particles of epoch `written[row]`. They are copied to the
    spare slot, each particle's from its ancestor's, and the slot they leave becomes the spare one.
    """
    ancestor = np.empty(hops.shape[1], np.int32)
    traced = epoch
    for row in rows:
        if written[row] == epoch:
            continue
        if written[row] != traced:
            traced = int(written[row])
            trace(hops, epoch, traced, ancestor)
        for i in range(filters.shape[1]):
            old, new = filters[slots[row], i], filters[spare, i]
            for m in range(len(ancestor)):
                new[m] = old[ancestor[m]]
        written[row] = epoch
        slots[row], spare = spare, int(slots[row])
    return spare


@compiled
def chosen(weights: Array, points: Array) -> Ints:
    """The particle (n,) in whose share of the unit interval each of the sorted `points` (n,) falls.

    The shares are those of `weights` (M,), which need not sum to 1; a particle of zero weight has none.
    """
    last = len(weights) - 1
    total = weights.sum()
    while last > 0 and weights[last] == 0:
        last -= 1
    found = np.empty(len(points), np.int64)
    m, upto = 0, weights[0]
    for i in range(len(points)):
        while m < last and upto <= points[i] * total:
            m += 1
            upto += weights[m]
        found[i] = m
    return found


@compiled
def widen(hops: Hops, wider: Hops, epoch: int) -> None:
    """Copies the maps that end with `epoch` or before to a ring of twice as many epochs.

    Maps over more epochs than the narrow ring had are missing there. They are not needed: no landmark was further
    behind.
    """
    ring = len(hops) // 2
    level = 0
    while ring >> level > 0:
        last = (epoch >> level) << level
        for i in range(ring >> level):
            ended = last - (i << level)
            if ended > 0:
                wider[hop(2 * ring, level, ended)] = hops[hop(ring, level, ended)]
        level += 1


@compiled
def forebears(parents: Hops, leaves: Hops, ancestors: Ints, back: Ints, nodes: Hops) -> None:
    """The nodes (n, M) of each particle's path `back` (n,) steps before its last pose, the fewest steps first.

    Particle m's path ends in leaf ancestors[m]. As ancestors are sorted, particles that share one are neighbours: of
    such a run only one path is followed further.
    """
    M = len(ancestors)
    runs, run, merged = np.empty(M, np.int32), np.empty(M, np.int64), np.empty(M, np.int64)
    count, gone = M, 0
    for m in range(M):
        runs[m], run[m] = leaves[ancestors[m]], m
    for i in range(len(back)):
        while gone < back[i]:
            kept = 0
            for j in range(count):
                node = parents[runs[j]]
                if kept == 0 or node != runs[kept - 1]:
                    runs[kept] = node
                    kept += 1
                merged[j] = kept - 1
            if kept < count:
                for m in range(M):
                    run[m] = merged[run[m]]
            count = kept
            gone += 1
        for m in range(M):
            nodes[i, m] = runs[run[m]]


@compiled
def grow(
    nodes: Values, parents: Hops, children: Hops, unused: Hops, left: int, leaves: Hops, ancestors: Ints, values: Values
) -> int:
    """Appends a node of every particle, column m of `values` (C or more, M), to the leaf of its ancestor ancestors[m].

    `nodes` (n, C) have the values. Branches that end without a particle are removed. `unused` is the stack of free
    nodes, its height `left`, at least M; returns its height afterwards.
    """
    before = leaves.copy()
    if before[0] >= 0:
        for ancestor in ancestors:
            children[before[ancestor]] += 1
        for leaf in before:
            node = leaf
            while node >= 0 and children[node] == 0:
                unused[left] = node
                left += 1
                node = parents[node]
                if node >= 0:
                    children[node] -= 1
    for m in range(len(leaves)):
        left -= 1
        node = unused[left]
        parents[node], children[node] = before[ancestors[m]], 0
        for i in range(nodes.shape[1]):
            nodes[node, i] = values[i, m]
        leaves[m] = node
    return left
