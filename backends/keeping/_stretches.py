"""Divides the way of a robot into stretches, at poses that sightings alone determine on either side."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._graph import (
    END,
    FIRST,
    FIX,
    LANDMARK,
    LINK,
    LOOP,
    MARK,
    NEXT_A,
    NEXT_B,
    PART,
    PENDING,
    POINT,
    STAMP,
    STEPS,
    A,
    B,
    Graph,
)

AROUND, ENOUGH = 5, 3
"""Steps on either side of a cut, and the landmarks that have to be in sight there: three determine a pose well."""

SHORT = 0.25
"""Least length of a stretch that ends where another submap is nearer, over that of the longest."""


@compiled
def seen_in(g: Graph, first: int, last: int) -> tuple[Ints, bool]:
    """The landmarks sighted from steps `first` to `last`, in order; and True if a sighting is held back."""
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    sightings = 0
    for k in range(first, last + 1):
        if g.at[k] >= 0:
            sightings += g.variables[g.at[k], END] - g.variables[g.at[k], FIRST]
    out, n, held = np.empty(sightings, np.int64), 0, False
    for k in range(first, last + 1):
        v = g.at[k]
        if v < 0:
            continue
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            if g.sightings[s, PART] <= FIX:
                continue
            if landmark < 0:
                held = True
            elif g.variables[landmark, MARK] != stamp:
                g.variables[landmark, MARK] = stamp
                out[n] = landmark
                n += 1
    return out[:n], held


@compiled
def closes(g: Graph, first: int, last: int) -> bool:
    """Tells if a loop is closed from one of the steps `first` to `last`."""
    found = False
    for step in range(first, last + 1):
        v = g.at[step]
        k = g.variables[v, LINK] if v >= 0 else -1
        while k >= 0:
            found = found or (g.links[k, LOOP] != 0 and g.links[k, B] == v)
            k = g.links[k, NEXT_A if g.links[k, A] == v else NEXT_B]
    return found


@compiled
def located(g: Graph, first: int, last: int, loops: bool) -> bool:
    """Tells if enough landmarks are sighted from the steps `first` to `last`, or, with `loops`, a loop is closed."""
    return len(seen_in(g, first, last)[0]) >= ENOUGH or (loops and closes(g, first, last))


@compiled
def sighted_before(g: Graph, k: int) -> bool:
    """Tells if enough landmarks are sighted from step `k` and those before it."""
    return len(seen_in(g, max(k - AROUND, 0), k)[0]) >= ENOUGH


@compiled
def sighted_around(g: Graph, k: int) -> bool:
    """Tells if enough are on either side of it: then landmarks locate it, whatever stretch it is in."""
    return sighted_before(g, k) and len(seen_in(g, k, min(k + AROUND, g.state[STEPS] - 1))[0]) >= ENOUGH


@compiled
def nearest(x: float, y: float, centres: Array) -> int:
    """The row of the nearest of the centres (c, 2) to a place; -1 if there is none."""
    best, least = -1, 0.0
    for i in range(len(centres)):
        dx, dy = centres[i, 0] - x, centres[i, 1] - y
        if best < 0 or dx * dx + dy * dy < least:
            best, least = i, dx * dx + dy * dy
    return best


@compiled
def stretches(g: Graph, first: int, last: int, length: float, longest: int, centres: Array, loops: bool) -> Ints:
    """The last steps of the stretches from step `first` on that end before step `last`.

    A stretch ends further than `length` (m) from its start, or after `longest` steps, or, if it is longer than SHORT of
    the length, where another of the centres (c, 2) of submaps is nearest: so the stretches of a place see the same
    landmarks. It ends between two poses with sightings where enough is in sight on either side. With `loops`, a loop
    closure is as good as that, and what begins after it may be a pose that is not a variable yet.
    """
    out, n, start = np.empty(max(last - first, 0), np.int64), 0, first
    here = nearest(g.steps[first, POINT], g.steps[first, POINT + 1], centres)
    for k in range(first, last):
        dx, dy = g.steps[k, POINT] - g.steps[start, POINT], g.steps[k, POINT + 1] - g.steps[start, POINT + 1]
        far = dx * dx + dy * dy
        if far <= length * length and k - start + 1 < longest:
            if far <= (SHORT * length) ** 2:
                continue
            if nearest(g.steps[k + 1, POINT], g.steps[k + 1, POINT + 1], centres) == here:
                continue
        if g.at[k] < 0 or g.at[k + 1] == PENDING or (g.at[k + 1] < 0 and not loops):
            continue
        if located(g, max(start, k + 1 - AROUND), k, loops) and located(g, k + 1, min(k + AROUND, last), loops):
            out[n] = k
            n += 1
            start = k + 1
            here = nearest(g.steps[start, POINT], g.steps[start, POINT + 1], centres)
    return out[:n]
