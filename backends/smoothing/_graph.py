"""The arrays of a smoother: tables that grow, two arenas for what cliques keep, and the names of all columns.

A variable is a landmark, of two scalars, or the pose of a step at which something was sighted, of three. Steps without
sightings are no variables: the motions between two poses are one factor, a link (see `_links`). A clique is a set of
variables that were eliminated together; it keeps [R d] of these, its frontals, and its update matrix, which is what is
left over for its separators and is summed into its parent. Whatever is not eliminated is the root: the last pose and
the landmarks about it.
"""

from ...frontend.compiled import compiled
from .._arrays import Arrays, Integers, IntegerTable, Numbers, Table, at


class Graph(Arrays):
    """All arrays of a smoother; in each, more rows than are in use."""

    state: Integers  # (STATE,) counts and heads of lists
    variables: IntegerTable  # (V, 9)
    values: Table  # (V, 3) linearisation points: x, y (m), heading (rad)
    sightings: IntegerTable  # (S, 2)
    seen: Table  # (S, 5) range, bearing, and the information of both: rr, rb, bb
    links: IntegerTable  # (K, 5)
    linked: Table  # (K, 18)
    steps: Table  # (T, 12) odometry (3), its covariance (6), linearisation point (3)
    at: Integers  # (T,) the variable of a step's pose, or NO_VARIABLE less the link that it is in
    cliques: IntegerTable  # (C, 12)
    ints: Integers  # arena: variables and links of cliques
    reals: Numbers  # arena: [R d] and update matrices
    free: IntegerTable  # (2, CLASSES) heads of lists of free blocks, by size
    root: Integers  # landmarks in the root
    todo: Integers  # (C,) cliques to eliminate, children before parents
    rest: Numbers  # what the root has from cliques that do not know its pose
    work: Numbers  # one front; between calls, the root's [R d]
    spots: Integers  # where a clique's separators stand in its parent's front: see `_front.places`
    settings: Numbers  # (8,) robust loss and its scale; range of the furthest sighting; see below for the rest


graph = at(Graph)
"""The graph at an address."""

# state
VARIABLES, SIGHTINGS, LINKS, STEPS, CLIQUES, SPARE, INTS, REALS, STAMP, ROOT, NEAR, FAR, LAST = range(13)
TODO, RESUM, FAILED, WORK, FULL, WIDEST, GIVEN, GIVEN_INTS, GIVEN_REALS, DSYRK, STATE = range(13, 24)
# variables; CLIQUE is 0 in the root, SLOT -1 outside it
WIDTH, CLIQUE, SLOT, MARK, PLACE, FIRST, END, LINK, STEP = range(9)
# sightings; no landmark: it is held back
LANDMARK, POSE = range(2)
# links: from A to B; of a loop closure LOOP is 1
A, B, NEXT_A, NEXT_B, LOOP = range(5)
# linked: what the link says of B's offset, its information, and a loop closure's motion and covariance
OFFSET, INFORMATION, MOTION, COVARIANCE = 0, 3, 9, 12
# settings; LATEST is the estimate of the last pose, and it is linearised there if it is off by more than ENOUGH
LOSS, SCALE, FURTHEST, DAMPING, LATEST, ENOUGH = 0, 1, 2, 3, 4, 7
# steps
DELTA, NOISE, POINT = 0, 3, 9
# cliques: of variables MEMBERS, the first of them FRONTALS; of scalars SIZE, the first of them FRONT
PARENT, FRONTALS, MEMBERS, FRONT, SIZE, BOUND, LISTED, FACTOR, UPDATE, CHILD, NEXT, FLAG = range(12)

NO_VARIABLE = -1
PENDING = -(2**62)
"""In `at`: the step's link is not made yet."""

CLASSES = 250
"""Sizes of blocks in an arena, four from each power of two to the next."""


@compiled
def rounded(n: int) -> tuple[int, int]:
    """The class of a block of `n` entries, and its size."""
    n = max(n, 8)
    k = 3
    while (1 << (k + 1)) <= n:
        k += 1
    quarter = 1 << (k - 2)
    more = (n - (1 << k) + quarter - 1) // quarter
    return 4 * k + more, (1 << k) + more * quarter


@compiled
def reserve_ints(g: Graph, n: int) -> int:
    """Where a block of `n` integers begins; there has to be room."""
    kind, size = rounded(n)
    at = g.free[0, kind]
    if at >= 0:
        g.free[0, kind] = g.ints[at]
        return at
    at = g.state[INTS]
    g.state[INTS] += size
    return at


@compiled
def reserve_reals(g: Graph, n: int) -> int:
    """Where a block of `n` numbers begins; there has to be room."""
    kind, size = rounded(n)
    at = g.free[1, kind]
    if at >= 0:
        g.free[1, kind] = int(g.reals[at])
        return at
    at = g.state[REALS]
    g.state[REALS] += size
    return at


@compiled
def release_ints(g: Graph, at: int, n: int) -> None:
    """The block of `n` integers at `at` is free."""
    kind, _ = rounded(n)
    g.ints[at] = g.free[0, kind]
    g.free[0, kind] = at


@compiled
def release_reals(g: Graph, at: int, n: int) -> None:
    """The block of `n` numbers at `at` is free."""
    kind, _ = rounded(n)
    g.reals[at] = g.free[1, kind]
    g.free[1, kind] = at


@compiled
def triangle(n: int) -> int:
    """Numbers of an update matrix over `n` scalars, its right-hand side included."""
    return n * (n + 3) // 2
