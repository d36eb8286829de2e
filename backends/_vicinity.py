"""Which landmarks a sighting may be of, by what is remembered of them; and what is then expected of those asked for.

A landmark is remembered in two ways, as it was when it was last asked for. In the world, its deviation bounds the one
that it has now, as it only falls. In the frame of odometry, where what is near the robot stays in place, its deviation
from the robot has since grown by the noise of the motions alone: on a map whose place in the world is not well known,
this bound is by far the smaller one.
"""

from math import atan2, cos, sin, sqrt

import numpy as np

from ..core.kernels._arrays import Arrays, Integers, Numbers, Table, at
from ..core.kernels._planar import moved, wrap
from ..core.kernels.compiled import compiled
from ..core.se2 import Array
from ._expected import LEAST_RANGE, Gaussian, carried, jointly, may_be_seen, spread
from ._expected_arrays import expected_at

X, Y, HEADING, NOISE, TURNS, TURNS_X, TURNS_Y, TURNS_AWAY, SD, HEADING_SD, SINCE = range(11)
BEFORE, POSE, STATE = 15, 18, 21
"""Entries of the odometer.

Its pose; sums over all motions: of the variance of their places, m^2, and of the variance v of their turns, rad^2, of
v x, v y and v (x^2 + y^2) for a turn at (x, y); the standard deviations of the last pose asked for, m and rad; the sums
then, its own pose then, and that of the robot. A heading that is off by a turn at o puts what is at p off by the turn
times |p - o|, so that these sums give the variance of all turns at any place.
"""

SUMS = 5
"""Number of these sums."""

JUMP, LITTLE = 3.0, 0.3
"""Standard deviations of the motions since the last question, and of a sighting, by which the pose has moved otherwise.

Beyond these odometry was wrong, or a loop was closed, and what is remembered in the frame of odometry is not used.
"""


class Places(Arrays):
    """The memory of n landmarks."""

    ids: Integers  # (n,)
    asked: Integers  # (n,) rows of those that may be in view come first: see `choose`
    xy: Table  # (n, 2) m, in the world
    sd: Numbers  # (n,) m, in any direction at most; NaN for a landmark that is forgotten
    off: Table  # (n, 2) m, in the frame of odometry
    apart: Numbers  # (n,) m; of its place as the robot saw it
    since: Table  # (n, SUMS) the odometer's sums then
    odometer: Numbers  # (STATE,)


places_at = at(Places)
"""The places at an address."""


@compiled
def move(address: int, motion: Array) -> None:
    """Moves the odometer by a motion: rows of dx, dy, dtheta and of its covariance, (4, 3)."""
    add_motion(places_at(address).odometer, motion)


@compiled
def add_motion(o: Array, motion: Array) -> None:
    """Moves an odometer."""
    o[X], o[Y], o[HEADING] = moved(o[X], o[Y], o[HEADING], motion[0, 0], motion[0, 1], motion[0, 2])
    turn, most = motion[3, 2], spread(motion[1, 0], motion[1, 1], motion[2, 1])
    o[NOISE] += most * most
    o[TURNS] += turn
    o[TURNS_X] += turn * o[X]
    o[TURNS_Y] += turn * o[Y]
    o[TURNS_AWAY] += turn * (o[X] * o[X] + o[Y] * o[Y])


@compiled
def turned(o: Array, since: Array, x: float, y: float) -> float:
    """The variance that the turns since then have put on what is at (x, y), m^2."""
    away = (o[TURNS] - since[1]) * (x * x + y * y) - 2.0 * (x * (o[TURNS_X] - since[2]) + y * (o[TURNS_Y] - since[3]))
    return max(0.0, away + (o[TURNS_AWAY] - since[4]))


