"""Adds many steps of a log in one call, and relinearises all of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._graph import LINKS, NO_VARIABLE, POINT, STEPS, VARIABLES, Graph
from ..smoothing._links import relink
from ..smoothing._log import add_loop, add_parts_of, add_pose_after, add_sightings_of, add_turn, move


class Columns(NamedTuple):
    """A log of n steps, s sightings, p parts and l loop closures as columns."""

    motions: Array  # (n, 4, 3) motion and covariance; at step 0 the prior's pose and covariance
    poses: NDArray[np.bool]  # (n,) steps whose poses are variables
    sighting_first: Ints  # (n + 1,)
    landmarks: Ints  # (s,) variable of each sighting
    seen: Array  # (s, 6) range, bearing and the covariance of both
    part_first: Ints  # (n + 1,)
    part_landmarks: Ints  # (p,) variable of each
    parts: Ints  # (p,) see `_graph`
    part_seen: Array  # (p, 5)
    loop_first: Ints  # (n + 1,)
    loop_to: Ints  # (l,) the earlier step
    loop_delta: Array  # (l, 3)
    loop_cov: Array  # (l, 3, 3)
    start: Array  # (n, 3) linearisation points of poses; empty: from the motions
    turns: Array  # (n, 3) turn by a gyro since the step before, its derivative by the bias, and its information
    biases: Ints  # (n,) variable of that bias, or NO_VARIABLE without a turn


@compiled
def write_steps(g: Graph, log: Columns, first: int, end: int, newest: int, pose: Array, cov: Array) -> int:
    """Adds steps `first` to `end`; there must be room, and pose 0 be a variable already.

    `newest` is the last pose that is a variable; `pose` (3,) and `cov` (3, 3) are propagated by the motions. Returns
    the new newest, or NO_VARIABLE where a motion or a loop has no covariance.
    """
    for k in range(first, end):
        if k > 0:
            move(g, log.motions[k], pose, cov)
        if len(log.start):
            for i in range(3):
                pose[i] = g.steps[k, POINT + i] = log.start[k, i]
        if not log.poses[k]:
            continue
        if k > 0:
            newest = add_pose_after(g, newest, k)
            if newest == NO_VARIABLE:
                return NO_VARIABLE
            if log.biases[k] >= 0:
                turn, dt, sure = log.turns[k]
                add_turn(g, int(g.at[k - 1]), newest, log.biases[k], turn, dt, sure)
        for i in range(3):
            g.values[newest, i] = pose[i]
        a, b = log.sighting_first[k], log.sighting_first[k + 1]
        add_sightings_of(g, newest, log.landmarks[a:b], log.seen[a:b])
        a, b = log.part_first[k], log.part_first[k + 1]
        if a < b:
            add_parts_of(g, newest, log.part_landmarks[a:b], log.parts[a:b], log.part_seen[a:b])
        for t in range(log.loop_first[k], log.loop_first[k + 1]):
            if not add_loop(g, int(g.at[log.loop_to[t]]), newest, log.loop_delta[t], log.loop_cov[t]):
                return NO_VARIABLE
    return newest


@compiled
def linearise_at(g: Graph, path: Array, values: Array) -> None:
    """Linearises at `path` (T, 3) and `values` (V, 3), with everything to be eliminated again.

    A link that is no longer positive definite is detected in the elimination.
    """
    for k in range(g.state[STEPS]):
        for i in range(3):
            g.steps[k, POINT + i] = path[k, i]
    for v in range(g.state[VARIABLES]):
        for i in range(3):
            g.values[v, i] = values[v, i]
    for k in range(g.state[LINKS]):
        relink(g, k)
