"""Gauss-Newton over a whole log in scipy's sparse matrices: the same J as the batch backend's, without GTSAM."""

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from motions import between_jacobians
from slamduel.core.factors import Log, Map
from slamduel.core.se2 import Array, Ints, act, between, wrap


class Fit(NamedTuple):
    path: Array  # (n, 3)
    ids: Ints  # (l,)
    xy: Array  # (l, 2)
    motions: Array  # (n - 1 and loop closures, 3) whitened residuals
    sightings: Array  # (s, 2) whitened residuals
    cost: float  # J
    furthest: float  # m, rad; the largest change in the last step


def points(log: Log, path: Array) -> Array:
    """(s, 2) world positions of the sightings, from `path` (n, 3)."""
    range_, bearing = log.z.T
    return act(path[log.sighting_step], np.stack((range_ * np.cos(bearing), range_ * np.sin(bearing)), axis=-1))


def fitted(log: Log, start: Array, iterations: int, landmarks: Map | None = None) -> Fit:
    """The optimum near the path `start` (n, 3), after that many steps; landmarks start at their sightings' mean.

    Or at their positions in `landmarks`. Loop closures come after the motions.
    """
    ids, which = np.unique(log.ids, return_inverse=True)
    n, m, step, path = len(log), len(ids), log.sighting_step, start.copy()
    if landmarks is None:
        counts = np.bincount(which)[:, None]
        xy = np.stack([np.bincount(which, column) for column in points(log, path).T], axis=-1) / counts
    else:
        xy = landmarks.xy[[landmarks.ids.tolist().index(i) for i in ids.tolist()]].reshape(m, 2)
    before = np.concatenate((np.arange(n - 1), log.loop_to))
    after = np.concatenate((np.arange(1, n), log.loop_step))
    deltas = np.concatenate((log.delta[1:], log.loop_delta))
    white_start, white_motion, white_z = (
        np.asarray(np.linalg.inv(np.linalg.cholesky(cov)), np.float64)
        for cov in (log.prior.cov, np.concatenate((log.delta_cov[1:], log.loop_cov)), log.z_cov)
    )

    def residuals() -> tuple[Array, Array, Array]:
        motion = between(path[before], path[after]) - deltas
        away = xy[which] - path[step, :2]
        z = np.stack((np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0]) - path[step, 2]), axis=-1) - log.z
        motion[:, 2], z[:, 1] = wrap(motion[:, 2]), wrap(z[:, 1])
        first = path[0] - log.prior.pose
        first[2] = wrap(first[2])
        return (white_start @ first, np.einsum("mij,mj->mi", white_motion, motion), np.einsum("mij,mj->mi", white_z, z))

    k, s, motions, furthest = np.arange(len(before)), np.arange(len(step)), len(before), 0.0
    for _ in range(iterations):
        by_before, by_after = between_jacobians(path[before], path[after])
        away = xy[which] - path[step, :2]
        r = np.hypot(*away.T)
        by_xy = np.stack((away / r[:, None], away[:, ::-1] * [-1, 1] / r[:, None] ** 2), axis=1)
        by_pose = np.concatenate((-by_xy, np.broadcast_to([[0.0], [-1.0]], (len(r), 2, 1))), axis=2)
        blocks = [
            _entries(white_start[None], np.zeros(1, int), np.zeros(1, int)),
            _entries(white_motion @ by_before, 3 + 3 * k, 3 * before),
            _entries(white_motion @ by_after, 3 + 3 * k, 3 * after),
            _entries(white_z @ by_pose, 3 + 3 * motions + 2 * s, 3 * step),
            _entries(white_z @ by_xy, 3 + 3 * motions + 2 * s, 3 * n + 2 * which),
        ]
        values, rows, columns = (np.concatenate(part) for part in zip(*blocks, strict=True))
        shape = (3 + 3 * motions + 2 * len(step), 3 * n + 2 * m)
        jacobian: Any = scipy.sparse.csr_matrix((values, (rows, columns)), shape=shape)
        left = np.concatenate([part.ravel() for part in residuals()])
        change: Any = scipy.sparse.linalg.spsolve((jacobian.T @ jacobian).tocsc(), -(jacobian.T @ left))
        furthest = float(np.abs(change).max())
        path, xy = path + change[: 3 * n].reshape(-1, 3), xy + change[3 * n :].reshape(-1, 2)
        path[:, 2] = wrap(path[:, 2])
    first, motion, z = residuals()
    return Fit(path, ids, xy, motion, z, float((first**2).sum() + (motion**2).sum() + (z**2).sum()), furthest)


def aligned(xy: Array, onto: Array) -> Array:
    """`xy` (n, 2) rigidly aligned to `onto` (n, 2) by least squares."""
    a, b = xy - xy.mean(axis=0), onto - onto.mean(axis=0)
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    c, s = np.cos(angle), np.sin(angle)
    return a @ np.array([[c, s], [-s, c]]) + onto.mean(axis=0)


def rmse(xy: Array, truth: Array) -> float:
    return float(np.sqrt(((xy - truth) ** 2).sum(axis=1).mean()))


def _entries(blocks: Array, row: Ints, column: Ints) -> tuple[Array, Ints, Ints]:
    """The values of `blocks` (m, a, b), each with its upper left at (row, column), and their indices."""
    rows = row[:, None, None] + np.arange(blocks.shape[1])[None, :, None]
    columns = column[:, None, None] + np.arange(blocks.shape[2])[None, None, :]
    rows, columns = np.broadcast_to(rows, blocks.shape), np.broadcast_to(columns, blocks.shape)
    return blocks.ravel(), rows.ravel(), columns.ravel()