@compiled
def choose(
    address: int,
    landmarks: int,
    pose: Array,
    P: Array,
    follows: bool,
    moves: bool,
    motion: Array,
    z: Array,
    R: Array,
    gate: float,
) -> int:
    """Fills `asked` of the places at `address` with those that one of the sightings z (k, 2), R (k, 2, 2) may be of.

    Returns their number. The first `landmarks` rows are known. `pose` is the last one, before the motion, P its
    covariance, which is not used if the odometer `follows` every motion. A landmark that has been corrected since
    it was asked for has moved in the world by a normal vector of the covariance it has lost: the sum of that and of
    an error within the gate is within twice the gate. So it is with where the robot saw it then and sees it now.
    """
    g = places_at(address)
    if follows and jumped(g.odometer, pose, R):
        g.apart[:landmarks] = np.inf
    o, x, Q = g.odometer.copy(), pose.copy(), P.copy()
    if moves:
        add_motion(o, motion)
        carried(x, Q, motion)
    pose_sd, heading_sd = spread(Q[0, 0], Q[1, 0], Q[1, 1]), sqrt(Q[2, 2])
    if follows:
        heading_sd = sqrt(o[HEADING_SD] ** 2 + max(0.0, o[TURNS] - o[SINCE + 1]))
        pose_sd = o[SD] + sqrt(max(0.0, o[NOISE] - o[SINCE]) + turned(o, o[SINCE:], o[X], o[Y]))
        pose_sd += o[HEADING_SD] * sqrt((o[X] - o[BEFORE]) ** 2 + (o[Y] - o[BEFORE + 1]) ** 2)
    furthest, wide, twice, n = 0.0, sqrt(2.0 * gate), 2.0 * gate, 0
    for i in range(len(z)):
        furthest = max(furthest, z[i, 0] + wide * sqrt(R[i, 0, 0]))
    for a in range(landmarks):
        dx, dy = g.xy[a, 0] - x[0], g.xy[a, 1] - x[1]
        reach = furthest + wide * (pose_sd + g.sd[a])
        if dx * dx + dy * dy > reach * reach:
            continue
        if follows and not may_be_where_it_was(o, g.off[a], g.apart[a], g.since[a], z, R, twice):
            continue
        if may_be_seen(x, pose_sd, heading_sd, g.xy[a, 0], g.xy[a, 1], g.sd[a], z, R, twice):
            g.asked[n] = a
            n += 1
    return n


@compiled
def jumped(o: Array, pose: Array, R: Array) -> bool:
    """Tells if the robot, now at `pose`, has not moved since it was last asked for as odometry says."""
    along, across = np.inf, np.inf
    for i in range(len(R)):
        along, across = min(along, sqrt(R[i, 0, 0])), min(across, sqrt(R[i, 1, 1]))
    turn = wrap(o[POSE + 2] - o[BEFORE + 2])
    c, s, dx, dy = cos(turn), sin(turn), o[X] - o[BEFORE], o[Y] - o[BEFORE + 1]
    ex, ey = pose[0] - o[POSE] - (c * dx - s * dy), pose[1] - o[POSE + 1] - (s * dx + c * dy)
    moved_sd = sqrt(max(0.0, o[NOISE] - o[SINCE]) + turned(o, o[SINCE:], o[X], o[Y]))
    turned_sd = sqrt(max(0.0, o[TURNS] - o[SINCE + 1]))
    if sqrt(ex * ex + ey * ey) > JUMP * moved_sd + LITTLE * along:
        return True
    return abs(wrap(pose[2] - o[HEADING] - turn)) > JUMP * turned_sd + LITTLE * across


@compiled
def may_be_where_it_was(o: Array, off: Array, apart: float, since: Array, z: Array, R: Array, gate: float) -> bool:
    """Tells if a sighting z (k, 2), R (k, 2, 2) can be within `gate` of a landmark, as the robot saw it then.

    `o` is the odometer, `off` (2,) the landmark's place in its frame, with a deviation of at most `apart` in any
    direction when the sums were `since`. Turns move it across the line of sight, and along it no further than they move
    the robot itself.
    """
    dx, dy = off[0] - o[X], off[1] - o[Y]
    r = sqrt(dx * dx + dy * dy)
    if not r > LEAST_RANGE:
        return True
    known, across, bearing = False, 0.0, 0.0
    both = apart * apart + max(0.0, o[NOISE] - since[0])
    along = both + turned(o, since, o[X], o[Y])
    for i in range(len(z)):
        gap = z[i, 0] - r
        if gap * gap > gate * (along + R[i, 0, 0]):
            continue
        if not known:
            known, across = True, (both + turned(o, since, off[0], off[1])) / (r * r)
            bearing = atan2(dy, dx) - o[HEADING]
        gap = wrap(z[i, 1] - bearing)
        if not gap * gap > gate * (across + R[i, 1, 1]):
            return True
    return False


