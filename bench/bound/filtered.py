"""Covariances of an efficient filter: a Kalman filter of a log linearised at the true state, in covariance form.

Its state has a few sums over the path besides, what an alignment with the truth takes away: with p_k the position at
step k and weights w_k they are s = sum of w_k p_k. An estimate of step l is not correlated with what was measured up to
then, so that the errors at steps k < l have the covariance of p_k and p_l given these measurements.

The bias of a gyro is one more number of the state, which walks. A motion and its turn are split as in `core/gyro.py`.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from ...backends.constant_errors import HELD, fitted
from ...backends.models import sight
from ...core.factors import Log
from ...core.gyro import conditioned
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ...core.truth.errors import rows_of
from .known_log import KnownLog

VAGUE = 1e3
"""m, standard deviation of a landmark before it is sighted; of none is that much known."""


class Filtered(NamedTuple):
    """Covariances and variances of an efficient filter."""

    cov: Array  # (n, 3, 3) of the poses, each given the measurements so far
    online: Array  # (a,) variances of the sums over its online path
    final: Array  # (a,) variances of the sums over the path given all measurements


class _Rows(NamedTuple):
    """Measurements of one kind, d numbers each: of step `step`, with Jacobians by entries of the state."""

    step: Ints  # (k,)
    entries: Ints  # (k, j)
    jacobian: Array  # (k, d, j)
    cov: Array  # (k, d, d)


class _Turned(NamedTuple):
    """A step's motion by wheels and gyro: what both tell of the bias, and the motion given that."""

    walk: float  # (rad/s)^2, of the bias since the row before
    dt: Array  # (1, 1) s, the derivative by the bias of what is told of it
    told_var: Array  # (1, 1) rad^2
    cov: Array  # (3, 3) of the motion
    slope: Array  # (3,) the derivative of the motion by the bias


def filtered(known: KnownLog, weights: Array) -> Filtered:
    """Filters; `weights` (a, n, 2) are those of the sums. Diverged where a landmark is at the robot's place."""
    log, path = known.log, known.path
    sums = len(weights)
    state = _State(known, sums)
    rows = [one for one in state.rows() if len(one.step)]
    firsts = [np.searchsorted(one.step, np.arange(len(log) + 1)) for one in rows]
    P, cov, online = state.P, np.empty((len(log), 3, 3)), np.zeros(sums)
    added, turns, bias = slice(3, 3 + sums), _turns(log), state.bias
    for k in range(len(log)):
        n = state.used[k]
        if k:
            moved, turn = log.delta_cov[k], turns.get(k)
            if turn is not None:
                P[bias, bias] += turn.walk
                _update(P[:n, :n], np.array([bias]), turn.dt, turn.told_var)
                moved = turn.cov
            F = _lever(path[k, :2] - path[k - 1, :2])
            P[:3, :n] = F @ P[:3, :n]
            P[:n, :3] = P[:n, :3] @ F.T
            if turn is not None:
                by = _to_world(path[k - 1, 2]) @ turn.slope
                P[:3, :n] += by[:, None] * P[bias, :n]
                P[:n, :3] += P[:n, bias, None] * by
            P[:3, :3] += _turned(moved, path[k - 1, 2])
        for one, first in zip(rows, firsts, strict=True):
            for r in range(first[k], first[k + 1]):
                _update(P[:n, :n], one.entries[r], one.jacobian[r], one.cov[r])
        w = weights[:, k]
        online += np.einsum("ai,ij,aj->a", w, P[:2, :2], w) + 2 * np.einsum("ai,ai->a", P[added, :2], w)
        P[added, :n] += w @ P[:2, :n]
        P[:n, added] += P[:n, :2] @ w.T
        if (clone := state.clones.get(k)) is not None:
            P[clone, :n], P[:n, clone] = P[:3, :n], P[:n, :3]
            P[clone, clone] = P[:3, :3]
        cov[k] = P[:3, :3]
    return Filtered(cov, online, np.diagonal(P)[added].copy())


