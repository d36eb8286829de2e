"""A window's step in one call."""

from ...core.kernels._planar import moved
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._graph import WHOLE
from ..smoothing._log import six
from ._chain import DONE, RETURNS, eliminate, sight
from ._estimates import factor_front, last_pose, look_at_pose
from ._window import BIAS, FIRST, HELD, LAST, MOTION, NOISE, POSES, SIGHTINGS, SLOPE, Window


@compiled
def add_pose(w: Window, motion: Array, pose: Array) -> None:
    """Adds a pose, `motion` (4, 3) from the last one's estimate: itself and its covariance."""
    i = w.state[POSES]
    w.state[POSES] = i + 1
    p = w.poses[i]
    p[0], p[1], p[2] = moved(pose[0], pose[1], pose[2], motion[0, 0], motion[0, 1], motion[0, 2])
    for a in range(3):
        p[MOTION + a] = motion[0, a]
    six(motion, 1, p, NOISE)
    w.rows[i + 1, FIRST] = w.rows[i, FIRST]


@compiled
def add_sightings(w: Window, landmarks: Ints, seen: Array) -> None:
    """Adds sightings (k, 6) from the last pose: range, bearing and their covariance. HELD ones await their landmark."""
    i, s = w.state[POSES] - 1, w.state[SIGHTINGS]
    for k in range(len(landmarks)):
        rr, rb, bb = seen[k, 2], (seen[k, 3] + seen[k, 4]) / 2, seen[k, 5]
        d = 1.0 / (rr * bb - rb * rb)
        w.sightings[s], w.parts[s] = landmarks[k], WHOLE
        w.seen[s, 0], w.seen[s, 1] = seen[k, 0], seen[k, 1]
        w.seen[s, 2], w.seen[s, 3], w.seen[s, 4] = bb * d, -rb * d, rr * d
        if landmarks[k] != HELD:
            w.marks[landmarks[k], LAST] = i
        s += 1
    w.state[SIGHTINGS] = w.rows[i + 1, FIRST] = s


@compiled
def add_parts(w: Window, landmarks: Ints, parts: Ints, seen: Array) -> None:
    """Adds partial sightings and fixes of the last pose, after its whole ones: columns of the window's tables."""
    i, s = w.state[POSES] - 1, w.state[SIGHTINGS]
    for k in range(len(landmarks)):
        w.sightings[s], w.parts[s] = landmarks[k], parts[k]
        for j in range(5):
            w.seen[s, j] = seen[k, j]
        if landmarks[k] != HELD:
            w.marks[landmarks[k], LAST] = i
        if parts[k] >= 0:
            w.marks[parts[k], LAST] = i
        s += 1
    w.state[SIGHTINGS] = w.rows[i + 1, FIRST] = s


@compiled
def look_at_poses(w: Window, first: int, path: Array, covs: Array) -> None:
    """Writes the estimates of the poses from `first` on into path (n, 3) and covs (n, 3, 3)."""
    for k in range(len(path)):
        look_at_pose(w, first + k, path[k], covs[k])


@compiled
def latest(w: Window, pose: Array, cov: Array) -> int:
    """Adds the last pose's sightings; `pose` (3,) and `cov` (3, 3) become the latest. Returns the outcome."""
    ended = sight(w, w.state[POSES] - 1)
    if ended == DONE:
        ended = factor_front(w)
    if ended == DONE:
        last_pose(w, pose, cov)
    return ended


@compiled
def advance(w: Window, pose: Array, cov: Array) -> int:
    """Eliminates the pose before the last in favour of that, and does the same."""
    if w.state[POSES] == 1:
        return RETURNS
    ended = eliminate(w, w.state[POSES] - 2)
    return latest(w, pose, cov) if ended == DONE else ended


@compiled
def turn_pose(w: Window, slope: Array, bias: int, start: Array, pose: Array) -> None:
    """Has the last pose, whose motion began at `pose`, depend on a gyro's bias: see `turned_step`."""
    i = w.state[POSES] - 1
    p = w.poses[i]
    p[0], p[1], p[2] = moved(pose[0], pose[1], pose[2], start[0], start[1], start[2])
    for a in range(3):
        p[SLOPE + a] = slope[a]
    w.rows[i, BIAS] = bias + 1


@compiled
def measured(
    w: Window, landmarks: Ints, seen: Array, of_parts: Ints, parts: Ints, part_seen: Array, pose: Array, cov: Array
) -> int:
    """Adds all that was measured at the last pose, as `add_sightings` and `add_parts` do; then as `advance`."""
    add_sightings(w, landmarks, seen)
    add_parts(w, of_parts, parts, part_seen)
    return advance(w, pose, cov)


@compiled
def step(
    w: Window, first: int, path: Array, covs: Array, motion: Array, landmarks: Ints, seen: Array,
    pose: Array, cov: Array,
) -> int:  # fmt: skip
    """Applies `motion` and the sightings; `pose` (3,) and `cov` (3, 3) become the latest.

    The poses from `first` on leave, their estimates into path (n, 3) and covs (n, 3, 3). If an eliminated landmark is
    sighted, everything must be eliminated again.
    """
    look_at_poses(w, first, path, covs)
    add_pose(w, motion, pose)
    add_sightings(w, landmarks, seen)
    return advance(w, pose, cov)


# One by one, as they come from Python objects at every step.
@compiled
def parts_step(
    w: Window, first: int, path: Array, covs: Array, motion: Array, landmarks: Ints, seen: Array,
    of_parts: Ints, parts: Ints, part_seen: Array, pose: Array, cov: Array,
) -> int:  # fmt: skip
    """The same with partial sightings, fixes and priors of constant errors, as `add_parts` has them."""
    look_at_poses(w, first, path, covs)
    add_pose(w, motion, pose)
    return measured(w, landmarks, seen, of_parts, parts, part_seen, pose, cov)


# One by one, as they come from Python objects at every step.
@compiled
def turned_step(
    w: Window, first: int, path: Array, covs: Array, motion: Array, slope: Array, bias: int, start: Array,
    landmarks: Ints, seen: Array, of_parts: Ints, parts: Ints, part_seen: Array, pose: Array, cov: Array,
) -> int:  # fmt: skip
    """The same with a motion that depends on a gyro's bias, by its `slope` (3,) at any, and is `start` (3,) at present.

    `bias` is its row, -1 where the motion has none.
    """
    look_at_poses(w, first, path, covs)
    add_pose(w, motion, pose)
    turn_pose(w, slope, bias, start, pose)
    return measured(w, landmarks, seen, of_parts, parts, part_seen, pose, cov)
