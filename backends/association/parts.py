"""Data association of partial sightings without an id: a range alone, or a bearing alone, of a landmark on the map.

It is a second pass, once the whole sightings of the step are named: the expectation is that given these, and only the
component that was measured is compared. A range fits all landmarks on a ring, and a bearing those on a ray. So a
partial sighting is named only where one landmark is clearly likelier than any other, and than none, which is a sighting
from anywhere in reach; else it is left out. One that fits none starts no landmark.

The sightings are taken in turns, that which is clearest first, and each narrows the expectation of the next.
"""

from math import log, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, RangeBearing
from ...core.partial import RANGE, Partial
from ...core.se2 import Array, Ints, wrap
from ..api import Expected

CLEAR = 6.0
"""Twice the logarithm of how much likelier a landmark has to be than any other, or none: odds of twenty to one."""

OFTEN = 4.0
"""Times as many sightings that are of a landmark on the map as of none: clutter, or one that is not on it yet."""

REACH = 1.2
"""Of the furthest range so far, how far away a landmark may be that a range or a bearing alone is of.

Of 600 steps of a circle among 20 landmarks with 20 % clutter, 6 seeds, twice as far has 4.6 % of the partial sightings
named wrong, and 48 % right, this far 3.0 and 49 %.
"""

ANY = 1e4
"""rad²: the variance of a bearing that was not measured, and likewise that of a range in squares of the reach."""

BOUNDLESS = 1e4  # m; the reach before any range is known


class Weights(NamedTuple):
    """The likelihood of a partial sighting for each of n landmarks, and for none."""

    loss: Array  # (n,) twice the negative logarithm of its density; infinite for a landmark that it cannot be of
    distance: Array  # (n,) squared, of one degree of freedom
    none: float  # the loss of a sighting of none: anywhere in reach, or in any direction


def rows(of: Partial, kept: NDArray[np.bool]) -> Partial:
    """The partial sightings that are `kept`, (p,)."""
    return Partial(of.ids[kept], of.kind[kept], of.z[kept], of.var[kept])


def as_whole(parts: Partial, reach: float) -> RangeBearing:
    """The sightings as whole ones, of which one component says nothing, to ask a backend what it expects of them."""
    alone = parts.kind == RANGE
    z = np.where(np.stack((alone, ~alone), axis=1), parts.z[:, None], (reach / 2, 0.0))
    cov = np.zeros((len(z), 2, 2))
    cov[:, 0, 0] = np.where(alone, parts.var, reach * reach)
    cov[:, 1, 1] = np.where(alone, ANY, parts.var)
    return RangeBearing(parts.ids, z, cov)


class Conditional:
    """Expected ranges and bearings of n landmarks, given some that were measured."""

    def __init__(self, expected: Expected) -> None:
        self.ids: list[int] = expected.ids.tolist()
        self.z, self.cov = expected.z.ravel().copy(), expected.cov.copy()

    def given(self, entries: Ints, z: Array, noise: Array) -> None:
        """Adds measurements z (m,) of entries (m,), even ones being ranges, with covariance `noise` (m, m)."""
        if not len(entries):
            return
        off = z - self.z[entries]
        off = np.where(entries % 2 == 1, wrap(off), off)
        S = self.cov[np.ix_(entries, entries)] + noise
        K = np.linalg.solve(S, self.cov[entries]).T
        self.z += K @ off
        self.cov -= K @ self.cov[entries]

    def given_whole(self, seen: RangeBearing) -> None:
        """Adds the whole sightings of those landmarks that are expected."""
        at = {landmark: a for a, landmark in enumerate(self.ids)}
        rows = [(i, at[landmark]) for i, landmark in enumerate(seen.ids.tolist()) if landmark in at]
        noise = np.zeros((2 * len(rows), 2 * len(rows)))
        for m, (i, _) in enumerate(rows):
            noise[2 * m : 2 * m + 2, 2 * m : 2 * m + 2] = seen.cov[i]
        entries = np.array([2 * a + part for _, a in rows for part in (0, 1)], np.int64)
        self.given(entries, seen.z[[i for i, _ in rows]].ravel(), noise)

    def weights(self, kind: int, z: float, var: float, reach: float, taken: set[tuple[int, int]]) -> Weights:
        """The likelihood of one partial sighting; `taken` are landmarks, by kind, that the step has another of."""
        part = 0 if kind == RANGE else 1
        off, spread = z - self.z[part::2], np.diagonal(self.cov)[part::2] + var
        off = off if kind == RANGE else wrap(off)
        free = np.array([(landmark, kind) not in taken for landmark in self.ids], np.bool)
        free &= (spread > 0) & (self.z[::2] <= reach)
        distance = np.where(free, off * off / np.where(free, spread, 1.0), np.inf)
        loss = distance + np.log(tau * np.where(free, spread, 1.0))
        return Weights(loss, distance, 2 * log(OFTEN * (reach if kind == RANGE else tau)))


def named(parts: Partial, expected: Expected, whole: RangeBearing, gate: float, reach: float) -> tuple[Ints, int]:
    """Ids of p partial sightings (p,), of which those UNKNOWN so far are decided on; UNKNOWN for one left out.

    `whole` are the step's whole sightings with their ids. A squared distance of one degree of freedom is within `gate`;
    no landmark is sighted from beyond the `reach`, m. Returns the number of pairs weighed, too.
    """
    belief, ids = Conditional(expected), parts.ids.copy()
    belief.given_whole(whole)
    kinds, zs, variances = (column.tolist() for column in parts[1:])
    taken = {(landmark, kind) for landmark, kind in zip(ids.tolist(), kinds, strict=True) if landmark != UNKNOWN}
    left = np.flatnonzero(ids == UNKNOWN).tolist()
    tried = len(left) * len(belief.ids)
    while left and belief.ids:
        found = [clearest(belief.weights(kinds[i], zs[i], variances[i], reach, taken), gate) for i in left]
        turn = int(np.argmax([margin for _, margin in found]))
        a, margin = found[turn]
        if margin < 0:
            break
        i = left.pop(turn)
        ids[i] = belief.ids[a]
        taken.add((belief.ids[a], kinds[i]))
        entry = np.array([2 * a + (kinds[i] != RANGE)], np.int64)
        belief.given(entry, np.array([zs[i]]), np.array([[variances[i]]]))
    return ids, tried


def clearest(of: Weights, gate: float) -> tuple[int, float]:
    """The likeliest landmark of a sighting, and by how much it is clearer than it has to be; negative: it is not."""
    a = int(np.argmin(of.loss))
    if not of.distance[a] < gate:
        return a, -np.inf
    second = float(np.delete(of.loss, a).min(initial=of.none))
    return a, second - CLEAR - float(of.loss[a])
