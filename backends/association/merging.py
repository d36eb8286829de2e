"""Landmarks that turn out to be one: laps whose drift is larger than landmarks are apart.

A sighting is compared only with landmarks whose place, relative to the robot, is known well enough to tell by one
sighting. Any other is of a new landmark at first. So a lap that closes doubles landmarks, and which of them are which
is decided for a group of them: all at once, by the joint covariance of their places, where the group is much likelier
than chance and than any other group (after Neira and Tardos 2001, and Frey et al., arXiv 1809.09646).
"""

from collections.abc import Container, Iterable
from math import tau
from typing import Any

import numpy as np

from ...core.factors import UNKNOWN, Map, RangeBearing
from ...core.se2 import Array, Ints
from ..api import Expected
from ._merging import ALONE, likeliest_group
from .quantiles import gates

CLEAR = 4.5
"""Logarithm of how much likelier a sighting at its place is of that landmark than by chance, for it to be asked about."""

CLEAR_OLD = 5.5
SURE = 7.0
"""Logarithm of how much likelier a group has to be than chance, and than any other group."""

SHARP = 4.0
"""A landmark may always be told where a sighting's covariance has at most that many times the determinant of the
sensor's: later sightings could not tell it any better."""

TINY = 1e-300
NOW = 3  # looks since a landmark was sighted, for it to be in view: what it tells of the robot is taken as known
RECENT = 60  # looks since a landmark was sighted, for it to be a recent one
GROUP, SEEDS = 12, 6  # recent landmarks of a group at most, and those that a group may start from
JOINT = 0.9999  # probability that the differences of a right group are within their joint gate
WITHIN = 6.0  # standard deviations of the robot's place that an old landmark may be off by
TWICE = 2  # sightings of a landmark from which on it may be merged
MOST = 100_000  # pairs weighed at most in search of a group: the search is given up where there are more
FLOOR = 1e-6  # m²; added to the covariance of each difference


