"""A made-up pose graph: laps of a block with loop closures, whose noise is as stated."""

import numpy as np

from random_logs import moved, random_covariance
from slamduel.core.factors import Dataset, Log, Prior, Truth
from slamduel.core.se2 import between, wrap

SIDE = 20
"""Steps of half a metre to a side."""


def laps(rng: np.random.Generator, count: int = 3, every: int = 2, noise: float = 1.0) -> Dataset:
    """`count` laps; from the second on, every so many steps one to three loops to the lap before.

    Every covariance is another random one, with standard deviations near `noise` times 2 cm, 1 cm and 0.005 rad for a
    motion, and 2 cm, 2 cm and 0.01 rad for a loop.
    """
    n, lap = 4 * SIDE * count + 1, 4 * SIDE
    poses = [np.zeros(3)]
    for k in range(1, n):
        turn = np.pi / 2 if k % SIDE == 0 else 0.0
        poses.append(moved(poses[-1], np.array([0.5, 0.0, turn])))
    path = np.array(poses)
    motion_cov = np.array([random_covariance(rng, [0.02 * noise, 0.01 * noise, 0.005 * noise]) for _ in range(n)])
    delta = np.zeros((n, 3))
    delta[1:] = between(path[:-1], path[1:])
    delta += np.array([rng.multivariate_normal(np.zeros(3), cov) for cov in motion_cov])
    step = np.repeat(np.arange(lap, n, every), rng.integers(1, 4, len(range(lap, n, every))))
    to = np.clip(step - lap + rng.integers(-4, 5, len(step)), 0, step - 1)
    cov = np.array([random_covariance(rng, [0.02 * noise, 0.02 * noise, 0.01 * noise]) for _ in step])
    found = between(path[to], path[step]) + np.array([rng.multivariate_normal(np.zeros(3), one) for one in cov])
    delta[:, 2], found[:, 2] = wrap(delta[:, 2]), wrap(found[:, 2])
    t, no = np.arange(n, dtype=float), np.zeros(0, np.int64)
    log = Log.from_arrays(
        "laps", Prior(path[0], 1e-6 * np.eye(3)), t, delta, motion_cov,
        no, no, np.zeros((0, 2)), np.zeros((0, 2, 2)), loop_step=step, loop_to=to, loop_delta=found, loop_cov=cov,
    )  # fmt: skip
    return Dataset(log, Truth(t, path))
