"""Inner loop: the ways of least variance to a step of a graph."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints


@compiled
def ways_to(end: int, first: Ints, next_: Ints, other: Ints, variance: Array, least: Array, came: Ints) -> None:
    """Writes for each of n nodes the edge on which its way to `end` begins, -1 without one, in `came` (n,).

    Dijkstra's algorithm. Edge e leads from `other[e]` and has `variance[e]`; `first` (n,) has each node's first edge of
    those that lead to it, and `next_[e]` the one after e, -1 at the end. `least` (n,) becomes the ways' variances.
    """
    heap, keys, size = np.empty(len(other) + 1, np.int64), np.empty(len(other) + 1), 1
    least[:], came[:] = np.inf, -1
    least[end], heap[0], keys[0] = 0.0, end, 0.0
    while size > 0:
        at, key = heap[0], keys[0]
        size -= 1
        node, value, place = heap[size], keys[size], 0
        while 2 * place + 1 < size:
            child = 2 * place + 1
            if child + 1 < size and keys[child + 1] < keys[child]:
                child += 1
            if keys[child] >= value:
                break
            heap[place], keys[place] = heap[child], keys[child]
            place = child
        heap[place], keys[place] = node, value
        if key > least[at]:
            continue
        edge = first[at]
        while edge >= 0:
            to, total = other[edge], key + variance[edge]
            if total < least[to]:
                least[to], came[to] = total, edge
                place = size
                size += 1
                while place > 0 and keys[(place - 1) // 2] > total:
                    heap[place], keys[place] = heap[(place - 1) // 2], keys[(place - 1) // 2]
                    place = (place - 1) // 2
                heap[place], keys[place] = to, total
            edge = next_[edge]
