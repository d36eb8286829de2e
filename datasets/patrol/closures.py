"""Loop closures of a patrol: relative poses between two rounds."""

from dataclasses import replace

import numpy as np

from ...core.arrays import frozen, frozen_ids
from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, between, wrap
from .rounds import Drive, Rounds


def closed(
    log: Log, truth: Truth, path: Rounds, drive: Drive, every: int, sd: tuple[float, float], rng: np.random.Generator
) -> Log:
    """Adds a loop closure at every `every`-th step, from the second round on.

    It is to the step of an earlier round, any of them, in which the robot was nearest to that place of its round. Its
    error has the standard deviations `sd`, of both coordinates (m) and of the heading (rad).
    """
    choosing, measuring = rng.spawn(2)
    step = np.arange(every, len(log), every)
    step = step[drive.round[step] > 0]
    earlier = (choosing.uniform(size=len(step)) * drive.round[step]).astype(np.int64)
    to = _step_at(log, earlier * path.period + drive.phase[step])
    spread = np.array([sd[0], sd[0], sd[1]])
    delta = between(truth.poses[to], truth.poses[step]) + spread * measuring.standard_normal((len(step), 3))
    delta[:, 2] = wrap(delta[:, 2])
    cov = np.zeros((len(step), 3, 3))
    cov[:, [0, 1, 2], [0, 1, 2]] = spread**2
    return replace(
        log,
        loop_first=frozen_ids(np.searchsorted(step, np.arange(len(log) + 1))),
        loop_to=frozen_ids(to),
        loop_delta=frozen(delta),
        loop_cov=frozen(cov),
    )


def _step_at(log: Log, t: Array) -> Ints:
    """The steps nearest to the times `t` (m,)."""
    after = np.clip(np.searchsorted(log.t, t), 1, len(log) - 1)
    return np.where(t - log.t[after - 1] <= log.t[after] - t, after - 1, after)