class _State:
    """The state: pose, sums, constant errors, the bias of a gyro, then landmarks and kept poses as they come."""

    def __init__(self, known: KnownLog, sums: int) -> None:
        log, prior = known.log, known.log.prior
        self._known, self._systematic = known, prior.systematic
        partial = np.zeros((2, 0), np.int64) if log.partial is None else np.stack((log.partial.ids, log.partial.step))
        ids = np.concatenate((log.ids, partial[0]))
        step = np.concatenate((log.sighting_step, partial[1]))
        given = np.zeros(0, np.int64) if prior.map is None else prior.map.ids
        self.ids: Ints
        self.ids, which = np.unique(np.concatenate((given, ids)), return_inverse=True)
        comes = np.full(len(self.ids), len(log))
        np.minimum.at(comes, which, np.concatenate((np.zeros(len(given), np.int64), step)))
        kept = np.unique(log.loop_to)
        constants = _constants(log, len(self.ids))
        self._constant = 3 + sums
        first = self._constant + len(constants)
        self.bias = first - 1
        """The entry of the bias of a gyro, if there is one."""
        size = np.concatenate((np.full(len(self.ids), 2), np.full(len(kept), 3)))
        order = np.argsort(np.concatenate((comes, kept)), kind="stable")
        at = np.empty(len(order), np.int64)
        at[order] = first + np.cumsum(size[order]) - size[order]
        self._landmark, self.clones = (
            at[: len(comes)],
            {int(k): slice(int(a), int(a) + 3) for k, a in zip(kept, at[len(comes) :], strict=True)},
        )
        there = np.bincount(np.concatenate((comes, kept)), size, len(log) + 1)
        self.used: list[int] = (first + np.cumsum(there)[: len(log)]).astype(int).tolist()
        self.P = np.zeros((first + size.sum(),) * 2)
        self.P[:3, :3] = prior.cov
        self.P[range(self._constant, first), range(self._constant, first)] = np.square(constants)
        places = self._landmark[:, None] + np.arange(2)
        self.P[places, places] = VAGUE**2
        if prior.map is not None:
            mine = places[rows_of(self.ids, given)].ravel()
            self.P[np.ix_(mine, mine)] = 0.0 if prior.map.cov is None else prior.map.cov

    def rows(self) -> list[_Rows]:
        """All measurements, kind by kind."""
        return [self._whole(), *self._partial(), *self._fixes(), self._loops()]

    def _entries(self, ids: Ints) -> Ints:
        """(k, 5) entries of the pose and of landmarks `ids` (k,)."""
        landmark = self._landmark[rows_of(self.ids, ids)]
        return np.concatenate((np.tile(np.arange(3), (len(ids), 1)), landmark[:, None] + np.arange(2)), axis=1)

    def _seen(self, step: Ints, ids: Ints) -> tuple[Array, Array]:
        """True ranges (k,), and Jacobians (k, 2, 5) of range and bearing by pose and landmark."""
        known = self._known
        xy = known.landmarks.xy[rows_of(known.landmarks.ids, ids)]
        z, by_pose, by_landmark = sight(known.path[step], xy)
        return z[:, 0], np.concatenate((by_pose, by_landmark), axis=2)

    def _whole(self) -> _Rows:
        log = self._known.log
        step = log.sighting_step
        return _Rows(step, self._entries(log.ids), self._seen(step, log.ids)[1], log.z_cov)

    def _partial(self) -> list[_Rows]:
        known, table, sds = self._known, self._known.log.partial, self._systematic
        if table is None:
            return []
        constant = fitted(known.log, known.path, known.landmarks)
        r, J = self._seen(table.step, table.ids)
        entries, cov = self._entries(table.ids), table.var[:, None, None]
        ranges, turns = np.flatnonzero(table.kind == RANGE), np.flatnonzero(table.kind != RANGE)
        place = rows_of(self.ids, table.ids[ranges]) if sds.each else np.zeros(len(ranges), np.int64)
        scale = constant.range_scale
        if len(scale) > 1:
            scale = scale[rows_of(known.landmarks.ids, table.ids[ranges])]
        by = np.concatenate(((1 + scale)[..., None] * J[ranges, 0], r[ranges, None], np.ones((len(ranges), 1))), axis=1)
        of = self._constant + 2 * place[:, None] + np.arange(2)
        return [
            _Rows(table.step[ranges], np.concatenate((entries[ranges], of), axis=1), by[:, None], cov[ranges]),
            _Rows(table.step[turns], entries[turns], J[turns, 1:], cov[turns]),
        ]

    def _fixes(self) -> list[_Rows]:
        """Fixes by what they measure: as many kinds as there are."""
        table, path = self._known.log.fixes, self._known.path
        if table is None:
            return []
        heading = path[table.step, 2]
        c, s = np.cos(heading), np.sin(heading)
        J = np.zeros((len(table), 3, 4))
        J[:, :, :3] = np.eye(3)
        J[:, 0, 2] = -(s * table.arm[:, 0] + c * table.arm[:, 1])
        J[:, 1, 2] = c * table.arm[:, 0] - s * table.arm[:, 1]
        J[:, 2, 3] = 1.0
        entries = np.array([0, 1, 2, self._constant + self._ranges])
        kinds, which = np.unique(~np.isnan(table.z), axis=0, return_inverse=True)
        found = list[_Rows]()
        for k, measured in enumerate(kinds):
            rows = np.flatnonzero(which.ravel() == k)
            cov = table.cov[rows][:, measured][:, :, measured]
            found.append(_Rows(table.step[rows], np.tile(entries, (len(rows), 1)), J[rows][:, measured], cov))
        return found

    @property
    def _ranges(self) -> int:
        """Number of constant errors of ranges, which the heading's follows."""
        return 2 * (len(self.ids) if self._systematic.each else 1)

    def _loops(self) -> _Rows:
        log, path = self._known.log, self._known.path
        step, to = log.loop_step, log.loop_to
        J = np.zeros((len(to), 3, 6))
        J[:, :, :3] = np.eye(3)
        J[:, :, 3:] = -_lever(path[step, :2] - path[to, :2])
        kept = np.array([self.clones[k].start for k in to.tolist()], np.int64)
        entries = np.concatenate((np.tile(np.arange(3), (len(to), 1)), kept[:, None] + np.arange(3)), axis=1)
        return _Rows(step, entries, J, _turned(log.loop_cov, path[to, 2]))


