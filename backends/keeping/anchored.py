"""Poses of marginalised steps relative to anchors: kept poses nearby, to which loop closures are transferred."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...core.factors import RelativePoses
from ...core.se2 import Array, Ints, between, compose, compose_jacobians, rotation
from ..smoothing._graph import COVARIANCE, LINKS, LOOP, MOTION, STEP, A, B, Graph
from ..smoothing._links import relink
from ..smoothing._log import covariance_of
from ._located import own_covariances
from ._stretches import sighted_around

NOWHERE = -1
"""The anchor of a step that has none."""

SURE = 0.3
"""m, rad; largest standard deviation of an anchor given all around it: one landmark alone leaves a circle of places."""


class Anchors(NamedTuple):
    """Poses that are never marginalised."""

    steps: Ints  # (a,)
    variables: Ints  # (a,)
    poses: Array  # (a, 3)
    covs: Array  # (a, 3, 3) each given what is around it: see `_located.own_covariance`

    def nearest(self, poses: Array, reach: float) -> Ints:
        """(n,) the row of the nearest anchor to each pose (n, 3), NOWHERE if none is within `reach` (m)."""
        if len(self.steps) == 0:
            return np.full(len(poses), NOWHERE)
        away = np.hypot(*(poses[:, None, :2] - self.poses[None, :, :2]).transpose(2, 0, 1))
        best = away.argmin(axis=1)
        return np.where(away.min(axis=1) <= reach, best, NOWHERE)

    def best(self, pose: Array, reach: float) -> int:
        """The row of the anchor within `reach` (m) that is known best near a pose (3,); NOWHERE if there is none."""
        dx, dy = (pose[:2] - self.poses[:, :2]).T
        C = self.covs
        spread = C[:, 0, 0] + C[:, 1, 1] - 2 * dy * C[:, 0, 2] + 2 * dx * C[:, 1, 2] + (dx**2 + dy**2 + 1) * C[:, 2, 2]
        near = np.hypot(dx, dy) <= reach
        return int(np.where(near, spread, np.inf).argmin()) if near.any() else NOWHERE

    def some(self, which: list[bool] | None) -> "Anchors":
        """Those of `which` (a,) that is true; none without."""
        rows = np.zeros(len(self.steps), np.bool_) if which is None else np.array(which, np.bool_)
        return Anchors(self.steps[rows], self.variables[rows], self.poses[rows], self.covs[rows])


def anchors_at(g: Graph, rows: Ints, steps: Ints, poses: Array, *, loops: bool) -> Anchors:
    """Of the poses in these rows (n,), of these steps (n,), those that landmarks or, with `loops`, these locate."""
    covs, definite = np.zeros((len(rows), 3, 3)), np.zeros(len(rows), np.int64)
    variables = g.at[rows]
    own_covariances(g, variables, loops, covs, definite)
    some = (definite == 1) & (np.diagonal(covs, axis1=1, axis2=2) <= SURE**2).all(axis=1)
    return Anchors(steps[some], variables[some], poses[some], covs[some])


class Anchored:
    """The poses of marginalised steps in the frames of anchors, with covariances there."""

    def __init__(self) -> None:
        self._anchor = np.zeros(0, np.int64)  # of each step, the step of its anchor; NOWHERE: it has none
        self._delta, self._cov = np.zeros((0, 3)), np.zeros((0, 3, 3))

    def add(self, steps: Ints, anchors: Anchors, rows: Ints, poses: Array, left: Array) -> None:
        """Adds the poses (k, 3) of steps, with covariances `left` (k, 3, 3) given all around them.

        `rows` (k,) are those of their anchors. The errors of the anchors count as well: they are no part of what is
        around, so that the covariance of a pose relative to its anchor is the sum.
        """
        if len(steps) and steps[-1] >= len(self._anchor):
            more = max(1024, len(self._anchor), int(steps[-1]) + 1 - len(self._anchor))
            self._anchor = np.concatenate((self._anchor, np.full(more, NOWHERE)))
            self._delta = np.concatenate((self._delta, np.zeros((more, 3))))
            self._cov = np.concatenate((self._cov, np.zeros((more, 3, 3))))
        for step, row, pose, cov in zip(steps.tolist(), rows.tolist(), poses, left, strict=True):
            if row == NOWHERE:
                continue
            at = anchors.poses[row]
            G = np.eye(3)
            G[:2, 2] = at[1] - pose[1], pose[0] - at[0]
            T = rotation(at[2])
            self._anchor[step] = anchors.steps[row]
            self._delta[step] = between(at, pose)
            self._cov[step] = T.T @ (cov + G @ anchors.covs[row] @ G.T) @ T

    def anchor(self, step: int) -> int:
        """The step of the anchor of a step; NOWHERE if it has none."""
        return int(self._anchor[step]) if step < len(self._anchor) else NOWHERE

    def transferred(self, step: int, delta: Array, cov: Array) -> tuple[Array, Array]:
        """A pose (3,) and its covariance (3, 3) relative to a step, in the frame of the anchor of that step."""
        by_anchored, by_pose = compose_jacobians(self._delta[step], delta)
        C = by_anchored @ self._cov[step] @ by_anchored.T + by_pose @ cov @ by_pose.T
        return compose(self._delta[step], delta), (C + C.T) / 2

    def moved(self, loops: RelativePoses, marginalised: list[bool], sighted: bool) -> RelativePoses:
        """Loop closures with those to marginalised steps transferred to anchors, and left out if there is none.

        They are left out as well where the robot is located by landmarks that are `sighted`.
        """
        out = list[tuple[int, Array, Array]]()
        for to, delta, cov, gone in zip(loops.to.tolist(), loops.delta, loops.cov, marginalised, strict=True):
            if not gone:
                out.append((to, delta, cov))
            elif not sighted and self.anchor(to) != NOWHERE:
                out.append((self.anchor(to), *self.transferred(to, delta, cov)))
        to = np.array([one[0] for one in out], np.int64)
        return RelativePoses(
            to, np.array([one[1] for one in out]).reshape(-1, 3), np.array([one[2] for one in out]).reshape(-1, 3, 3)
        )

    def redirect(self, g: Graph, steps: Ints, rows: Ints, row: Callable[[int], int]) -> None:
        """Has loop closures from later steps to `steps`, in these adjacent rows, lead to their anchors.

        Those to steps without an anchor stay, and those from steps that landmarks locate; `row` has that of an
        anchor's step.
        """
        links = g.links[: g.state[LINKS]]
        to, by = g.variables[links[:, A], STEP], g.variables[links[:, B], STEP]
        for k in np.flatnonzero((links[:, LOOP] != 0) & (to >= rows[0]) & (to <= rows[-1]) & (by > rows[-1])).tolist():
            step, L, cov = int(steps[to[k] - rows[0]]), g.linked[k], np.zeros((3, 3))
            if self.anchor(step) == NOWHERE or sighted_around(g, int(by[k])):
                continue
            covariance_of(L, COVARIANCE, cov)
            L[MOTION : MOTION + 3], there = self.transferred(step, L[MOTION : MOTION + 3].copy(), cov)
            L[COVARIANCE : COVARIANCE + 6] = there[np.triu_indices(3)]
            g.links[k, A] = g.at[row(self.anchor(step))]
            relink(g, k)

    def fill(self, steps: Ints, path: Array, covs: Array) -> None:
        """Fills the rows of `steps` of a path (n, 3) and of covariances (n, 3, 3), which have those of the anchors."""
        anchor = self._anchor[steps]
        at = path[anchor]
        path[steps] = compose(at, self._delta[steps])
        G = np.tile(np.eye(3), (len(steps), 1, 1))
        G[:, 0, 2], G[:, 1, 2] = at[:, 1] - path[steps, 1], path[steps, 0] - at[:, 0]
        c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
        T = np.zeros((len(steps), 3, 3))
        T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1], T[:, 2, 2] = c, -s, s, c, 1.0
        covs[steps] = G @ covs[anchor] @ G.transpose(0, 2, 1) + T @ self._cov[steps] @ T.transpose(0, 2, 1)
