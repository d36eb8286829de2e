"""Ranges and bearings alone, fixes and constant errors in FastSLAM: the part of it for logs that have some.

A landmark that was first sighted by a range or a bearing alone begins as hypotheses about a ring or a ray in every
particle (see `_rings`), and is a landmark as all others once nearly all particles are sure of one. Until then sightings
of it weight particles, in version 2 after the pose is drawn; later ones enter the proposal, as fixes do. A range and a
bearing of one landmark at one step are a whole sighting, unless ranges have constant errors.

Nothing is counted twice: a second sighting of a landmark at one step, or a second fix of a heading with an offset,
weights particles after the first has corrected the map, given the pose that was drawn.

Constant errors of ranges are Gaussian in each particle, given its path (see `_parts`), and so is a heading's offset.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from ...core.factors import Prior, RangeBearing, Step
from ...core.partial import BEARING, RANGE
from ...core.se2 import Array, Ints
from ..api import Constant
from ..starting.placing import CLEAR, SPREAD
from . import _parts, _rings
from ._loops import Loops
from ._parts import OWN, SLOPES, WIDE, Flags, Parts, Whitened
from ._proposal import Motion
from .particle_maps import ParticleMaps

SHORTEST = 3.0
"""Standard deviations of a range that starts a landmark: below, it leaves a disc, and the next one starts it."""

UNSURE = 0.01
"""Share of the weight whose particles need not be sure where a landmark is."""

NO_LOOPS = (np.zeros((0, 3)), np.zeros((0, 3, 3)))
NO_GAIN = np.zeros(3)


@dataclass
class _Part:
    """A sighting of a landmark, as in `Parts`."""

    landmark: int
    z: Array
    share: Array
    var: float
    constant: float
    gate: float
    folded: int = -1  # its row in the proposal


class PartialSightings:
    """The constant errors of M particles, and the landmarks that are not placed yet."""

    def __init__(self, prior: Prior, particles: int, gate: float) -> None:
        sds = prior.systematic
        self.constant = sds.range_scale > 0 or sds.range_offset > 0
        self.each = self.constant and sds.each
        self.columns = WIDE if self.constant else SLOPES
        self._sds = np.array((0.0, 0.0, sds.range_scale**2, 0.0, sds.range_offset**2))
        self.common = np.zeros((5, particles))
        if self.constant and not self.each:
            self.common[:] = self._sds[:, None]
        self.turned, self._turn_var = np.zeros(particles), sds.heading_offset**2
        self.open = ParticleMaps(particles, _rings.COLUMNS, 1)
        self._gates = np.array([float(chdtri(k, 1 - gate)) if gate > 0 else np.inf for k in (1, 2, 3)])
        self._parts = list[_Part]()
        self._whole = list[int]()  # landmarks of the step's whole sightings in the log
        self._whitened = self._white(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 2)))
        self._gains = list[Array]()
        self._ahead = np.zeros(0, np.bool_)  # fixes that enter the proposal
        self._refusals = list[Flags]()

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]."""
        self.open.resampled(ancestors)
        self.common = np.take(self.common, ancestors, axis=1)
        self.turned = self.turned[ancestors]

    def adopted(self, filters: Array) -> None:
        """Fills the further columns of a landmark (C, M) that is on a given map."""
        if self.constant:
            filters[SLOPES:] = 0.0
            filters[OWN:] = self._sds[:, None]

    def take(self, step: Step) -> RangeBearing:
        """Takes a step's measurements, and returns the whole sightings, which are not its own."""
        ids, z, cov = step.sightings
        whole = [not self.constant and landmark not in self.open.row for landmark in ids.tolist()]
        self._parts, self._refusals = [], []
        self._whole = np.compress(whole, ids).tolist()
        for i in np.flatnonzero(~np.array(whole, np.bool_)).tolist():
            self._split(int(ids[i]), z[i].copy(), cov[i])
        seen, there = dict[tuple[int, int], int](), set(ids.tolist())
        for i, key in enumerate(zip(step.partial.ids.tolist(), step.partial.kind.tolist(), strict=True)):
            seen[key] = i
        value, var, pairs = step.partial.z, step.partial.var, list[tuple[int, int, int]]()
        for (landmark, kind), i in seen.items():
            other = seen.get((landmark, BEARING if kind == RANGE else RANGE))
            if other is not None and not (self.constant or landmark in there or landmark in self.open.row):
                if kind == RANGE:
                    pairs.append((landmark, i, other))
                continue
            at = np.array((value[i], 0.0) if kind == RANGE else (0.0, value[i]))
            share = np.array((1.0, 0.0) if kind == RANGE else (0.0, 1.0))
            constant = float(self.constant and kind == RANGE)
            self._parts.append(_Part(landmark, at, share, float(var[i]), constant, self._gates[0]))
        self._whitened = self._white(*step.fixes)
        if not pairs:
            return RangeBearing(np.compress(whole, ids), np.compress(whole, z, axis=0), np.compress(whole, cov, axis=0))
        halves = np.array(pairs, np.int64).T
        both = np.zeros((len(pairs), 2, 2))
        both[:, 0, 0], both[:, 1, 1] = var[halves[1]], var[halves[2]]
        return RangeBearing(
            np.concatenate((np.compress(whole, ids), halves[0])),
            np.concatenate((np.compress(whole, z, axis=0), np.column_stack((value[halves[1]], value[halves[2]])))),
            np.concatenate((np.compress(whole, cov, axis=0), both)),
        )

    def propose(
        self, poses: Array, motion: Motion, loops: Loops | None, maps: ParticleMaps, slots: Ints, z: Array, cov: Array,
        distance: Array, volume: Array,
    ) -> None:  # fmt: skip
        """Samples the poses, as version 2 of FastSLAM does; see `_proposal.propose`."""
        first, folded = list[_Part](), set(self._whole)
        for part in self._parts:
            if part.landmark in maps.row and part.landmark not in folded:
                folded.add(part.landmark)
                part.folded = len(first)
                first.append(part)
        at = maps.slots(np.array([maps.row[part.landmark] for part in first], np.int64))
        M = poses.shape[1]
        parts = Parts(
            at, _stacked([part.z for part in first]), _stacked([part.share for part in first]),
            np.array([part.var for part in first]), np.array([part.constant for part in first]),
            np.array([part.gate for part in first]), np.zeros((len(first), M), np.bool_),
        )  # fmt: skip
        self._refusals = list(parts.refused)
        heading = (self._whitened.root[:, :, 2] != 0).any(axis=1)
        self._ahead = ~heading | (np.cumsum(heading) == 1) if self._turn_var > 0 else np.ones_like(heading)
        all_, ahead = self._whitened, self._ahead
        entering = Whitened(all_.z[ahead], all_.arm[ahead], all_.root[ahead], all_.gate[ahead], all_.refused[ahead])
        _parts.propose(
            poses, motion, Loops(np.zeros((0, 3, M)), *NO_LOOPS) if loops is None else loops, maps.filters, slots, z,
            cov, self.common, self.each, parts, entering, self.turned, distance, volume,
        )  # fmt: skip
        all_.refused[ahead] = entering.refused

    def correct(self, poses: Array, maps: ParticleMaps, weights: Array) -> Array:
        """Corrects landmarks and constant errors by sightings and fixes at the poses (5, M).

        Returns the -2 log-likelihood (M,) of all that the proposal has not, up to a constant.
        """
        distance = np.zeros(poses.shape[1])
        for part in self._parts:
            one = (part.z, part.share, part.var, part.constant)
            if part.landmark in maps.row:
                slot = int(maps.slots(np.array([maps.row[part.landmark]]))[0])
                refused = self._refusals[part.folded] if part.folded >= 0 else np.zeros(len(distance), np.bool_)
                _parts.correct(
                    poses, maps.filters, slot, self.common, self.each, *one, part.gate, part.folded >= 0, refused,
                    distance,
                )  # fmt: skip
                if part.folded < 0:
                    self._refusals.append(refused)
            elif part.landmark in self.open.row:
                slot = int(self.open.slots(np.array([self.open.row[part.landmark]]))[0])
                _rings.respond(poses, self.open.filters, slot, self.common, self.each, *one, distance)
            else:
                self._begin(poses, part)
        for i, (root, ahead) in enumerate(zip(self._whitened.root, self._ahead, strict=True)):
            if not ahead:
                root[:] = self._root(self._cov[i])
            gain = self._turn_var * (root.T @ root)[2]
            _parts.take_fix(poses, self._whitened, i, gain, bool(ahead), self.turned, distance)
            if self._whitened.refused[i] @ weights < 0.5:
                self._turn_var -= self._turn_var * gain[2]
        for landmark in dict.fromkeys(part.landmark for part in self._parts):
            if landmark in self.open.row:
                self._place(poses, landmark, maps, weights)
        return distance

    def refused(self, weights: Array) -> int:
        """The number of the last step's measurements that particles of more than half of the weight have refused."""
        return sum(bool(one @ weights > 0.5) for one in (*self._refusals, *self._whitened.refused))

    def marginals(self, filters: Array) -> Array:
        """(N, 5, M) landmarks' mean and covariance in each particle, of their filters (N, C, M)."""
        if not self.constant:
            return filters
        shape = (len(filters), 2, 2, filters.shape[-1])
        B = filters[:, SLOPES:OWN].reshape(shape)
        errors = filters[:, OWN:] if self.each else np.broadcast_to(self.common, (len(filters), *self.common.shape))
        S = errors[:, [2, 3, 3, 4]].reshape(shape)
        spread = np.einsum("niam,nabm,njbm->nijm", B, S, B)
        mean = filters[:, :2] + np.einsum("niam,nam->nim", B, errors[:, :2])
        return np.concatenate((mean, filters[:, 2:5] + spread[:, (0, 0, 1), (0, 1, 1)]), axis=1)

    def shared(self, filters: Array, weights: Array) -> Array | float:
        """(2N, 2N) covariance between landmarks by errors common to all, as far as `marginals` has not got it."""
        if not self.constant or self.each:
            return 0.0
        n, M = len(filters), len(weights)
        B = filters[:, SLOPES:OWN].reshape(n, 2, 2, M)
        S = self.common[[2, 3, 3, 4]].reshape(2, 2, M)
        found = np.einsum("niam,abm,kjbm,m->nikj", B, S, B, weights)
        found[np.arange(n), :, np.arange(n)] = 0.0
        return found.reshape(2 * n, 2 * n)

    def unplaced(self, poses: Array, particle: int) -> tuple[Ints, Array, Array]:
        """The k landmarks that are open, each at the particle's likeliest hypothesis.

        Returns ids (k,), places (k, 2) and covariances xx, xy, yy (k, 3).
        """
        M = poses.shape[1]
        slots = self.open.slots(np.fromiter(self.open.row.values(), np.int64, len(self.open.row)))
        filters, unsure = np.zeros((len(slots), self.columns, M)), np.zeros(M, np.bool_)
        for into, slot in enumerate(slots.tolist()):
            _rings.place(
                poses, self.open.filters, slot, self.common, self.each, CLEAR, SPREAD, filters, into, unsure
            )  # fmt: skip
        found = self.marginals(filters)[..., particle]
        return np.fromiter(self.open.row, np.int64, len(slots)), found[:, :2].copy(), found[:, 2:]

    def estimated(self, filters: Array, unplaced: Ints, particle: int, weights: Array) -> Constant | None:
        """A particle's constant errors; each landmark's own in the order of `filters` (N, C, M), then `unplaced`.

        Their standard deviations are those of all particles with their weights (M,).
        """
        if not self.constant and not self._turn_var > 0:
            return None
        values, all_of = self.common[:2, particle, None], self.common[None]
        if self.each:
            rows = np.array([self.open.row[landmark] for landmark in unplaced.tolist()], np.int64)
            own = self.open.filters[self.open.slots(rows), _rings.OWN_HERE : _rings.OWN_HERE + 5]
            all_of = np.concatenate((filters[:, OWN : OWN + 5], own))
            values = all_of[:, :2, particle].T
        scale, offset = (
            np.sqrt(all_of[:, within] @ weights + (all_of[:, k] - (all_of[:, k] @ weights)[:, None]) ** 2 @ weights)
            for k, within in ((0, 2), (1, 4))
        )
        apart = float((self.turned - self.turned @ weights) ** 2 @ weights)
        sd = Constant(scale, offset, float(np.sqrt(self._turn_var + apart)))
        return Constant(values[0].copy(), values[1].copy(), float(self.turned[particle]), sd=sd)

    def _split(self, landmark: int, z: Array, cov: Array) -> None:
        """Adds a whole sighting as a bearing, and a range given that: its errors are independent of the bearing's."""
        part = cov[0, 1] / cov[1, 1]
        self._parts.append(_Part(landmark, z, np.array((0.0, 1.0)), float(cov[1, 1]), 0.0, np.inf))
        self._parts.append(_Part(landmark, z, np.array((1.0, -part)), float(cov[0, 0] - part * cov[0, 1]), 0.0, np.inf))

    def _white(self, z: Array, cov: Array, arm: Array) -> Whitened:
        """Fixes with the root of their information, the heading's offset counted as noise."""
        self._ahead, self._cov = np.zeros(len(z), np.bool_), cov
        roots = np.array([self._root(one) for one in cov]).reshape(-1, 3, 3)
        gates = self._gates[(~np.isnan(z)).sum(axis=1) - 1]
        return Whitened(np.nan_to_num(z), arm.copy("C"), roots, gates, np.zeros((len(z), len(self.turned)), np.bool_))

    def _root(self, cov: Array) -> Array:
        """The root (3, 3) of a fix's information at present, zero in the columns of what is not measured."""
        known = ~np.isnan(np.diagonal(cov))
        V, root, k = cov.copy(), np.zeros((3, 3)), int(known.sum())
        V[2, 2] += self._turn_var
        root[:k, known] = np.linalg.inv(np.linalg.cholesky(V[known][:, known]))
        return root

    def _begin(self, poses: Array, part: _Part) -> None:
        """Starts a landmark of which a range or a bearing has been sighted."""
        if part.share[0] > 0:
            offset, spread = (self.common[1].max(), self._sds[4]) if part.constant else (0.0, 0.0)
            if part.z[0] - offset < SHORTEST * np.sqrt(part.var + spread):
                return
        slot = self.open.add(part.landmark)
        _rings.begin(
            poses, self.open.filters, slot, self.common, self.each, part.z, bool(part.share[0] > 0), part.var,
            part.constant, self._sds if self.each else np.zeros(5),
        )  # fmt: skip

    def _place(self, poses: Array, landmark: int, maps: ParticleMaps, weights: Array) -> None:
        """Makes an open landmark one as all others, if particles are sure where it is."""
        slot = int(self.open.slots(np.array([self.open.row[landmark]]))[0])
        M = poses.shape[1]
        placed, sure = np.zeros((1, self.columns, M)), np.zeros(M, np.bool_)
        _rings.place(poses, self.open.filters, slot, self.common, self.each, CLEAR, SPREAD, placed, 0, sure)
        if weights @ ~sure < UNSURE:
            at = maps.add(landmark)
            maps.filters[at] = placed[0]
            self.open.remove(landmark)


def _stacked(rows: list[Array]) -> Array:
    """(k, 2)."""
    return np.array(rows).reshape(-1, 2)