class Merging:
    """Landmarks by when they were sighted, and which of them are one."""

    def __init__(self, given: Iterable[int]) -> None:
        self.same: dict[int, int] = {}  # landmark that was taken for another one -> that
        self._first = dict.fromkeys(given, 0)
        self._last = dict.fromkeys(given, -RECENT)
        self._times = dict.fromkeys(given, TWICE)
        self._beside: dict[int, set[int]] = {landmark: set() for landmark in given}  # landmarks sighted in the same step: they are others
        self._looks = self._sighted = 0
        self._furthest = 0.0
        self._due = False
        self._gates = gates(JOINT, GROUP + 1)

    def now(self, landmark: int) -> int:
        """The landmark that this one is known as now."""
        while landmark in self.same:
            landmark = self.same[landmark]
        return landmark

    def density(self) -> float:
        """Landmarks and clutter per m², as a look has them."""
        return self._sighted / max(self._looks, 1) / (tau / 2 * self._furthest**2)

    def clear(self, expected: Expected, seen: RangeBearing) -> list[int]:
        """The rows of landmarks that a sighting can be told to be of."""
        self._furthest = max(self._furthest, float(seen.z[:, 0].max(initial=0.0)))
        if not self._looks or not len(seen.ids):
            return list(range(len(expected.ids)))
        R = seen.cov.mean(axis=0)
        seen_last = np.array([self._last.get(i, 0) for i in expected.ids.tolist()], np.int64)
        now = seen_last > self._looks - NOW
        c = _given(expected.cov, np.flatnonzero(now), R)
        rows = 2 * np.arange(len(expected.ids))
        S = (c[rows, rows] + R[0, 0]) * (c[rows + 1, rows + 1] + R[1, 1]) - (c[rows + 1, rows] + R[1, 0]) ** 2
        area = np.log(tau * np.sqrt(np.maximum(S, TINY)) * np.maximum(expected.z[:, 0], TINY) * self.density())
        exact = (SHARP * (R[0, 0] * R[1, 1] - R[1, 0] ** 2)) >= S
        old = seen_last <= self._looks - RECENT
        return np.flatnonzero(exact | (area < np.where(old, -CLEAR_OLD, -CLEAR))).tolist()

    def sighted(self, landmarks: list[int]) -> None:
        """Takes the landmarks of a step's sightings."""
        self._looks += 1
        self._sighted += len(landmarks)
        for landmark in landmarks:
            times = self._times[landmark] = self._times.get(landmark, 0) + 1
            self._first.setdefault(landmark, self._looks)
            self._last[landmark] = self._looks
            self._beside.setdefault(landmark, set()).update(landmarks)
            self._due |= times > 1 and times & (times - 1) == 0

    def found(self, inner: Any, known: Container[int]) -> list[tuple[int, int]]:
        """The landmarks that are others, each with that."""
        if not self._due:
            return []
        self._due = False
        recent = [
            b for b, last in self._last.items() if last > self._looks - RECENT and self._times[b] >= TWICE and b < UNKNOWN and b not in known
        ]
        recent = sorted(recent, key=lambda b: -self._times[b])[:GROUP]
        if len(recent) < 2:
            return []
        belief = inner.belief()
        around: Map = inner.map()
        at = {landmark: k for k, landmark in enumerate(around.ids.tolist())}
        recent = [b for b in recent if b in at]
        old = [a for a in at if a in self._first and self._times[a] >= TWICE]
        if around.cov is None or len(recent) < 2:
            return []
        reach = WITHIN * float(np.sqrt(np.linalg.eigvalsh(belief.cov[:2, :2])[-1])) if belief.cov is not None else np.inf
        xb = around.xy[[at[b] for b in recent]]
        xa = around.xy[[at[a] for a in old]]
        near = np.hypot(*(xb[:, None] - xa[None]).transpose(2, 0, 1)) < reach
        first_b, first_a = np.array([self._first[b] for b in recent]), np.array([self._first[a] for a in old])
        allowed = near & (first_a[None] < first_b[:, None])
        for i, b in enumerate(recent):
            for j, a in enumerate(old):
                if allowed[i, j] and a in self._beside[b]:
                    allowed[i, j] = False
        columns = np.flatnonzero(allowed.any(axis=0))
        rows = np.flatnonzero(allowed.any(axis=1))
        if len(rows) < 2 or len(columns) < 2:
            return []
        allowed = np.ascontiguousarray(allowed[np.ix_(rows, columns)])
        names_b, names_a = [recent[i] for i in rows], [old[j] for j in columns]
        places = np.array([at[k] for k in names_b + names_a], np.int64)
        entries = np.stack((2 * places, 2 * places + 1), axis=1).ravel()
        xy, cov = np.ascontiguousarray(around.xy[places]), np.ascontiguousarray(around.cov[np.ix_(entries, entries)])
        return self._decided(xy, cov, allowed, names_b, names_a)

    def _decided(self, xy: Array, cov: Array, allowed: Any, recent: list[int], old: list[int]) -> list[tuple[int, int]]:
        pair, other, none = (np.full(len(recent), ALONE) for _ in range(3))
        chance = self.density()
        gain = likeliest_group(xy, cov, allowed, self._gates, chance, FLOOR, SEEDS, MOST, none, pair)
        if gain < SURE:
            return []
        if gain - likeliest_group(xy, cov, allowed, self._gates, chance, FLOOR, SEEDS, MOST, pair, other) < SURE:
            return []
        found = {b: old[int(a)] for b, a in zip(recent, pair, strict=True) if a != ALONE}
        for b, a in found.items():
            while a in found:  # earlier landmarks alone: it ends
                a = found[a]
            found[b] = a
        return list(found.items())

    def merge(self, pairs: list[tuple[int, int]]) -> None:
        """Takes landmarks for others."""
        for gone, kept in pairs:
            self.same[gone] = kept
            self._first[kept] = min(self._first[kept], self._first.pop(gone))
            self._last[kept] = max(self._last[kept], self._last.pop(gone))
            self._times[kept] += self._times.pop(gone)
            self._beside[kept] |= self._beside.pop(gone)
        gone = dict(pairs)
        for beside in self._beside.values():
            if not beside.isdisjoint(gone):
                beside.update([gone[b] for b in beside if b in gone])


def _given(cov: Array, known: Ints, noise: Array) -> Array:
    """The covariance (2n, 2n) of n expected sightings once those `known` (k,) have been made, with that noise (2, 2)."""
    if not len(known):
        return cov
    entries = np.stack((2 * known, 2 * known + 1), axis=1).ravel()
    S = cov[np.ix_(entries, entries)] + np.kron(np.eye(len(known)), noise)
    return cov - cov[:, entries] @ np.linalg.solve(S, cov[entries])
