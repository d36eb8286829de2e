"""Kidnapping: the robot is put somewhere else on its way, and its odometry does not notice."""

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints


def kidnapped(log: Log, truth: Truth, at: float, rng: np.random.Generator) -> tuple[Log, Truth, int]:
    """Puts the robot, at the time `at` s, on a later step of its way, from where it goes on; and that step's number.

    The way in between is left out: the log is shorter, its times without a gap. The place is drawn from the first half
    of the steps that are left, of those at least half as far away as the farthest. The true path jumps there; the
    odometry is that of the motion to the place. InputError unless a few steps come before and after.
    """
    here = int(np.searchsorted(log.t, log.t[0] + at))
    there = np.arange(here + 1, (here + len(log)) // 2 + 1)
    if here < 1 or not len(there) or there[-1] >= len(log):
        last = log.t[-1] - log.t[0]
        raise InputError(
            f"dataset {log.name}: option kidnap={at:g}: expected a time within the log, of {last:g} s, at least "
            "2 steps before its end."
        )
    away = hypot(*(truth.poses[there, :2] - truth.poses[here - 1, :2]).T)
    there = there[away >= away.max() / 2]
    to = int(there[rng.integers(len(there))])
    steps = np.concatenate((np.arange(here), np.arange(to, len(log))))
    t = log.t[steps]
    t[here:] -= log.t[to] - log.t[here]
    sightings = np.flatnonzero((log.sighting_step < here) | (log.sighting_step >= to))
    poses = truth.poses[steps]
    t.flags.writeable = poses.flags.writeable = False
    assigned = None if truth.assigned is None else truth.assigned[sightings]
    return _only(log, t, steps, sightings), truth._replace(t=t, poses=poses, assigned=assigned), here


def _only(log: Log, t: Array, steps: Ints, sightings: Ints) -> Log:
    """The log of some `steps`, at the times `t`, and `sightings`, as rows."""
    step = np.repeat(np.arange(len(steps)), np.diff(log.sighting_first)[steps])
    seen = log.ids[sightings], log.z[sightings], log.z_cov[sightings]
    return Log.from_arrays(log.name, log.prior, t, log.delta[steps], log.delta_cov[steps], step, *seen, notes=log.notes)
