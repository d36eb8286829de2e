"""The least J near a path and a map, by dense Levenberg-Marquardt on whitened residuals: no normal equations.

A step that raises J is tried once more from where it led, as valleys of J are curved.
"""

import numpy as np

from dense_fit import sighted
from motions import between_jacobians
from slamduel.core.factors import Log, Map
from slamduel.core.se2 import Array, Ints, between, wrap
from slamduel.core.truth.errors import rows_of


def lowest(log: Log, path: Array, landmarks: Map, iterations: int = 60) -> float:
    """J at the end; all landmarks of the log are on the map."""
    n, damping = len(path), 1e-6
    x = np.concatenate((path.ravel(), landmarks.xy.ravel()))
    row = rows_of(landmarks.ids, log.ids)
    r, slopes = whitened(log, x, n, row)
    for _ in range(iterations):
        found = None
        while found is None and damping < 1e6:
            trial, there, slope = x, r, slopes
            for _ in range(2):
                trial = trial + step(slope, there, damping)
                there, slope = whitened(log, trial, n, row)
                if there @ there < r @ r:
                    found = trial, there, slope
                    break
            damping *= 0.1 if found else 10.0
        if found is None:
            break
        done = found[1] @ found[1] > (1 - 1e-10) * (r @ r)
        x, r, slopes = found
        damping = max(damping, 1e-12)
        if done:
            break
    return float(r @ r)


def step(A: Array, r: Array, damping: float) -> Array:
    """The step of residuals r with derivatives A, damped in proportion to their columns' lengths."""
    size = np.sqrt((A * A).sum(axis=0))
    rows = np.concatenate((A / size, np.sqrt(damping) * np.eye(len(size))))
    return np.linalg.lstsq(rows, np.concatenate((-r, np.zeros(len(size)))), rcond=None)[0] / size


def whitened(log: Log, x: Array, n: int, row: Ints) -> tuple[Array, Array]:
    """All residuals by the square roots of their information, and their derivatives; `row` has sightings' landmarks."""
    path, xy = x[: 3 * n].reshape(n, 3), x[3 * n :].reshape(-1, 2)
    r, A = list[Array](), list[Array]()

    def add(e: Array, cov: Array, blocks: list[tuple[int, Array]]) -> None:
        root = np.linalg.cholesky(np.linalg.inv(cov)).T
        rows = np.zeros((len(e), len(x)))
        for at, block in blocks:
            rows[:, at : at + block.shape[1]] += root @ block
        r.append(root @ e)
        A.append(rows)

    def add_motion(i: int, j: int, delta: Array, cov: Array) -> None:
        e = between(path[i], path[j]) - delta
        e[2] = wrap(e[2])
        by_i, by_j = between_jacobians(path[i], path[j])
        add(e, cov, [(3 * i, by_i), (3 * j, by_j)])

    first = path[0] - log.prior.pose
    first[2] = wrap(first[2])
    add(first, log.prior.cov, [(0, np.eye(3))])
    for k in range(1, n):
        add_motion(k - 1, k, log.delta[k], log.delta_cov[k])
    for k, to, delta, cov in zip(log.loop_step, log.loop_to, log.loop_delta, log.loop_cov, strict=True):
        add_motion(to, k, delta, cov)
    for k, m, z, cov in zip(log.sighting_step, row, log.z, log.z_cov, strict=True):
        e, by_pose, by_xy = sighted(path[k], xy[m], z)
        add(e, cov, [(3 * k, by_pose), (3 * n + 2 * m, by_xy)])
    return np.concatenate(r), np.concatenate(A)
