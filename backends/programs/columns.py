"""The factors of steps as arrays, as programs take them that are given a whole graph."""

from collections.abc import Sequence

import numpy as np

from ...core.factors import Step
from ...core.se2 import Array, Ints


def motions(steps: Sequence[Step], first: int = 0) -> tuple[Ints, Array, Array, Array]:
    """Motions and loop closures of steps whose first one has the number `first`.

    Their ends (m, 2), the later one last, delta (m, 3) and cov (m, 3, 3) in the frame of the first end, and True (m,)
    for a loop closure; in the order of the steps, each motion before its step's loops.
    """
    ends, loop = list[tuple[int, int]](), list[bool]()
    delta, cov = list[Array](), list[Array]()
    for k, step in enumerate(steps, first):
        if step.odometry is not None:
            ends.append((k - 1, k))
            delta.append(step.odometry.delta)
            cov.append(step.odometry.cov)
            loop.append(False)
        ends += [(to, k) for to in step.loops.to.tolist()]
        delta += list(step.loops.delta)
        cov += list(step.loops.cov)
        loop += [True] * len(step.loops.to)
    there = np.array(ends, np.int64).reshape(-1, 2)
    return there, np.array(delta).reshape(-1, 3), np.array(cov).reshape(-1, 3, 3), np.array(loop, bool)


def sightings(steps: Sequence[Step]) -> tuple[Ints, Array, Array, Ints]:
    """Ids (s,), z (s, 2), covariances (s, 2, 2) and the step's number in `steps` (s,) of all sightings."""
    of = np.repeat(np.arange(len(steps)), [len(step.sightings.ids) for step in steps])
    seen = [step.sightings for step in steps]
    ids, z, cov = (np.concatenate([getattr(one, name) for one in seen]) for name in ("ids", "z", "cov"))
    return ids, z, cov, of
