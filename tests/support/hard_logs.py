"""Random logs with loop closures and given maps of every kind."""

import numpy as np

from random_logs import random_covariance
from slamduel.core.factors import Dataset, Log, Map, RelativePoses
from slamduel.core.se2 import between


def with_loops(made: Dataset, count: int, rng: np.random.Generator) -> Dataset:
    """Adds up to `count` loop closures between random poses, drawn from their covariances."""
    steps, truth = list(made.log), made.truth
    for _ in range(count):
        k = int(rng.integers(2, len(steps)))
        to, loops = int(rng.integers(0, k - 1)), steps[k].loops
        if to in loops.to:
            continue
        cov = random_covariance(rng, [0.05, 0.05, 0.02])
        delta = between(truth.poses[to], truth.poses[k]) + rng.multivariate_normal(np.zeros(3), cov)
        more = (np.append(loops.to, to), np.vstack((loops.delta, delta)), np.concatenate((loops.cov, cov[None])))
        steps[k] = steps[k]._replace(loops=RelativePoses(*more))
    return Dataset(Log.from_steps("loops", made.log.prior, steps), truth)


def with_given(made: Dataset, kind: str, rng: np.random.Generator) -> Dataset:
    """Adds a map of most of its landmarks: "fixed", or drawn with a covariance of "blocks", or "joint"."""
    truth = made.truth
    keep = rng.random(len(truth.map.ids)) < 0.7
    keep[0] = True
    ids, xy, cov = truth.map.ids[keep], truth.map.xy[keep], None
    if kind != "fixed":
        n = 2 * len(ids)
        mixed = 0.02 * rng.standard_normal((n, n))
        cov = mixed @ mixed.T + 0.01 * np.eye(n)
        if kind == "blocks":
            block = np.arange(n) // 4
            cov = cov * (block[:, None] == block)
        xy = xy + rng.multivariate_normal(np.zeros(n), cov).reshape(-1, 2)
    prior = made.log.prior._replace(map=Map(ids, xy, cov))
    return Dataset(Log.from_steps("given", prior, list(made.log)), truth)
