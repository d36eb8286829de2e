"""A plain step in one call: a motion, and sightings of landmarks that are new or in the root.

And, in another one, the question which sightings are expected at it.
"""

import numpy as np

from ...core.kernels._cholesky import row_of
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._expected_arrays import expected_at
from .._rules import conclude
from .._vicinity import choose, expect, places_at
from ._covariances import joint
from ._front import solve, solve_rows
from ._graph import (
    CLIQUES,
    INTS,
    LINKS,
    NO_VARIABLE,
    REALS,
    ROOT,
    SIGHTINGS,
    STEPS,
    VARIABLES,
    Graph,
    graph,
)
from ._log import add_parts_of, add_pose_after, add_sightings_of, move
from ._relinearise import recentre
from ._tree import advance

DONE, FULL_ARRAYS, OUTSIDE, INDEFINITE = range(4)
"""Outcome of a step: done; not begun, for lack of room; stored, but a landmark is outside the root; not solved."""

SPARE_INTS, SPARE_REALS = 64, 4096
"""Room in the arenas beyond a clique's needs: blocks are rounded up."""


@compiled
def has_room(g: Graph, sightings: int) -> bool:
    """Tells if a plain step of that many sightings fits into all arrays."""
    state = g.state
    size = 2 * (state[ROOT] + sightings) + 6
    return (
        state[STEPS] < len(g.steps)
        and state[VARIABLES] < len(g.variables)
        and state[SIGHTINGS] + sightings <= len(g.sightings)
        and state[LINKS] < len(g.links)
        and state[CLIQUES] < len(g.cliques)
        and state[ROOT] + sightings <= len(g.root)
        and 2 * size <= len(g.spots)
        and state[INTS] + 2 * size + SPARE_INTS <= len(g.ints)
        and state[REALS] + size * size + SPARE_REALS <= len(g.reals)
    )


@compiled
def plain_step(
    address: int, newest: int, cap: int, motion: Array, landmarks: Ints, seen: Array, pose: Array, cov: Array
) -> tuple[int, int]:
    """Applies `motion` (4, 3), itself and its covariance, and sightings of `landmarks` (k,), variables.

    `address` is that of the graph. New landmarks enter the root, up to `cap` there. `seen` (k, 6) has range, bearing
    and their covariance; `pose` (3,) and `cov` (3, 3) are overwritten with the newest pose and its covariance. Returns
    the outcome, and the variable of the newest pose that is one.
    """
    g = graph(address)
    if not has_room(g, len(landmarks)):
        return FULL_ARRAYS, newest
    move(g, motion, pose, cov)
    if len(landmarks) == 0:
        return DONE, newest
    x = add_pose_after(g, newest, g.state[STEPS] - 1)
    if x == NO_VARIABLE:
        return INDEFINITE, newest
    outside, fresh = add_sightings_of(g, x, landmarks, seen)
    return solved(g, x, outside, fresh, cap, pose, cov), x


# One by one, as they come from Python objects at every step.
@compiled
def parts_step(
    address: int,
    newest: int,
    cap: int,
    motion: Array,
    landmarks: Ints,
    seen: Array,
    of_parts: Ints,
    parts: Ints,
    part_seen: Array,
    pose: Array,
    cov: Array,
) -> tuple[int, int]:
    """The same with partial sightings, fixes and priors of constant errors, as `_log.add_parts_of` has them."""
    g = graph(address)
    if not has_room(g, len(landmarks) + 2 * len(of_parts)):
        return FULL_ARRAYS, newest
    move(g, motion, pose, cov)
    x = add_pose_after(g, newest, g.state[STEPS] - 1)
    if x == NO_VARIABLE:
        return INDEFINITE, newest
    outside, fresh = add_sightings_of(g, x, landmarks, seen)
    more_outside, more_fresh = add_parts_of(g, x, of_parts, parts, part_seen)
    return solved(g, x, outside + more_outside, fresh + more_fresh, cap, pose, cov), x


@compiled
def solved(g: Graph, x: int, outside: int, fresh: int, cap: int, pose: Array, cov: Array) -> int:
    """Ends a step at pose `x`, of whose landmarks so many are eliminated or new; returns the outcome."""
    if outside > 0 or (fresh > 0 and g.state[ROOT] + fresh > cap):
        return OUTSIDE
    if not recentre(g):
        return INDEFINITE
    advance(g, x)
    return DONE if solve(g, pose, cov) else INDEFINITE


@compiled
def root_offset(address: int) -> float:
    """The largest offset (m, rad) of the root's variables from their linearisation points."""
    g = graph(address)
    m = 2 * g.state[ROOT] + 3
    y, most = np.empty(m), 0.0
    solve_rows(g.work, 0, row_of(m), m, m, y)
    for i in range(m):
        most = max(most, abs(y[i]))
    return most


# One by one, as they come from Python objects at every step: a record of them would cost more than the call.
@compiled
def ask(
    address: int,
    places: int,
    landmarks: int,
    variables: Ints,
    pose: Array,
    cov: Array,
    moves: bool,
    motion: Array,
    z: Array,
    R: Array,
    gate: float,
    into: int,
) -> int:
    """Fills the `ExpectedArrays` at `into` with the landmarks within the gate after a motion, and decides.

    See `_vicinity`; `address` is that of the graph, `places` that of the `Places`, of which the first `landmarks` rows
    are those of `variables`; `pose` (3,) is the newest one and `cov` (3, 3) its covariance. Returns the number of
    landmarks whose joint covariance was computed; minus that, and nothing is filled, where there is no room for them.
    """
    n, out = choose(places, landmarks, pose, cov, True, moves, motion, z, R, gate), expected_at(into)
    if n > len(out.ids):
        return -n
    out.count[0] = 0
    if n > 0:
        at, together = np.empty((n, 2)), np.empty((2 * n + 3, 2 * n + 3))
        joint(address, variables[places_at(places).asked[:n]], pose, cov, at, together)
        expect(places, pose, at, together, moves, motion, z, R, gate, into)
    conclude(into, z, R)
    return n
