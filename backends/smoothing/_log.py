"""Adds a step's data: its motion, pose, sightings and links."""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import add_turned, levered, moved
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._graph import (
    BIAS,
    CLIQUE,
    CLOSEST,
    COVARIANCE,
    DELTA,
    END,
    FIRST,
    FURTHEST,
    LANDMARK,
    LINK,
    LINKS,
    LOOP,
    MARK,
    MOTION,
    NEAR_SDS,
    NEXT_A,
    NEXT_B,
    NO_VARIABLE,
    NOISE,
    PART,
    PENDING,
    POINT,
    POSE,
    PRIOR,
    SIGHTINGS,
    SLOT,
    STEP,
    STEPS,
    SUBMAP,
    TURN,
    VARIABLES,
    WEIGHT,
    WHOLE,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import relink


@compiled
def covariance_of(S: Array, k: int, C: Array) -> None:
    """Expands six numbers S[k : k + 6] to C (3, 3)."""
    C[0, 0], C[0, 1], C[0, 2] = S[k], S[k + 1], S[k + 2]
    C[1, 0], C[1, 1], C[1, 2] = S[k + 1], S[k + 3], S[k + 4]
    C[2, 0], C[2, 1], C[2, 2] = S[k + 2], S[k + 4], S[k + 5]


@compiled
def six(C: Array, row: int, S: Array, k: int) -> None:
    """Stores C[row : row + 3] (3, 3) as six numbers S[k : k + 6]."""
    a, b, c = C[row], C[row + 1], C[row + 2]
    S[k], S[k + 1], S[k + 2] = a[0], (a[1] + b[0]) / 2, (a[2] + c[0]) / 2
    S[k + 3], S[k + 4], S[k + 5] = b[1], (b[2] + c[1]) / 2, c[2]


@compiled
def move(g: Graph, motion: Array, pose: Array, cov: Array) -> None:
    """Stores the next step, and propagates the last pose (3,) and its covariance (3, 3) by its motion.

    `motion` (4, 3) is the motion and its covariance. At step 0 it is the prior, and `pose` and `cov` are the same.
    """
    k = g.state[STEPS]
    g.state[STEPS] = k + 1
    q = g.steps[k]
    for i in range(3):
        q[DELTA + i] = motion[0, i]
    six(motion, 1, q, NOISE)
    g.at[k] = PENDING
    if k > 0:
        x, y, c, s = pose[0], pose[1], cos(pose[2]), sin(pose[2])
        pose[0], pose[1], pose[2] = moved(x, y, pose[2], motion[0, 0], motion[0, 1], motion[0, 2])
        S = np.empty(6)
        six(cov, 0, S, 0)
        levered(S, y - pose[1], pose[0] - x)
        add_turned(S, c, s, q, NOISE)
        covariance_of(S, 0, cov)
    for i in range(3):
        q[POINT + i] = pose[i]


@compiled
def add_variable(g: Graph, width: int, x: float, y: float, heading: float) -> int:
    """Adds a variable of `width` scalars, 0 if it is held fixed."""
    v = g.state[VARIABLES]
    g.state[VARIABLES] = v + 1
    row = g.variables[v]
    row[WIDTH], row[CLIQUE], row[SLOT], row[MARK] = width, 0, -1, 0
    row[FIRST], row[END], row[LINK], row[STEP], row[SUBMAP] = 0, 0, -1, -1, 0
    g.values[v, 0], g.values[v, 1], g.values[v, 2] = x, y, heading
    return v


@compiled
def add_pose_at(g: Graph, k: int) -> int:
    """Makes the pose of step `k` a variable."""
    q = g.steps[k]
    v = add_variable(g, 3, q[POINT], q[POINT + 1], q[POINT + 2])
    g.variables[v, STEP] = k
    g.variables[v, FIRST] = g.variables[v, END] = g.state[SIGHTINGS]
    g.at[k] = v
    return v


@compiled
def hang(g: Graph, k: int) -> None:
    """Adds link `k` to the lists of its poses."""
    a, b = g.links[k, A], g.links[k, B]
    g.links[k, NEXT_A], g.variables[a, LINK] = g.variables[a, LINK], k
    g.links[k, NEXT_B], g.variables[b, LINK] = g.variables[b, LINK], k


@compiled
def unhang(g: Graph, k: int, v: int) -> None:
    """Removes link `k` from variable `v`'s list."""
    last, one = -1, g.variables[v, LINK]
    while one >= 0:
        after = g.links[one, NEXT_A if g.links[one, A] == v else NEXT_B]
        if one == k:
            if last < 0:
                g.variables[v, LINK] = after
            else:
                g.links[last, NEXT_A if g.links[last, A] == v else NEXT_B] = after
            return
        last, one = one, after


@compiled
def add_link_between(g: Graph, a: int, b: int) -> bool:
    """Adds the motions from pose `a` to a later pose `b` as a link; False where their covariance is indefinite."""
    k = g.state[LINKS]
    g.state[LINKS] = k + 1
    g.links[k, A], g.links[k, B], g.links[k, LOOP] = a, b, 0
    hang(g, k)
    for j in range(g.variables[a, STEP] + 1, g.variables[b, STEP]):
        g.at[j] = NO_VARIABLE - 1 - k
    return relink(g, k)


@compiled
def add_pose_after(g: Graph, before: int, k: int) -> int:
    """Adds the pose of step `k` as a variable, linked to the one before it unless that is NO_VARIABLE.

    Returns NO_VARIABLE where the motions between the two have no covariance.
    """
    v = add_pose_at(g, k)
    if before >= 0 and not add_link_between(g, before, v):
        return NO_VARIABLE
    return v


@compiled
def add_sightings_of(g: Graph, pose: int, landmarks: Ints, seen: Array) -> tuple[int, int]:
    """Adds sightings from the newest pose; returns how many are of eliminated landmarks, and of new ones.

    `landmarks` (k,) are variables, or NO_VARIABLE if held back; `seen` has range, bearing and their covariance in its
    first k rows.
    """
    s = g.state[SIGHTINGS]
    outside = fresh = 0
    for i in range(len(landmarks)):
        v = landmarks[i]
        g.sightings[s, LANDMARK], g.sightings[s, POSE], g.sightings[s, PART] = v, pose, WHOLE
        rr, rb, bb = seen[i, 2], (seen[i, 3] + seen[i, 4]) / 2, seen[i, 5]
        d = 1.0 / (rr * bb - rb * rb)
        g.seen[s, 0], g.seen[s, 1] = seen[i, 0], seen[i, 1]
        g.seen[s, 2], g.seen[s, 3], g.seen[s, 4] = bb * d, -rb * d, rr * d
        g.settings[FURTHEST] = max(g.settings[FURTHEST], seen[i, 0])
        g.settings[CLOSEST] = min(g.settings[CLOSEST], max(seen[i, 0], NEAR_SDS * sqrt(rr)))
        if v >= 0 and g.variables[v, WIDTH] and g.variables[v, SLOT] < 0:
            if g.variables[v, CLIQUE] > 0:
                outside += 1
            else:
                fresh += 1
        s += 1
    g.state[SIGHTINGS] = s
    g.variables[pose, END] = s
    return outside, fresh


@compiled
def add_parts_of(g: Graph, pose: int, landmarks: Ints, parts: Ints, seen: Array) -> tuple[int, int]:
    """Adds partial sightings and fixes of the newest pose, after its whole ones; there must be room.

    `landmarks` (k,), `parts` (k,) and `seen` (k, 5) are columns of the graph's tables of sightings. Returns how many
    variables in them are eliminated, and how many are new, some counted twice.
    """
    s = g.state[SIGHTINGS]
    outside = fresh = 0
    for i in range(len(landmarks)):
        g.sightings[s, LANDMARK], g.sightings[s, POSE], g.sightings[s, PART] = landmarks[i], pose, parts[i]
        for j in range(5):
            g.seen[s, j] = seen[i, j]
        if seen[i, 2] > 0.0 and parts[i] != PRIOR:
            g.settings[FURTHEST] = max(g.settings[FURTHEST], seen[i, 0])
            g.settings[CLOSEST] = min(g.settings[CLOSEST], max(seen[i, 0], NEAR_SDS / sqrt(seen[i, 2])))
        for v in (landmarks[i], parts[i]):
            if landmarks[i] >= 0 and v >= 0 and g.variables[v, WIDTH] and g.variables[v, SLOT] < 0:
                if g.variables[v, CLIQUE] > 0:
                    outside += 1
                else:
                    fresh += 1
        s += 1
    g.state[SIGHTINGS] = s
    g.variables[pose, END] = s
    return outside, fresh


@compiled
def split(g: Graph, step: int) -> int:
    """Makes the pose of a step inside a link a variable, and splits the link."""
    k = NO_VARIABLE - 1 - g.at[step]
    b = g.links[k, B]
    v = add_pose_at(g, step)
    unhang(g, k, b)
    g.links[k, B] = v
    g.links[k, NEXT_B], g.variables[v, LINK] = g.variables[v, LINK], k
    if not relink(g, k) or not add_link_between(g, v, b):
        return NO_VARIABLE
    return v


@compiled
def add_loop(g: Graph, a: int, b: int, delta: Array, cov: Array) -> bool:
    """Adds a loop closure, pose `b` relative to pose `a`; False where its covariance is indefinite."""
    k = g.state[LINKS]
    g.state[LINKS] = k + 1
    g.links[k, A], g.links[k, B], g.links[k, LOOP] = a, b, 1
    for i in range(3):
        g.linked[k, MOTION + i] = delta[i]
    six(cov, 0, g.linked[k], COVARIANCE)
    g.linked[k, WEIGHT] = 1.0
    hang(g, k)
    return relink(g, k)


@compiled
def add_turn(g: Graph, a: int, b: int, bias: int, turn: float, dt: float, information: float) -> None:
    """Adds a gyro's turn from pose `a` to pose `b`, whose parts name the variable of the `bias`; there must be room."""
    k = g.state[LINKS]
    g.state[LINKS] = k + 1
    g.links[k, A], g.links[k, B], g.links[k, LOOP], g.links[k, BIAS] = a, b, TURN, bias
    L = g.linked[k]
    L[MOTION], L[MOTION + 1], L[MOTION + 2] = turn, dt, information
    hang(g, k)
