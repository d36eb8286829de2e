"""Landmarks that turn out to be one: laps whose drift is larger than landmarks are apart.

A sighting is compared only with landmarks whose place, relative to the robot, is known well enough to tell by one
sighting, or by those of one step together. Any other is of a new landmark at first. So a lap that closes doubles
landmarks, and which of them are which is decided for a group of them: all at once, by the joint covariance of their
places, where the group is much likelier than chance and than any other group (after Neira and Tardos 2001,
and Frey et al., arXiv 1809.09646).
"""

from collections.abc import Container, Iterable
from math import tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, RangeBearing
from ...core.se2 import Array, Ints
from ..api import Backend, Expected
from ._merging import ALONE, TWO, likeliest_group
from .quantiles import gates

CLEAR, CLEAR_OLD = 4.5, 5.5
"""Logarithm of how much likelier a sighting where a landmark is expected has to be of that than of any by chance, for a
landmark to be asked about: of those sighted lately, and of the others."""

SHARP = 4.0
"""A landmark may always be told where a sighting's covariance has at most that many times the determinant of the
sensor's: later sightings could not tell it any better."""

SURE = 7.0
"""Logarithm of how much likelier a group has to be than chance, and than any other group."""

NOW = 3  # looks since a landmark was sighted, for it to be in view: what it tells of the robot counts as known
RECENT = 60  # looks since a landmark was sighted, for it to be a recent one
TWICE = 2  # sightings of a landmark from which on it may be merged
GROUP, SEEDS = 12, 6  # recent landmarks of a group at most, and those that a group may start from
JOINT = 0.9999  # probability that the differences of a right group are within their joint gate
WITHIN = 6.0  # standard deviations, of a sighting in the world's frame, that an old landmark may be off by
MOST = 100_000  # pairs weighed at most in search of a group: the search is given up where there are more
SPLIT = 8 / tau
"""Variances of a sighting that are added to those of x and y of each difference. Where a landmark is on the map twice,
each sighting goes to the nearer one, so the two end sqrt(8 / pi) standard deviations apart, in any direction."""

FLOOR = 1e-6  # m²; added besides
TINY = 1e-300


class _Candidates(NamedTuple):
    """Recent landmarks, and old ones that they may be."""

    recent: list[int]
    old: list[int]
    allowed: NDArray[np.bool]  # (b, n) pairs that may be one
    xy: Array  # (b + n, 2) m
    cov: Array  # (2 (b + n), 2 (b + n)) m²


