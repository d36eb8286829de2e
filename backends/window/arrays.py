"""Creates and enlarges a window's arrays, and queries poses and landmarks."""

from math import isqrt
from typing import Any

import numpy as np

from ...core.factors import Prior
from ...core.kernels._cholesky import row_of
from ...core.se2 import Array
from ..smoothing._graph import FIX
from . import _estimates, _step
from ._window import (
    BEFORE,
    BOTTOM,
    FIRST,
    FIXED,
    FIXES,
    FREE,
    FRESH,
    IN,
    KNOWN,
    LAST,
    NAME,
    OLD_FIXES,
    OLD_POSES,
    OLD_SIGHTINGS,
    OWN,
    POSE,
    POSES,
    PRESENCE,
    REALS,
    RETIRED,
    SIGHTINGS,
    SLOT,
    STAGES,
    STATE,
    Window,
)  # fmt: skip

SPARE = 16  # initial rows for landmarks


def made(prior: Prior, loss: int, scale: float) -> Window:
    """A window with nothing but the prior at step 0; a given map's landmarks come first."""
    known = prior.map
    n = 0 if known is None else len(known.ids)
    w = Window(
        state=np.zeros(STATE, np.int64),
        poses=np.zeros((64, 15)),
        rows=np.zeros((65, 3), np.int64),
        sightings=np.zeros(256, np.int64),
        parts=np.zeros(256, np.int64),
        seen=np.zeros((256, 5)),
        fixed=np.zeros((0, 11)),
        places=np.zeros((0, 2)),
        marks=np.zeros((0, 4), np.int64),
        slots=np.zeros((0, 2), np.int64),
        front=np.zeros(12),
        prior=np.zeros(12),
        stages=np.zeros((0, 4), np.int64),
        reals=np.zeros(0),
        work=np.zeros(0),
        settings=np.array((loss, scale)),
    )
    fixed = known is None or known.cov is None
    w = _with_rows(w, n + SPARE, SPARE if fixed else n + SPARE)
    front = _square(w.prior)
    front[:3, :3] = np.linalg.inv(prior.cov)
    if known is not None:
        w.places[:n], w.marks[:n, PRESENCE] = known.xy, IN
        if known.cov is None:
            w.marks[:n, SLOT] = FIXED
        else:
            front[3 : 3 + 2 * n, 3 : 3 + 2 * n] = np.linalg.inv(known.cov)
            w.state[KNOWN], w.slots[:n, BEFORE] = n, np.arange(n)
    return w


def with_steps(w: Window, sightings: int) -> Window:
    """`w` with room for another pose and that many sightings of it; itself if there is."""
    state = w.state
    numbers = int(state[REALS]) + 3 * (2 * len(w.slots) + 7)
    if state[POSES] < len(w.poses) and state[SIGHTINGS] + sightings <= len(w.sightings) and numbers <= len(w.reals):
        return w
    _drop(w)
    poses, seen = len(w.poses), len(w.sightings)
    if 2 * state[POSES] > poses:
        w = w.replaced(poses=_longer(w.poses, poses), rows=_longer(w.rows, poses))
    if 2 * (state[SIGHTINGS] + sightings) > seen:
        more = max(seen, 2 * sightings)
        w = w.replaced(sightings=_longer(w.sightings, more), parts=_longer(w.parts, more), seen=_longer(w.seen, more))
    return _with_numbers(_with_stages(w), numbers)


def with_all(w: Window) -> Window:
    """`w` with room for eliminating everything in it again."""
    poses = int(w.state[POSES] - w.state[BOTTOM])
    landmarks = int(((w.marks[:, PRESENCE] != FREE) & (w.marks[:, SLOT] != FIXED)).sum())
    return _with_numbers(w, (3 * poses + 2 * landmarks) * (2 * landmarks + 7))


def row_of_new(w: Window, x: float, y: float) -> tuple[Window, int]:
    """A row for a new landmark at (x, y) m."""
    free = w.marks[:, PRESENCE] == FREE
    v = int(free.argmax()) if free.any() else len(free)
    if v == len(free):
        w = _with_rows(w, 2 * v, len(w.slots) + v)
    w.places[v], w.marks[v] = (x, y), (FRESH, -1, IN, 0)
    return w, v


def with_fix(w: Window, fix: Array) -> tuple[Window, int]:
    """`w` with another row (11,) of the fixes, and its part in the sightings."""
    row = int(w.state[FIXES])
    if row == len(w.fixed):
        w = w.replaced(fixed=_longer(w.fixed, row + 16))
    w.fixed[row], w.state[FIXES] = fix, row + 1
    return w, FIX - row - int(w.state[OLD_FIXES])


