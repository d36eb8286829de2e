"""An EKF with a gyro's bias in its state, dense and written out, and least squares with all turns as rows."""

import numpy as np

from slamduel.core.factors import Log
from slamduel.core.se2 import Array, between, compose, wrap


def filtered(log: Log) -> tuple[Array, Array, Array, Array]:
    """Poses (n, 3), covariances (n, 3, 3), biases (n,) and their variances (n,) of an EKF on x, y, heading, bias, map.

    A step conditions the joint of state and motion on the turn, as it stands, and then moves.
    """
    assert log.prior.gyro is not None
    x = np.concatenate((log.prior.pose, [log.prior.gyro.mean]))
    spread = np.zeros((4, 4))
    spread[:3, :3], spread[3, 3] = log.prior.cov, log.prior.gyro.sd**2
    at: dict[int, int] = {}
    poses, covs, biases, variances = [], [], [], []
    for step in log:
        n = len(x)
        if step.odometry is not None:
            joint, cov = np.concatenate((x, step.odometry.delta)), np.zeros((n + 3, n + 3))
            cov[:n, :n], cov[n:, n:] = spread, step.odometry.cov
            if step.gyro is not None:
                cov[3, 3] += step.gyro.walk
                by = np.zeros(n + 3)
                by[3], by[n + 2] = step.gyro.dt, 1.0
                gain = cov @ by / (by @ cov @ by + step.gyro.var)
                joint = joint + gain * float(wrap(np.array(step.gyro.turn - by @ joint)))
                cov = cov - np.outer(gain, by @ cov)
            before, motion = joint[:3], joint[n:]
            after = compose(before, motion)
            F = np.zeros((n, n + 3))
            F[:, :n] = np.eye(n)
            F[0, 2], F[1, 2] = before[1] - after[1], after[0] - before[0]
            c, s = np.cos(before[2]), np.sin(before[2])
            F[:3, n:] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
            x, spread = joint[:n].copy(), F @ cov @ F.T
            x[:3] = after
        for landmark, z, R in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark not in at:
                x, spread = _started(x, spread, z, R)
                at[landmark] = len(x) - 2
                continue
            i = at[landmark]
            d = x[i : i + 2] - x[:2]
            q = d @ d
            r = np.sqrt(q)
            H = np.zeros((2, len(x)))
            H[:, i : i + 2] = [[d[0] / r, d[1] / r], [-d[1] / q, d[0] / q]]
            H[:, :2], H[1, 2] = -H[:, i : i + 2], -1.0
            off = z - (r, np.arctan2(d[1], d[0]) - x[2])
            off[1] = wrap(off[1])
            K = spread @ H.T @ np.linalg.inv(H @ spread @ H.T + R)
            x, spread = x + K @ off, spread - K @ H @ spread
            x[2] = wrap(x[2])
        poses.append(x[:3].copy())
        covs.append(spread[:3, :3].copy())
        biases.append(x[3])
        variances.append(spread[3, 3])
    return np.array(poses), np.array(covs), np.array(biases), np.array(variances)


def _started(x: Array, P: Array, z: Array, R: Array) -> tuple[Array, Array]:
    """With a landmark from its first sighting."""
    n, angle = len(x), x[2] + z[1]
    c, s = np.cos(angle), np.sin(angle)
    G = np.zeros((n + 2, n))
    G[:n] = np.eye(n)
    G[n:, :3] = [[1, 0, -z[0] * s], [0, 1, z[0] * c]]
    by_z = np.zeros((n + 2, 2))
    by_z[n:] = [[c, -z[0] * s], [s, z[0] * c]]
    return np.concatenate((x, x[:2] + z[0] * np.array((c, s)))), G @ P @ G.T + by_z @ R @ by_z.T


def least_squares(log: Log) -> tuple[Array, Array, Array, float]:
    """Path (n, 3), landmarks (m, 2) by ascending id, biases (b,) and J at the minimum, by Gauss-Newton on all rows.

    Jacobians are numerical.
    """
    from scipy.optimize import least_squares as minimised

    assert log.gyro is not None
    ids, row = np.unique(log.ids, return_inverse=True)
    n, m, gyro = len(log), len(ids), log.gyro
    path = log.dead_reckoned()
    first = np.array([np.flatnonzero(row == k)[0] for k in range(m)])
    z, step = log.z[first], log.sighting_step[first]
    angle = path[step, 2] + z[:, 1]
    xy = path[step, :2] + z[:, :1] * np.column_stack((np.cos(angle), np.sin(angle)))
    start = np.concatenate((path.ravel(), xy.ravel(), np.full(gyro.knot[-1] + 1, gyro.prior.mean)))
    halves = [np.linalg.inv(np.linalg.cholesky(cov)) for cov in (log.prior.cov[None], log.delta_cov[1:], log.z_cov)]
    moved = np.flatnonzero(np.diff(gyro.knot)) + 1

    def rows(v: Array) -> Array:
        poses, marks, bias = v[: 3 * n].reshape(n, 3), v[3 * n : 3 * n + 2 * m].reshape(m, 2), v[3 * n + 2 * m :]
        prior = poses[:1] - log.prior.pose
        motion = between(poses[:-1], poses[1:]) - log.delta[1:]
        seen_from = poses[log.sighting_step]
        d = marks[row] - seen_from[:, :2]
        seen = np.column_stack((np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - seen_from[:, 2])) - log.z
        for off in (prior, motion, seen):
            off[:, -1] = wrap(off[:, -1])
        white = [
            np.einsum("nij,nj->ni", half, off).ravel() for half, off in zip(halves, (prior, motion, seen), strict=True)
        ]
        turned = poses[gyro.step, 2] - poses[gyro.step - 1, 2] + bias[gyro.knot] * gyro.dt - gyro.turn
        white += [wrap(turned) / np.sqrt(gyro.var), np.diff(bias) / np.sqrt(gyro.walk[moved])]
        return np.concatenate([*white, [(bias[0] - gyro.prior.mean) / np.hypot(gyro.prior.sd, np.sqrt(gyro.walk[0]))]])

    found = minimised(rows, start, x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15)
    v = found.x
    return v[: 3 * n].reshape(n, 3), v[3 * n : 3 * n + 2 * m].reshape(m, 2), v[3 * n + 2 * m :], 2 * found.cost
