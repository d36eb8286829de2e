"""People who walk in the corridor and are taken for landmarks."""

from dataclasses import replace

import numpy as np

from ...core.arrays import frozen, frozen_ids
from ...core.elementary import hypot
from ...core.factors import UNKNOWN, Log, Truth
from ...core.se2 import Array, Ints
from ..worlds.floor_plan import Plan
from ..worlds.measurements import sightings
from .in_view import BLOCK, is_free

UNNAMED, MEETING = "unknown", "meeting"
CLEAR = 0.6  # m around the robot into which nobody steps
SPEEDS = (0.5, 1.3)  # m/s
ASIDE = 0.6  # m from the middle of the corridor, at most


def with_people(
    log: Log, truth: Truth, plan: Plan, count: int, ids: str, reach: float, sd: float, rng: np.random.Generator
) -> tuple[Log, Truth, int]:
    """Adds the sightings of `count` people, from CLEAR to `reach` m away, none through a wall; and their number.

    They have no id or, if `ids` is "meeting", a new one whenever one of them comes into view. Their true id is UNKNOWN.
    """
    walking, seeing = rng.spawn(2)
    people = _people(plan, count, walking)
    parts, who = list[tuple[Ints, Array]](), list[Ints]()
    for begin in range(0, len(log), BLOCK):
        rows = slice(begin, begin + BLOCK)
        for number, person in enumerate(people):
            xy, poses = _along(plan, person, log.t[rows]), truth.poses[rows]
            away = hypot(*(xy - poses[:, :2]).T)
            near = np.flatnonzero((away >= CLEAR) & (away <= reach))
            near = near[is_free(plan, poses[near], xy[near])]
            parts.append((begin + near, xy[near]))
            who.append(np.full(len(near), number))
    step, xy = (np.concatenate(column) for column in zip(*parts, strict=True))
    person = np.concatenate(who)
    named = np.full(len(step), UNKNOWN) if ids == UNNAMED else _meetings(log, truth, step, person)
    order = np.argsort(step, kind="stable")
    step, xy, named = step[order], xy[order], named[order]
    z, cov = sightings(truth.poses[step], xy, sd, seeing)
    ranged = z[:, 0] > 0
    step, named, z, cov = step[ranged], named[ranged], z[ranged], cov[ranged]
    steps = np.concatenate((log.sighting_step, step))
    order = np.argsort(steps, kind="stable")  # after the step's own
    assigned = np.concatenate((log.ids if truth.assigned is None else truth.assigned, np.full(len(step), UNKNOWN)))
    merged = replace(
        log,
        sighting_first=frozen_ids(np.searchsorted(steps[order], np.arange(len(log) + 1))),
        ids=frozen_ids(np.concatenate((log.ids, named))[order]),
        z=frozen(np.concatenate((log.z, z))[order]),
        z_cov=frozen(np.concatenate((log.z_cov, cov))[order]),
    )
    return merged, truth._replace(assigned=frozen_ids(assigned[order])), len(step)


def _people(plan: Plan, count: int, rng: np.random.Generator) -> Array:
    """Place along the ring (m), speed (m/s, either way) and offset from its middle (m) of each: (count, 3)."""
    around = float(np.abs(np.diff(plan.ring, axis=0, append=plan.ring[:1])).sum())
    speed = rng.uniform(*SPEEDS, count) * rng.choice([-1.0, 1.0], count)
    return np.stack((rng.uniform(0, around, count), speed, rng.uniform(-ASIDE, ASIDE, count)), axis=-1)


def _along(plan: Plan, person: Array, t: Array) -> Array:
    """(n, 2) m: where one of `_people` is at the times `t` (n,)."""
    start, speed, aside = person
    sides = np.diff(plan.ring, axis=0, append=plan.ring[:1])
    lengths = np.abs(sides).sum(axis=1)
    ends = np.cumsum(lengths)
    way = np.mod(start + speed * t, ends[-1])
    side = np.minimum(np.searchsorted(ends, way, "right"), 3)
    along = (sides / lengths[:, None])[side]
    left = np.stack((-along[:, 1], along[:, 0]), axis=-1)
    return plan.ring[side] + along * (way - (ends - lengths)[side])[:, None] + aside * left


def _meetings(log: Log, truth: Truth, step: Ints, person: Ints) -> Ints:
    """(m,) the id of each sighting: new where the person was not seen in the step before."""
    assert truth.map is not None
    free = 1 + max(log.ids.max(initial=-1), truth.map.ids.max(initial=-1))
    order = np.lexsort((step, person))
    new = (np.diff(person[order], prepend=-1) != 0) | (np.diff(step[order], prepend=-2) != 1)
    ids = np.empty(len(step), np.int64)
    ids[order] = free + np.cumsum(new) - 1
    return ids