@compiled
def learn(g: Places, a: int, pose: Array, P: Array, x: float, y: float, C: Array, L: Array) -> None:
    """Remembers landmark `a` at (x, y).

    P (3, 3), C (3, 2) and L (2, 2), of which the lower triangle is read, are the covariances of the pose, of it with
    the landmark, and the landmark's own.
    """
    o = g.odometer
    c, s = cos(o[HEADING] - pose[2]), sin(o[HEADING] - pose[2])
    dx, dy, t = x - pose[0], y - pose[1], P[2, 2]
    g.xy[a, 0], g.xy[a, 1] = x, y
    g.sd[a] = spread(L[0, 0], L[1, 0], L[1, 1])
    # of the landmark less the pose's place, less the offset turned with its heading
    xx = L[0, 0] + P[0, 0] + dy * dy * t + 2.0 * (dy * C[2, 0] - C[0, 0] - dy * P[2, 0])
    yy = L[1, 1] + P[1, 1] + dx * dx * t + 2.0 * (dx * P[2, 1] - C[1, 1] - dx * C[2, 1])
    xy = L[1, 0] - C[1, 0] - dx * C[2, 0] - C[0, 1] + P[1, 0]
    xy += dx * P[2, 0] + dy * C[2, 1] - dy * P[2, 1] - dx * dy * t
    g.apart[a] = spread(xx, xy, yy)
    g.off[a, 0], g.off[a, 1] = o[X] + c * dx - s * dy, o[Y] + s * dx + c * dy
    for h in range(SUMS):
        g.since[a, h] = o[NOISE + h]


@compiled
def note(o: Array, pose: Array, P: Array) -> None:
    """Notes in the odometer that it was asked at this pose, with covariance P (3, 3)."""
    o[SD], o[HEADING_SD] = spread(P[0, 0], P[1, 0], P[1, 1]), sqrt(max(0.0, P[2, 2]))
    for h in range(SUMS):
        o[SINCE + h] = o[NOISE + h]
    for h in range(3):
        o[BEFORE + h], o[POSE + h] = o[X + h], pose[h]


@compiled
def expect(
    address: int,
    pose: Array,
    at: Array,
    joint: Array,
    moves: bool,
    motion: Array,
    z: Array,
    R: Array,
    gate: float,
    into: int,
) -> None:
    """Remembers the first n landmarks `asked` for, and fills the `ExpectedArrays` at `into` with those within the gate.

    Nothing is decided yet.
    `pose` (3,) before the motion, the landmarks' places `at` (n, 2) and their covariance (2n + 3, 2n + 3), the pose
    last, of which the rows of the pose and what is on and below the diagonal are read; there is room for n.
    """
    g = places_at(address)
    rows = g.asked[: len(at)]
    n, x, out = 2 * len(rows), pose.copy(), expected_at(into)
    for k in range(len(rows)):
        i = 2 * k
        learn(g, rows[k], pose, joint[n:, n:], at[k, 0], at[k, 1], joint[n:, i : i + 2], joint[i : i + 2, i : i + 2])
    note(g.odometer, pose, joint[n:, n:])
    Q, C = np.empty((3, 3)), np.empty((3, n))
    for i in range(3):
        for j in range(3):
            Q[i, j] = joint[n + i, n + j]
        for j in range(n):
            C[i, j] = joint[n + i, j]
    if moves:
        gx, gy = carried(x, Q, motion)
        for j in range(n):
            C[0, j] += gx * C[2, j]
            C[1, j] += gy * C[2, j]
    index = np.empty(len(rows), np.int64)
    out.count[0] = jointly(Gaussian(x, Q, at, C, joint), z, R, gate, index, out.z, out.cov)
    for p in range(out.count[0]):
        out.ids[p] = g.ids[rows[index[p]]]
