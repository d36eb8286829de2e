"""The arrays of a smoother: tables that grow, two arenas for the cliques' data, and the names of all columns.

A variable is a landmark, of two scalars, or the pose of a step with sightings, of three. Steps without sightings are
not variables: the motions between two poses are one factor, a link (see `_links`). A clique is a set of variables that
were eliminated together; it stores [R d] of these, its frontals, and its update matrix, the Schur complement on its
separators, which is summed into its parent. The variables that are not eliminated form the root: the last pose and the
landmarks around it.
"""

from ...core.kernels._arrays import Arrays, Integers, IntegerTable, Numbers, Table, at
from ...core.kernels.compiled import compiled


class Graph(Arrays):
    """All arrays of a smoother; each has spare rows."""

    state: Integers  # (STATE,) counts and heads of lists
    variables: IntegerTable  # (V, 10)
    values: Table  # (V, 3) linearisation points: x, y (m), heading (rad)
    sightings: IntegerTable  # (S, 3)
    seen: Table  # (S, 5) range, bearing, and their information: rr, rb, bb
    fixed: Table  # (F, 11) fixes: x, y, heading; their information, as of a pose; the antenna's place (2)
    submaps: Numbers  # landmarks as known in the frame of a pose: see `_factors.add_submap`; number 0 is unused
    links: IntegerTable  # (K, 6)
    linked: Table  # (K, 19)
    steps: Table  # (T, 12) odometry (3), its covariance (6), linearisation point (3)
    at: Integers  # (T,) the variable of a step's pose, or NO_VARIABLE minus the link containing it
    cliques: IntegerTable  # (C, 13)
    ints: Integers  # arena: variables and links of cliques
    reals: Numbers  # arena: [R d] and update matrices
    free: IntegerTable  # (2, CLASSES) heads of lists of free blocks, by size
    root: Integers  # landmarks in the root
    todo: Integers  # (C,) cliques to eliminate, children before parents
    rest: Numbers  # the root's part from cliques that do not contain its pose
    work: Numbers  # one front; between calls, the root's [R d]
    spots: Integers  # rows of a clique's separators in its parent's front: see `_front.places`
    settings: Numbers  # (9,) robust loss and its scale; range of the furthest sighting; see below for the rest


graph = at(Graph)
"""The graph at an address."""

# state
VARIABLES, SIGHTINGS, LINKS, STEPS, CLIQUES, SPARE, INTS, REALS, STAMP, ROOT, NEAR, FAR, LAST = range(13)
TODO, RESUM, FAILED, WORK, FULL, WIDEST, GIVEN, GIVEN_INTS, GIVEN_REALS, FIXED, STATE = range(13, 24)
# variables; CLIQUE is 0 in the root, SLOT -1 outside it; SUBMAP is 0, or where that of the pose begins in `submaps`
WIDTH, CLIQUE, SLOT, MARK, PLACE, FIRST, END, LINK, STEP, SUBMAP = range(10)
# sightings; without landmark: held back; PART says what a row is
LANDMARK, POSE, PART = range(3)
# PART: a whole sighting; a range or a bearing alone, the other's information being zero; the prior of constant errors,
# whose variable is the landmark; MEMBER: a landmark of the pose's submap; FIX - n: the fix in row n of `fixed`, whose
# landmark is the variable of a heading's constant error, or one that is held fixed; else a range alone with constant
# errors, and the variable of its scale and offset, or, with the information of a bearing, the walk of a gyro's bias,
# the landmark, since that variable
WHOLE, ALONE, PRIOR, MEMBER, FIX = -1, -2, -3, -4, -5
# links: from A to B; of a loop closure LOOP is 1, of a gyro's turn TURN, which has the variable of its BIAS
A, B, NEXT_A, NEXT_B, LOOP, BIAS = range(6)
TURN = 2
# linked: the measured offset of B, its information; a loop closure's motion, covariance and weight, 0 if left out; of
# a turn that, its derivative by the bias and its information, from MOTION on
OFFSET, INFORMATION, MOTION, COVARIANCE, WEIGHT = 0, 3, 9, 12, 18
# settings; LATEST is the estimate of the last pose, the new linearisation point if it is off by more than ENOUGH;
# CLOSEST is the range of the nearest sighting, or NEAR_SDS standard deviations of that range
LOSS, SCALE, FURTHEST, DAMPING, LATEST, ENOUGH, CLOSEST = 0, 1, 2, 3, 4, 7, 8
NEAR_SDS = 3.0
# steps; where the first number of NOISE is CUT, no motion leads to the step
DELTA, NOISE, POINT = 0, 3, 9
CUT = -1.0
# cliques: MEMBERS variables, the first FRONTALS of them frontal; SIZE scalars, the first FRONT of them frontal;
# EFFORT is the work of its elimination, or of the cliques that it was joined of: thresholds of work ignore joining
PARENT, FRONTALS, MEMBERS, FRONT, SIZE, BOUND, LISTED, FACTOR, UPDATE, CHILD, NEXT, FLAG, EFFORT = range(13)

NO_VARIABLE = -1
PENDING = -(2**62)
"""In `at`: the step's link does not exist yet."""

CLASSES = 250
"""Number of block sizes in an arena, four per power of two."""


@compiled
def rounded(n: int) -> tuple[int, int]:
    """The size class of a block of `n` entries, and its size."""
    n = max(n, 8)
    k = 3
    while (1 << (k + 1)) <= n:
        k += 1
    quarter = 1 << (k - 2)
    more = (n - (1 << k) + quarter - 1) // quarter
    return 4 * k + more, (1 << k) + more * quarter


@compiled
def reserve_ints(g: Graph, n: int) -> int:
    """Allocates a block of `n` integers; there must be room. Returns its start."""
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
    """Allocates a block of `n` numbers; there must be room. Returns its start."""
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
    """Frees the block of `n` integers at `at`."""
    kind, _ = rounded(n)
    g.ints[at] = g.free[0, kind]
    g.free[0, kind] = at


@compiled
def release_reals(g: Graph, at: int, n: int) -> None:
    """Frees the block of `n` numbers at `at`."""
    kind, _ = rounded(n)
    g.reals[at] = g.free[1, kind]
    g.free[1, kind] = at


@compiled
def triangle(n: int) -> int:
    """Numbers in an update matrix over `n` scalars, its right-hand side included."""
    return n * (n + 3) // 2
