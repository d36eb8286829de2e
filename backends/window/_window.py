"""The arrays of a fixed-lag smoother: its poses, their sightings, and a chain of eliminated variables.

Poses are eliminated oldest first. What remains after each is information about the next pose and the landmarks, the
front; the rows of R and d of each eliminated variable are a stage of the chain (see `_chain`). At the window's start
all older information is such a front, too: the prior.

A front is a matrix as in `_factors`: the pose in rows 0 to 2, the landmark of slot k in rows 3 + 2k and 4 + 2k.
"""

from ...core.kernels._arrays import Arrays, Integers, IntegerTable, Numbers, Table
from ...core.kernels.compiled import compiled


class Window(Arrays):
    """All arrays of a window; each has spare rows."""

    state: Integers  # (STATE,) counts
    poses: Table  # (P, 15) linearisation point (3), the motion into the pose (3), its covariance (6), its slope (3)
    rows: IntegerTable  # (P + 1, 3)
    sightings: Integers  # (S,) landmarks, or HELD
    parts: Integers  # (S,) as the PART of a smoother's sightings: see `smoothing/_graph.py`
    seen: Table  # (S, 5) range, bearing, and their information: rr, rb, bb
    fixed: Table  # (F, 11) fixes, as there
    places: Table  # (V, 2) linearisation points of landmarks, x, y (m), of constant errors, and of biases, (rad/s, 0)
    marks: IntegerTable  # (V, 4)
    slots: IntegerTable  # (N, 2) the landmarks of the front, and those of the prior
    front: Numbers  # 2 N + 3 rows of 2 N + 4 numbers
    prior: Numbers  # the same
    stages: IntegerTable  # (T, 4)
    reals: Numbers  # [R d] of the stages, one after another
    work: Numbers  # the front once more, its pose last, as [R d]
    settings: Numbers  # (2,) robust loss and its scale


# state; BOTTOM is the pose of the prior; OLD_POSES, OLD_SIGHTINGS and OLD_FIXES have been removed from the tables
POSES, BOTTOM, SIGHTINGS, SLOTS, KNOWN, STAGES, REALS, OLD_POSES, OLD_SIGHTINGS, FIXES, OLD_FIXES = range(11)
STATE = 12
# poses
POINT, MOTION, NOISE, SLOPE = 0, 3, 6, 12
# rows: start of a pose's sightings; the stage in which it is eliminated; 1 plus the row of the gyro's bias on which the
# motion into it depends, which is then that of a bias of zero; 0 without one
FIRST, AT, BIAS = range(3)
# marks: a landmark's slot in the front, or one of the kinds below; the last pose that sighted it, or -1; one of the
# presences below; 1 if its linearisation point is fixed
SLOT, LAST, PRESENCE, STAYS = range(4)
# slot: not in the front yet, eliminated, held fixed
FRESH, RETIRED, FIXED = -1, -2, -3
# presence: in the window, left, or an unused row
IN, LEFT, FREE = range(3)
# slots
NOW, BEFORE = range(2)
# stages: the eliminated slot, or POSE; the front's landmarks then; start of its numbers; its pose or landmark
OWN, MANY, BEGIN, NAME = range(4)
POSE = -1
HELD = -1
"""A sighting of a landmark that is not initialised yet."""


@compiled
def row(w: Window) -> int:
    """Numbers in a row of the front."""
    return 2 * len(w.slots) + 4