class Merging:
    """Landmarks by when they were sighted, and which of them are one."""

    def __init__(self, given: Iterable[int]) -> None:
        landmarks = list(given)
        self.same: dict[int, int] = {}  # landmark that was taken for another one -> that
        self._first = dict.fromkeys(landmarks, 0)
        self._last = dict.fromkeys(landmarks, -RECENT)
        self._times = dict.fromkeys(landmarks, TWICE)
        self._beside = {landmark: set[int]() for landmark in landmarks}  # sighted in the same step: they are others
        self._looks = self._sighted = 0
        self._furthest = 0.0  # m
        self._noise = 0.0  # m², mean variance of sightings so far, along and across their lines
        self._due = False
        self._gates = gates(JOINT, GROUP + 1)

    def now(self, landmark: int) -> int:
        """The landmark that this one is taken for."""
        while landmark in self.same:
            landmark = self.same[landmark]
        return landmark

    def clear(self, expected: Expected, seen: RangeBearing) -> list[int]:
        """The rows of landmarks that a sighting can be told to be of, given that those in view are."""
        self._furthest = max(self._furthest, float(seen.z[:, 0].max(initial=0.0)))
        if not self._looks or not len(seen.ids):
            return list(range(len(expected.ids)))
        R = seen.cov.mean(axis=0)
        self._noise = max(self._noise, float(R[0, 0] + R[1, 1] * np.square(seen.z[:, 0]).mean()) / 2)
        last = np.array([self._last.get(i, 0) for i in expected.ids.tolist()], np.int64)
        c = _given(expected.cov, np.flatnonzero(last > self._looks - NOW), R)
        enough = np.where(last <= self._looks - RECENT, -CLEAR_OLD, -CLEAR)
        told = self._told(expected.z, c, R, enough)
        if not told.all():
            told |= self._together(expected, seen, R, enough, told)
        return np.flatnonzero(told).tolist()

    def _told(self, z: Array, cov: Array, R: Array, enough: Array) -> NDArray[np.bool]:
        """(n,) whether one sighting tells each landmark, expected at z (n, 2) with that covariance (2n, 2n)."""
        rows = 2 * np.arange(len(z))
        S = (cov[rows, rows] + R[0, 0]) * (cov[rows + 1, rows + 1] + R[1, 1]) - (cov[rows + 1, rows] + R[1, 0]) ** 2
        by_chance = tau * np.sqrt(np.maximum(S, TINY)) * np.maximum(z[:, 0], TINY) * self._density()
        sharp = SHARP * (R[0, 0] * R[1, 1] - R[1, 0] ** 2) >= S
        return sharp | (np.log(by_chance) < enough)

    def _together(
        self, expected: Expected, seen: RangeBearing, R: Array, enough: Array, told: NDArray[np.bool]
    ) -> NDArray[np.bool]:
        """(n,) the landmarks that sightings of one step tell together, where one alone does not.

        The sightings are a group of recent landmarks, at their places in the body's frame. Each of its landmarks has to
        be told by its sighting once the others' are known.
        """
        found = np.zeros(len(told), np.bool_)
        xy, cov = _flat(expected.z, expected.cov)
        b, n = len(seen.z), len(xy)
        noise = np.zeros((b, 2, b, 2))
        noise[np.arange(b), :, np.arange(b)] = seen.cov
        own, noise = _flat(seen.z, noise.reshape(2 * b, 2 * b))
        joint = np.zeros((2 * (b + n), 2 * (b + n)))
        joint[: 2 * b, : 2 * b], joint[2 * b :, 2 * b :] = noise, cov
        those = _Candidates([], [], np.ones((b, n), np.bool_), np.concatenate((own, xy)), joint)
        pair, other = (np.full(b, ALONE) for _ in range(2))
        gain = self._group(those, np.full(b, ALONE), pair)
        if gain < SURE or gain - self._group(those, pair, other) < SURE:
            return found
        group = pair[pair != ALONE]
        for k, a in enumerate(group.tolist()):
            rest = _given(expected.cov, np.delete(group, k), R)
            found[a] = self._told(expected.z, rest, R, enough)[a]
        return found

    def sighted(self, landmarks: list[int]) -> None:
        """Takes the landmarks of a step's sightings."""
        self._looks += 1
        self._sighted += len(landmarks)
        for landmark in landmarks:
            times = self._times[landmark] = self._times.get(landmark, 0) + 1
            self._first.setdefault(landmark, self._looks)
            self._last[landmark] = self._looks
            self._beside.setdefault(landmark, set()).update(landmarks)
            self._due = self._due or (times >= TWICE and times & (times - 1) == 0)

    def found(self, inner: Backend, known: Container[int]) -> list[tuple[int, int]]:
        """The landmarks that are others, each with that; those `known` by an id are no others'.

        It looks where a landmark has been sighted 2, 4, 8, ... times.
        """
        if not self._due:
            return []
        self._due = False
        those = self._candidates(inner, known)
        if those is None:
            return []
        pair, other = (np.full(len(those.recent), ALONE) for _ in range(2))
        floor = FLOOR + SPLIT * self._noise
        gain = self._group(those, np.full(len(pair), ALONE), pair, floor)
        if gain < SURE or gain - self._group(those, pair, other, floor) < SURE:
            return []
        found = {b: those.old[a] for b, a in zip(those.recent, pair.tolist(), strict=True) if a != ALONE}
        return [(b, _end(b, found)) for b in found]

    def merge(self, pairs: list[tuple[int, int]]) -> None:
        """Takes landmarks for others."""
        for gone, kept in pairs:
            self.same[gone] = kept
            self._first[kept] = min(self._first[kept], self._first.pop(gone))
            self._last[kept] = max(self._last[kept], self._last.pop(gone))
            self._times[kept] += self._times.pop(gone)
            self._beside[kept] |= self._beside.pop(gone)
        now = dict(pairs)
        for beside in self._beside.values():
            beside.update([now[b] for b in beside if b in now])

    def _density(self) -> float:
        """Landmarks and clutter per m², as looks have them."""
        return self._sighted / max(self._looks, 1) / (tau / 2 * max(self._furthest, TINY) ** 2)

    def _candidates(self, inner: Backend, known: Container[int]) -> _Candidates | None:
        """The recent landmarks that may be old ones, none sighted in a step with it; None for fewer than two."""
        lately = self._looks - RECENT
        recent = [b for b, last in self._last.items() if last > lately and self._times[b] >= TWICE]
        recent = [b for b in recent if b < UNKNOWN and b not in known]
        if len(recent) < TWO:
            return None
        around, belief = inner.map(), inner.belief()
        if around.cov is None or belief is None or belief.cov is None:
            return None
        at = {landmark: k for k, landmark in enumerate(around.ids.tolist())}
        recent = sorted((b for b in recent if b in at), key=lambda b: -self._times[b])
        old = [a for a in at if self._times.get(a, 0) >= TWICE and a not in self.same]
        xy_b, xy_a = (around.xy[[at[i] for i in those]] for those in (recent, old))
        reach = WITHIN * float(np.sqrt(np.linalg.eigvalsh(belief.cov[:2, :2])[-1] + self._noise))
        allowed = np.hypot(*(xy_b[:, None] - xy_a[None]).transpose(2, 0, 1)) < reach
        for i, j in zip(*(where.tolist() for where in np.nonzero(allowed)), strict=True):
            b, a = recent[i], old[j]
            allowed[i, j] = self._first[a] < self._first[b] and a not in self._beside[b]
        rows = np.flatnonzero(allowed.any(axis=1))[:GROUP].tolist()
        columns = np.flatnonzero(allowed[rows].any(axis=0)).tolist()
        if min(len(rows), len(columns)) < TWO:
            return None
        recent, old = [recent[i] for i in rows], [old[j] for j in columns]
        places = np.array([at[i] for i in (*recent, *old)], np.int64)
        entries = np.stack((2 * places, 2 * places + 1), axis=1).ravel()
        cov = np.ascontiguousarray(around.cov[np.ix_(entries, entries)])
        return _Candidates(recent, old, allowed[np.ix_(rows, columns)].copy(), around.xy[places].copy(), cov)

    def _group(self, those: _Candidates, against: Ints, pair: Ints, floor: float = FLOOR) -> float:
        """The likeliest group that has little in common with `against`, in `pair`: see `likeliest_group`."""
        _, _, allowed, xy, cov = those
        return likeliest_group(xy, cov, allowed, self._gates, self._density(), floor, SEEDS, MOST, against, pair)