def _constants(log: Log, landmarks: int) -> Array:
    """Standard deviations of constant errors: scale and offset of ranges, of all or of each, and a heading's.

    With a gyro also that of its bias at the first turn.
    """
    sds, gyro = log.prior.systematic, log.gyro
    ranges = (sds.range_scale, sds.range_offset) * (landmarks if sds.each else 1)
    bias = () if gyro is None else (max(np.sqrt(gyro.prior.sd**2 + gyro.walk[:1].sum()), HELD),)
    return np.array((*ranges, sds.heading_offset, *bias))


def _turns(log: Log) -> dict[int, _Turned]:
    """The motions with turns by a gyro, by their step."""
    gyro = log.gyro
    if gyro is None:
        return {}
    split = conditioned(log.delta[gyro.step], log.delta_cov[gyro.step], gyro.turn, gyro.var, gyro.dt)
    walk = gyro.walk.copy()
    walk[:1] = 0.0  # is in the bias at the first turn
    columns = walk.tolist(), gyro.dt[:, None, None], split.told_var[:, None, None], split.cov, split.slope
    return {step: _Turned(*row) for step, *row in zip(gyro.step.tolist(), *columns, strict=True)}


def _update(P: Array, entries: Ints, J: Array, cov: Array) -> None:
    """Conditions the covariance P on a measurement with Jacobian J (d, j) by those entries."""
    G = P[:, entries] @ J.T
    root = np.linalg.cholesky(J @ G[entries] + cov)
    A = solve_triangular(root, G.T, lower=True, check_finite=False)
    P[...] -= A.T @ A


def _lever(moved: Array) -> Array:
    """(..., 3, 3) derivatives of a pose by one from which it is (..., 2) m away, in the world."""
    F = np.zeros((*moved.shape[:-1], 3, 3))
    F[...] = np.eye(3)
    F[..., 0, 2], F[..., 1, 2] = -moved[..., 1], moved[..., 0]
    return F


def _turned(cov: Array, heading: Array) -> Array:
    """Covariances (..., 3, 3) of motions in the world, from poses with these headings."""
    R = _to_world(heading)
    return R @ cov @ np.swapaxes(R, -1, -2)


def _to_world(heading: Array) -> Array:
    """(..., 3, 3) turns motions from poses with these headings into the world."""
    R = np.zeros((*np.shape(heading), 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = np.cos(heading)
    R[..., 1, 0] = np.sin(heading)
    R[..., 0, 1] = -R[..., 1, 0]
    R[..., 2, 2] = 1.0
    return R
