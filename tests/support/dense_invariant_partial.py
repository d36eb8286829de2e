"""The invariant EKF with partial sightings, fixes and late starts: whole matrices, and derivatives of what is seen."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

from dense_delayed import DelayedInvariantEkf
from dense_invariant import DenseInvariantEkf, derivative, hat
from dense_partial import Waiting
from slamduel.core.factors import Log, Step
from slamduel.core.partial import RANGE
from slamduel.core.se2 import Array, wrap


def angle_near(y: Any, x: Any, near: float) -> Any:
    """atan2(y, x) of complex numbers, by the angle from a direction that is near."""
    c, s = np.cos(near), np.sin(near)
    return near + np.arctan((c * y - s * x) / (c * x + s * y))


class DenseInvariantPartial(DelayedInvariantEkf):
    """Beside the group: the scale of ranges, then the poses that something waits for, kept for good."""

    def __init__(self, log: Log) -> None:
        super().__init__(log.prior)
        self.scale = 0.0
        self.poses_cov = np.array([[log.prior.systematic.range_scale**2]])
        self.cross = np.zeros((1, len(self.cov)))
        self.wait = Waiting()

    def step(self, step: Step) -> Array:
        DenseInvariantEkf.step(self, step)
        if step.odometry is not None:
            self.wait.way += float(np.hypot(*step.odometry.delta[:2]))
        for z, cov, arm in zip(*step.fixes, strict=True):
            self._fix(z, cov, arm)
        held = []
        for landmark, kind, z, var in zip(*(column.tolist() for column in step.partial), strict=True):
            if landmark in self.ids:
                self._see([(-1, kind, z, var)], landmark)
            else:
                held.append((landmark, kind, z, var))
        if held:
            across = self.cross[:, :3]
            self.poses_cov = np.block([[self.poses_cov, across], [across.T, self.cov[:3, :3]]])
            self.cross = np.concatenate((self.cross, self.cov[:3]))
            self.kept.append(self.state[:3, :3].copy())
        for landmark, kind, z, var in held:
            self.wait.add(landmark, len(self.kept) - 1, kind, z, var)
            self._try(landmark)
        return np.array([*self.state[:2, 2], np.arctan2(self.state[1, 0], self.state[0, 0])])

    def joint_update(self, H: Array, Hk: Array, nu: Array, R: Array) -> float:
        """H of pose and landmarks, Hk of the scale and the kept poses."""
        n = len(self.cov)
        P = np.block([[self.cov, self.cross.T], [self.cross, self.poses_cov]])
        both = np.concatenate((H, Hk), axis=1)
        L = np.linalg.cholesky(both @ P @ both.T + R)
        W, whitened = np.linalg.solve(L, both @ P), np.linalg.solve(L, nu)
        xi = W.T @ whitened
        self.state = expm(hat(xi[:n])) @ self.state
        self.scale += xi[n]
        self.kept = [expm(hat(xi[n + 1 + 3 * k : n + 4 + 3 * k])) @ X for k, X in enumerate(self.kept)]
        after = P - W.T @ W
        self.cov, self.cross, self.poses_cov = after[:n, :n], after[n:, :n], after[n:, n:]
        return float(whitened @ whitened)

    def _use(self, seen: Callable[[Any, dict[int, Any], Any], Any], poses: list[int], nu: Array, R: Array) -> None:
        """Corrects by what depends on the state's matrix, on those of some kept poses, and on the scale."""
        n = len(self.cov)

        def moved(error: Any) -> Any:
            kept = {
                k: self.kept[k] + hat(error[n + 1 + 3 * i : n + 4 + 3 * i]) @ self.kept[k] for i, k in enumerate(poses)
            }
            return seen(self.state + hat(error[:n]) @ self.state, kept, self.scale + error[n])

        D = derivative(moved, n + 1 + 3 * len(poses))
        H = np.zeros((len(nu), n + len(self.poses_cov)))
        H[:, : n + 1] = D[:, : n + 1]
        for i, k in enumerate(poses):
            H[:, n + 1 + 3 * k : n + 4 + 3 * k] = D[:, n + 1 + 3 * i : n + 4 + 3 * i]
        self.joint_update(H[:, :n], H[:, n:], nu, R)

    def _see(self, held: list[tuple[int, int, float, float]], landmark: int) -> None:
        """Partial sightings from kept poses, -1 for the present one."""
        column = 3 + self.ids.index(landmark)

        def one(X: Any, kept: Any, scale: Any, pose: int, kind: int, z: float) -> Any:
            own = X if pose < 0 else kept[pose]
            x, y = own[:2, :2].T @ (X[:2, column] - own[:2, 2])
            return (1 + scale) * np.sqrt(x * x + y * y) if kind == RANGE else angle_near(y, x, z)

        def seen(X: Any, kept: Any, scale: Any) -> Any:
            return np.array([one(X, kept, scale, pose, kind, z) for pose, kind, z, _ in held])

        kinds, z = np.array([kind for _, kind, _, _ in held]), np.array([z for _, _, z, _ in held])
        off = z - np.real(seen(self.state, dict(enumerate(self.kept)), self.scale))
        poses = sorted({pose for pose, *_ in held} - {-1})
        self._use(seen, poses, np.where(kinds == RANGE, off, wrap(off)), np.diag([var for *_, var in held]))

    def _fix(self, z: Array, cov: Array, arm: Array) -> None:
        has = ~np.isnan(z)
        heading = np.arctan2(self.state[1, 0], self.state[0, 0])

        def seen(X: Any, kept: Any, scale: Any) -> Any:
            del kept, scale
            return np.array([*(X[:2, 2] + X[:2, :2] @ arm), angle_near(X[1, 0], X[0, 0], heading)])[has]

        off = np.zeros(3)
        off[has] = z[has] - np.real(seen(self.state, {}, 0.0))
        off[2] = wrap(off[2])
        self._use(seen, [], off[has], cov[np.ix_(has, has)])

    def _try(self, landmark: int) -> None:
        def poses(kept: list[int]) -> tuple[Array, Array]:
            plain = [np.array([[-X[1, 2], 1, 0], [X[0, 2], 0, 1], [1, 0, 0]]) for X in (self.kept[k] for k in kept)]
            entries = np.concatenate([np.arange(1 + 3 * k, 4 + 3 * k) for k in kept])
            J = np.zeros((3 * len(kept), 3 * len(kept)))
            for i, block in enumerate(plain):
                J[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
            at = [[*X[:2, 2], np.arctan2(X[1, 0], X[0, 0])] for X in (self.kept[k] for k in kept)]
            return np.array(at), J @ self.poses_cov[np.ix_(entries, entries)] @ J.T

        found = self.wait.placed(landmark, self.scale, poses)
        if found is None:
            return
        held, place = found
        n, m = len(self.cov), len(self.state)
        state, cov = np.eye(m + 1), np.zeros((n + 2, n + 2))
        state[:m, :m], state[:2, m] = self.state, place.xy
        cov[:n, :n], cov[n:, n:] = self.cov, 1e8 * np.trace(place.cov) * np.eye(2)
        self.state, self.cov = state, cov
        self.cross = np.pad(self.cross, ((0, 0), (0, 2)))
        self.ids.append(landmark)
        self._see([(one.pose, one.kind, one.z, one.var) for one in held], landmark)
