"""Drives backends, by name, through logs: their paths, solutions and errors."""

from typing import Any

import numpy as np

from slamduel.backends.registry import find
from slamduel.bench.measure.accuracy import align, aligned, ate
from slamduel.core.factors import Log, Prior, RangeBearing, RelativePoses
from slamduel.core.se2 import Array

NO_SIGHTINGS = RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


def make(name: str, prior: Prior, seed: int = 0, /, **options: Any) -> Any:
    """A new backend; "fixed-lag by gtsam" sets the option `solver`."""
    name, _, solver = name.partition(" by ")
    builder = find(name)
    chosen = builder.options(**options, **({"solver": solver} if solver else {}))
    return builder.make(prior, chosen, np.random.default_rng(seed))


def run(name: str, log: Log, seed: int = 0, /, **options: Any) -> tuple[Any, Array]:
    """The backend at the end of the log, and its online path (n, 3)."""
    backend = make(name, log.prior, seed, **options)
    return backend, np.array([backend.step(step) for step in log])


def final(name: str, log: Log, seed: int = 0, /, **options: Any) -> Any:
    """The backend's solution."""
    return run(name, log, seed, **options)[0].finish()


def rmse(path: Array, truth: Array) -> float:
    """m, of the positions, without alignment."""
    return float(np.sqrt(((path - truth)[:, :2] ** 2).sum(axis=1).mean()))


def aligned_error(path: Array, truth: Array) -> float:
    """m, ATE after rigid alignment."""
    return ate(aligned(align(path, truth), path), truth)


def asking_changes_nothing(plain: Any, asked: Any, log: Log) -> None:
    """Queries between steps change no bit of the path, the map and the solution of equal backends."""
    for step in log:
        assert plain.step(step).tobytes() == asked.step(step).tobytes()
        asked.belief()
        asked.map()
    for one, other in ((plain.belief().cov, asked.belief().cov), *zip(plain.map(), asked.map(), strict=True)):
        assert np.array_equal(one, other)
    ends = [backend.finish() for backend in (plain, asked)]
    assert all(end is None for end in ends) or ends[0].path.tobytes() == ends[1].path.tobytes()