def _end(landmark: int, of: dict[int, int]) -> int:
    """The earliest landmark that a landmark is of, each being of an earlier one."""
    while landmark in of:
        landmark = of[landmark]
    return landmark


def _given(cov: Array, known: Ints, noise: Array) -> Array:
    """The covariance (2n, 2n) of n expected sightings once those `known` (k,) were made with that noise (2, 2)."""
    if not len(known):
        return cov
    entries = np.stack((2 * known, 2 * known + 1), axis=1).ravel()
    S = cov[np.ix_(entries, entries)] + np.kron(np.eye(len(known)), noise)
    return cov - cov[:, entries] @ np.linalg.solve(S, cov[entries])


def _flat(z: Array, cov: Array) -> tuple[Array, Array]:
    """Ranges and bearings (n, 2), with their covariance (2n, 2n), as places in the body's frame with theirs."""
    n, (c, s) = len(z), (np.cos(z[:, 1]), np.sin(z[:, 1]))
    J = np.stack((np.stack((c, -z[:, 0] * s), axis=-1), np.stack((s, z[:, 0] * c), axis=-1)), axis=1)
    flat = np.einsum("iab,ibjc,jdc->iajd", J, cov.reshape(n, 2, n, 2), J, optimize=True)
    return z[:, :1] * np.stack((c, s), axis=1), np.ascontiguousarray(flat.reshape(2 * n, 2 * n))
