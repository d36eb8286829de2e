"""Small logs with every kind of content, for tests of reading, writing and checking logs."""

from collections.abc import Callable
from typing import Any

import numpy as np

from slamduel.core.factors import UNKNOWN, Dataset, Log, Map, Prior, Truth
from slamduel.core.se2 import Array


def positive_definite(rng: np.random.Generator, m: int, k: int) -> Array:
    """(m, k, k), exactly symmetric, with condition numbers of a few hundred at most."""
    root = rng.normal(size=(m, k, k))
    cov = root @ root.swapaxes(1, 2) + 0.1 * np.eye(k)
    return 0.01 * (cov + cov.swapaxes(1, 2)) / 2


def columns(rng: np.random.Generator) -> dict[str, Any]:
    """The arguments of Log.from_arrays: six steps, some without sightings, unknown ids, loops, a map in the prior."""
    known = Map(np.array([3, 8]), rng.normal(size=(2, 2)), positive_definite(rng, 1, 4)[0])
    return {
        "name": "small",
        "prior": Prior(rng.uniform(-3, 3, 3), positive_definite(rng, 1, 3)[0], known),
        "t": np.cumsum(rng.uniform(0.1, 1, 6)),
        "delta": rng.uniform(-3, 3, (6, 3)),
        "delta_cov": positive_definite(rng, 6, 3),
        "sighting_step": np.array([0, 0, 0, 2, 2, 5]),
        "ids": np.array([3, UNKNOWN, UNKNOWN, 3, 8, 12]),
        "z": rng.uniform(0.1, 3, (6, 2)),
        "z_cov": positive_definite(rng, 6, 2),
        "loop_step": np.array([3, 5]),
        "loop_to": np.array([0, 1]),
        "loop_delta": rng.uniform(-3, 3, (2, 3)),
        "loop_cov": positive_definite(rng, 2, 3),
        "notes": {"source": "drawn at random", "counts": [1, 2], "settings": {"range_sd": 0.1}},
    }


def small_log(seed: int = 1, change: Callable[[dict[str, Any]], Any] | None = None) -> Log:
    """The log of `columns`, modified by `change`."""
    parts = columns(np.random.default_rng(seed))
    if change is not None:
        change(parts)
    return Log.from_arrays(**parts)


def small_dataset(seed: int = 1) -> Dataset:
    """`small_log` and ground truth with a gap, a map and the ids of all sightings."""
    log, rng = small_log(seed), np.random.default_rng(seed + 1)
    seen = [0, 1, 2, 4, 5]
    poses = rng.uniform(-3, 3, (len(seen), 3))
    landmarks = Map(np.array([3, 8, 12]), rng.normal(size=(3, 2)), None)
    return Dataset(log, Truth(log.t[seen], poses, landmarks, np.array([3, 8, 12, 3, 8, 12]), "truth"))


def assert_same(found: Dataset, expected: Dataset) -> None:
    """Bit for bit."""
    assert found.log.name == expected.log.name
    assert found.log.digest == expected.log.digest
    assert found.log.notes == expected.log.notes
    if found.truth is None or expected.truth is None:
        assert found.truth is expected.truth
        return
    assert found.truth.kind == expected.truth.kind
    for one, other in zip(_arrays(found.truth), _arrays(expected.truth), strict=True):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())


def _arrays(truth: Truth) -> list[np.ndarray[Any, Any] | None]:
    known = truth.map
    return [truth.t, truth.poses, truth.assigned, *((None, None) if known is None else known[:2])]
