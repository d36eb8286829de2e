"""A step with a gyro's turn in one call; its bias as a variable, and as the root has it."""

import numpy as np

from ...core.kernels._cholesky import row_of
from ...core.kernels._planar import moved
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._covariances import product, substitute_two
from ..smoothing._graph import (
    END,
    LANDMARK,
    LINKS,
    NO_VARIABLE,
    PART,
    POINT,
    POSE,
    PRIOR,
    ROOT,
    SIGHTINGS,
    SLOT,
    STEPS,
    Graph,
    graph,
)  # fmt: skip
from ..smoothing._log import add_parts_of, add_pose_after, add_sightings_of, add_turn, add_variable
from ..smoothing._log import move as move_by_odometry
from ..smoothing._step import FULL_ARRAYS, INDEFINITE, has_room, solved

AWAY = 1e9
"""The second number of a bias, held there: as a place, it is near no robot, so that no root is made of old biases."""


@compiled
def add_bias(g: Graph, pose: int, since: int, at: float, information: float) -> int:
    """Adds a bias at `at` (rad/s), and its factor as one more row of the newest `pose`; there must be room.

    The factor is a walk since another bias, or, with NO_VARIABLE, a prior around `at`. Returns the variable.
    """
    v, s = add_variable(g, 2, at, AWAY, 0.0), g.state[SIGHTINGS]
    g.sightings[s, LANDMARK], g.sightings[s, POSE] = v, pose
    g.seen[s, 3] = 0.0
    if since == NO_VARIABLE:
        g.sightings[s, PART] = PRIOR
        g.seen[s, 0], g.seen[s, 1], g.seen[s, 2], g.seen[s, 4] = at, AWAY, information, 1.0
    else:
        g.sightings[s, PART] = since
        g.seen[s, 0] = g.seen[s, 1] = g.seen[s, 2] = 0.0
        g.seen[s, 4] = information
    g.state[SIGHTINGS] = g.variables[pose, END] = s + 1
    return v


@compiled
def bias_of(address: int, v: int) -> tuple[float, float]:
    """The estimate of a bias (rad/s) in the root, and its variance; `address` is that of the graph."""
    g = graph(address)
    m, first = 2 * g.state[ROOT] + 3, 2 * g.variables[v, SLOT]
    y, z, off, w = np.zeros(m), np.zeros(m), 0.0, row_of(m)
    y[first] = z[first + 1] = 1.0
    substitute_two(g.work, m, y, z, first)
    for i in range(first, m):
        off += y[i] * g.work[i * w + w - 1]
    return g.values[v, 0] + off, product(y, y, first)


@compiled
def move(g: Graph, motion: Array, start: Array, pose: Array, cov: Array) -> None:
    """As `_log.move`, but the pose begins where `start` (3,), the motion by wheels and gyro together, puts it."""
    x, y, heading = pose[0], pose[1], pose[2]
    move_by_odometry(g, motion, pose, cov)
    pose[0], pose[1], pose[2] = moved(x, y, heading, start[0], start[1], start[2])
    for i in range(3):
        g.steps[g.state[STEPS] - 1, POINT + i] = pose[i]


# One by one, as they come from Python objects at every step.
@compiled
def turned_step(
    address: int,
    newest: int,
    cap: int,
    motion: Array,
    start: Array,
    turn: Array,
    bias: int,
    landmarks: Ints,
    seen: Array,
    of_parts: Ints,
    parts: Ints,
    part_seen: Array,
    pose: Array,
    cov: Array,
) -> tuple[int, int]:
    """As `_step.parts_step`, with a turn since the `newest` pose, that of the step before, by a gyro with that bias.

    `start` is as in `move`; `turn` (3,) has the turn, its derivative by the bias, and its information, 0 without one.
    """
    g = graph(address)
    if not has_room(g, len(landmarks) + 2 * len(of_parts)) or g.state[LINKS] + 1 >= len(g.links):
        return FULL_ARRAYS, newest
    move(g, motion, start, pose, cov)
    x = add_pose_after(g, newest, g.state[STEPS] - 1)
    if x == NO_VARIABLE:
        return INDEFINITE, newest
    if turn[2] > 0.0:
        add_turn(g, newest, x, bias, turn[0], turn[1], turn[2])
    outside, fresh = add_sightings_of(g, x, landmarks, seen)
    more_outside, more_fresh = add_parts_of(g, x, of_parts, parts, part_seen)
    return solved(g, x, outside + more_outside, fresh + more_fresh, cap, pose, cov), x
