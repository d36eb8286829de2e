"""Inner loops on descriptors of bits: the two nearest ones of another frame, and words of many."""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints

Bits = NDArray[np.uint64]
"""(n, w) the bits of n descriptors, 64 in a column."""

FARTHEST = 1 << 30


@compiled
def differing(a: np.uint64, b: np.uint64) -> int:
    """The number of bits that differ."""
    x = a ^ b
    x = x - ((x >> np.uint64(1)) & np.uint64(0x5555555555555555))
    x = (x & np.uint64(0x3333333333333333)) + ((x >> np.uint64(2)) & np.uint64(0x3333333333333333))
    x = (x + (x >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((x * np.uint64(0x0101010101010101)) >> np.uint64(56))


@compiled
def two_nearest(first: Bits, second: Bits, distances: Ints, at: Ints) -> None:
    """Writes the distances (n, 2) of the two of `second` (m, 4) nearest to each of `first` (n, 4), and the row of one.

    The first one of several that are as near.
    """
    for k in range(len(first)):
        a, b, c, d = first[k, 0], first[k, 1], first[k, 2], first[k, 3]
        best, next_, row = FARTHEST, FARTHEST, 0
        for j in range(len(second)):
            total = differing(a, second[j, 0]) + differing(b, second[j, 1])
            total += differing(c, second[j, 2]) + differing(d, second[j, 3])
            if total < next_:
                if total < best:
                    best, next_, row = total, best, j
                else:
                    next_ = total
        distances[k, 0], distances[k, 1], at[k] = best, next_, row


@compiled
def nearest(bits: Bits, words: Bits, out: Ints) -> None:
    """Writes the row of the nearest of `words` (m, w) for each of `bits` (n, w); the first one of several."""
    for k in range(len(bits)):
        best = FARTHEST
        for j in range(len(words)):
            total = 0
            for i in range(bits.shape[1]):
                total += differing(bits[k, i], words[j, i])
            if total < best:
                best, out[k] = total, j


@compiled
def moved(bits: Bits, at: Ints, words: Bits) -> None:
    """Moves each of `words` (m, w) to the majority of the bits of the descriptors (n, w) that are nearest to it.

    A word without a descriptor stays.
    """
    votes, members = np.zeros((len(words), bits.shape[1] * 64), np.int64), np.zeros(len(words), np.int64)
    for k in range(len(bits)):
        members[at[k]] += 1
        for i in range(bits.shape[1]):
            for b in range(64):
                votes[at[k], 64 * i + b] += int((bits[k, i] >> np.uint64(b)) & np.uint64(1))
    for j in range(len(words)):
        if members[j] == 0:
            continue
        for i in range(bits.shape[1]):
            word = np.uint64(0)
            for b in range(64):
                if 2 * votes[j, 64 * i + b] > members[j]:
                    word |= np.uint64(1) << np.uint64(b)
            words[j, i] = word
