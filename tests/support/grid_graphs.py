"""Random pose graphs: a robot on the streets of a grid, with loop closures where it has been before."""

from dataclasses import replace

import numpy as np

from driven import NO_LOOPS, NO_SIGHTINGS
from slamduel.core.factors import Log, Odometry, Prior, RelativePoses, Step
from slamduel.core.se2 import Array, between, compose, wrap

SIZE, RECENT = 8.0, 20  # m, half of the grid; the steps before that no loop closure is to
MOVED, MET = np.array([0.02, 0.02, 0.02]), np.array([0.05, 0.05, 0.02])  # noise of motions and loop closures, m and rad


def grid_graph(seed: int, steps: int = 300, *, turns: float = 1.0, share: float = 0.6, wrong: float = 0.0) -> Log:
    """A pose graph: loop closures at a `share` of the steps that can have one, `wrong` at that share of the steps.

    `turns` multiplies the noise of turns, as stated.
    """
    rng = np.random.default_rng(seed)
    moved = MOVED * (1.0, 1.0, turns)
    poses = _walk(rng, steps)
    delta = between(poses[:-1], poses[1:]) + moved * rng.standard_normal((steps - 1, 3))
    made = [Step(0.0, None, NO_SIGHTINGS, NO_LOOPS)]
    for k in range(1, steps):
        before = np.arange(max(k - RECENT, 0))
        near = before[np.hypot(*(poses[before, :2] - poses[k, :2]).T) < 1.1]
        to, seen = list[int](), list[Array]()
        if len(near) and rng.random() < share:
            to.append(int(rng.choice(near)))
            seen.append(between(poses[to[0]], poses[k]) + MET * rng.standard_normal(3))
        if len(before) and rng.random() < wrong and (other := int(rng.choice(before))) not in to:
            to.append(other)
            seen.append(np.array([*rng.normal(0.0, 2.0, 2), rng.uniform(-np.pi, np.pi)]))
        loops = RelativePoses(
            np.array(to, np.int64), np.array(seen).reshape(-1, 3), np.tile(np.diag(MET**2), (len(to), 1, 1))
        )
        made.append(Step(float(k), Odometry(delta[k - 1], np.diag(moved**2)), NO_SIGHTINGS, loops))
    return Log.from_steps("grid", Prior(np.zeros(3), 1e-6 * np.eye(3)), made)


def misstated(log: Log, motions: float, others: float) -> Log:
    """The log with the stated standard deviations of motions, and those of all else, multiplied."""
    return replace(
        log, delta_cov=motions**2 * log.delta_cov, loop_cov=others**2 * log.loop_cov, z_cov=others**2 * log.z_cov
    )


def _walk(rng: np.random.Generator, steps: int) -> Array:
    poses = [np.zeros(3)]
    while len(poses) < steps:
        turn = rng.choice([0.0, 0.0, 0.0, np.pi / 2, -np.pi / 2])
        ahead = compose(poses[-1], np.array([1.0, 0.0, turn]))
        if np.abs(compose(ahead, np.array([1.0, 0.0, 0.0]))[:2]).max() <= SIZE:
            poses.append(np.array([*ahead[:2], wrap(ahead[2])]))
        else:
            poses[-1] = compose(poses[-1], np.array([0.0, 0.0, np.pi / 2]))
    return np.array(poses)
