"""The optimum of J by dense Gauss-Newton, with losses, loops and given maps, and all covariances."""

from typing import NamedTuple

import numpy as np

from motions import between_jacobians
from slamduel.core.factors import Log
from slamduel.core.se2 import Array, between, wrap


class Dense(NamedTuple):
    path: Array  # (n, 3)
    xy: dict[int, Array]  # (2,) by id
    cost: float  # J
    cov: Array  # of all poses, then the landmarks in the order of `xy`


def weight(loss: str, scale: float, q: float) -> tuple[float, float]:
    """The weight of a factor whose squared Mahalanobis distance is q, and twice its loss."""
    c2 = scale**2
    if loss == "huber":
        return (1.0, q) if q <= c2 else (scale / q**0.5, 2 * scale * q**0.5 - c2)
    if loss == "cauchy":
        return 1 / (1 + q / c2), c2 * np.log1p(q / c2)
    if loss == "geman-mcclure":
        return 1 / (1 + q / c2) ** 2, q / (1 + q / c2)
    return 1.0, q


class Normal:
    """The normal equations of `size` unknowns, and J."""

    def __init__(self, size: int, loss: str = "none", scale: float = 1.0) -> None:
        self.matrix, self.right, self.cost = np.zeros((size, size)), np.zeros(size), 0.0
        self._loss, self._scale = loss, scale

    def add(self, blocks: list[tuple[int, Array]], e: Array, cov: Array, robust: bool = False) -> None:
        """Adds a residual with its derivatives, each at its first column, and its covariance."""
        W = np.linalg.inv(cov)
        q = float(e @ W @ e)
        w, value = weight(self._loss, self._scale, q) if robust else (1.0, q)
        self.cost += value
        for i, A in blocks:
            self.right[i : i + A.shape[1]] -= w * A.T @ W @ e
            for j, B in blocks:
                self.matrix[i : i + A.shape[1], j : j + B.shape[1]] += w * A.T @ W @ B

    def add_motion(self, path: Array, i: int, j: int, delta: Array, cov: Array, robust: bool = False) -> None:
        """Adds a motion between two poses, a loop closure with the loss."""
        e = between(path[i], path[j]) - delta
        e[2] = wrap(e[2])
        by_i, by_j = between_jacobians(path[i], path[j])
        self.add([(3 * i, by_i), (3 * j, by_j)], e, cov, robust)


def sighted(pose: Array, xy: Array, z: Array) -> tuple[Array, Array, Array]:
    """The residual of a sighting, and its derivatives by the pose (2, 3) and by the landmark (2, 2)."""
    dx, dy = xy - pose[:2]
    r = np.hypot(dx, dy)
    by_xy = np.array([[dx, dy], [-dy / r, dx / r]]) / r
    e = np.array([r, np.arctan2(dy, dx) - pose[2]]) - z
    e[1] = wrap(e[1])
    return e, np.column_stack((-by_xy, [0.0, -1.0])), by_xy


def dense_fit(
    log: Log, path: Array, xy: dict[int, Array], iterations: int, loss: str = "none", scale: float = 1.0
) -> Dense:
    """Starts from `path` (n, 3) and landmarks `xy`; those of a fixed map are not variables."""
    known = log.prior.map
    fixed = {} if known is None or known.cov is not None else dict(zip(known.ids.tolist(), known.xy, strict=True))
    path, xy, n = path.copy(), {i: np.array(at) for i, at in xy.items() if i not in fixed}, len(path)
    column = {landmark: 3 * n + 2 * k for k, landmark in enumerate(xy)}
    normal = Normal(0)
    for iteration in range(iterations + 1):
        normal = Normal(3 * n + 2 * len(xy), loss, scale)
        first = path[0] - log.prior.pose
        first[2] = wrap(first[2])
        normal.add([(0, np.eye(3))], first, log.prior.cov)
        if known is not None and known.cov is not None:
            ids = known.ids.tolist()
            off = np.concatenate([xy[i] for i in ids]) - known.xy.ravel()
            blocks = [(column[i], np.eye(2 * len(ids))[:, 2 * k : 2 * k + 2]) for k, i in enumerate(ids)]
            normal.add(blocks, off, known.cov)
        for k, step in enumerate(log):
            if step.odometry is not None:
                normal.add_motion(path, k - 1, k, *step.odometry)
            for to, delta, cov in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
                normal.add_motion(path, to, k, delta, cov, robust=True)
            for landmark, z, cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
                at = fixed[landmark] if landmark in fixed else xy[landmark]
                e, by_pose, by_xy = sighted(path[k], at, z)
                blocks = [(3 * k, by_pose)] + ([] if landmark in fixed else [(column[landmark], by_xy)])
                normal.add(blocks, e, cov, robust=True)
        if iteration < iterations:
            change = np.linalg.solve(normal.matrix, normal.right)
            path += change[: 3 * n].reshape(-1, 3)
            path[:, 2] = wrap(path[:, 2])
            xy = {landmark: at + change[column[landmark] : column[landmark] + 2] for landmark, at in xy.items()}
    return Dense(path, xy, normal.cost, np.asarray(np.linalg.inv(normal.matrix), np.float64))