def offsets(w: Window) -> tuple[Array, Array]:
    """Offsets of all poses (n, 3) and landmarks (v, 2) from their linearisation points."""
    poses, places = np.zeros((int(w.state[POSES]), 3)), np.zeros_like(w.places)
    _estimates.offsets(w, poses, places)
    return poses, places


def look_at_landmark(w: Window, v: int) -> Array:
    """(2,) m; the estimated position of landmark `v`."""
    return look_at_pair(w, v)[0]


def look_at_pair(w: Window, v: int) -> tuple[Array, Array]:
    """The estimate (2,) of landmark `v`, or of a pair of other numbers, and its covariance (2, 2)."""
    t, slot = int(w.state[STAGES]), int(w.marks[v, SLOT])
    if slot == RETIRED:
        stages = w.stages[:t]
        t = int(np.flatnonzero((stages[:, NAME] == v) & (stages[:, OWN] != POSE))[0])
        slot = int(stages[t, OWN])
    off, cov = np.zeros(3), np.zeros((3, 3))
    _estimates.look(w, t, 3 + 2 * slot, off, cov)
    return w.places[v] + off[:2], cov[:2, :2]


def solve(w: Window, pose: Array, cov: Array) -> int:
    """Adds the last pose's sightings; `pose` (3,) and `cov` (3, 3) become the latest. Returns the outcome."""
    return _step.latest(w, pose, cov)


def _drop(w: Window) -> None:
    """Removes the poses before the prior's, and their sightings, from the tables."""
    bottom, poses, sightings = (int(w.state[k]) for k in (BOTTOM, POSES, SIGHTINGS))
    if bottom == 0:
        return
    s, fixes = int(w.rows[bottom, FIRST]), int(w.state[FIXES])
    old = int((w.parts[:s] <= FIX).sum())
    w.poses[: poses - bottom] = w.poses[bottom:poses].copy()
    w.rows[: poses - bottom + 1] = w.rows[bottom : poses + 1].copy()
    w.rows[: poses - bottom + 1, FIRST] -= s
    w.sightings[: sightings - s] = w.sightings[s:sightings].copy()
    w.parts[: sightings - s] = w.parts[s:sightings].copy()
    w.seen[: sightings - s] = w.seen[s:sightings].copy()
    w.fixed[: fixes - old] = w.fixed[old:fixes].copy()
    w.marks[:, LAST] = np.maximum(w.marks[:, LAST] - bottom, -1)
    stages = w.stages[: w.state[STAGES]]
    stages[stages[:, OWN] == POSE, NAME] -= bottom
    w.state[BOTTOM], w.state[POSES], w.state[SIGHTINGS] = 0, poses - bottom, sightings - s
    w.state[OLD_POSES] += bottom
    w.state[OLD_SIGHTINGS] += s
    w.state[FIXES] -= old
    w.state[OLD_FIXES] += old


def _with_rows(w: Window, rows: int, slots: int) -> Window:
    """`w` with that many rows for landmarks, and a front with room for that many of them."""
    more, m = rows - len(w.places), 2 * slots + 3
    w = w.replaced(
        places=_longer(w.places, more),
        marks=_longer(w.marks, more),
        slots=_longer(w.slots, slots - len(w.slots)),
        front=_wider(w.front, m),
        prior=_wider(w.prior, m),
        work=_longer(w.work, m * row_of(m) - len(w.work)),
    )
    w.marks[rows - more :] = FRESH, -1, FREE, 0
    return _with_stages(w)


def _with_stages(w: Window) -> Window:
    """`w` with a stage for each row of poses and landmarks."""
    return w.replaced(stages=_longer(w.stages, len(w.poses) + len(w.places) - len(w.stages)))


def _with_numbers(w: Window, numbers: int) -> Window:
    """`w` with room for that many numbers of the stages."""
    if numbers <= len(w.reals):
        return w
    reals, used = np.empty(max(numbers, 2 * len(w.reals))), int(w.state[REALS])
    reals[:used] = w.reals[:used]
    return w.replaced(reals=reals)


def _square(front: Array) -> Array:
    """Reshapes a front's numbers to (m, m + 1)."""
    n = isqrt(len(front))
    return front.reshape(n, n + 1)


def _wider(front: Array, m: int) -> Array:
    """A front's numbers with room for `m` rows."""
    out, old = np.zeros((m, m + 1)), _square(front)
    n = len(old)
    out[:n, :n], out[:n, m] = old[:, :n], old[:, n]
    return out.ravel()


def _longer(array: Any, more: int) -> Any:
    return np.concatenate((array, np.zeros((more, *array.shape[1:]), array.dtype)))
