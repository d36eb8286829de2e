"""Logs of robots that do not know where they are: without ids, carried elsewhere, on another world's map."""

from dataclasses import replace
from typing import Any

import numpy as np

from slamduel.bench.measure.locating import TURNED, gap
from slamduel.core.factors import UNKNOWN, Dataset, Log, Map, Step, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.worlds import circle

RING = "circle[steps=400,landmarks=80,sighting=0.05,odometry=0.02]"
MAP_SD = 0.01
"""m, of each landmark of a given map."""


def unnamed(log: Log) -> Log:
    """The log without any id."""
    return replace(log, ids=np.full(len(log.ids), UNKNOWN))


def ring(landmarks: int = 16, **options: Any) -> Dataset:
    """A robot that goes round twice among landmarks that stand well apart."""
    sizes: dict[str, Any] = {"steps": 120, "landmarks": landmarks, "sighting": 0.05, "odometry": 0.02}
    return circle.circle(circle.Options(**(sizes | options)), np.random.default_rng(1))


def surveyed(known: Map, sd: float = MAP_SD) -> Map:
    """The true map as one that is given, with independent errors of that standard deviation."""
    errors = np.random.default_rng(0).normal(0, sd, known.xy.shape)
    return Map(known.ids, known.xy + errors, sd**2 * np.eye(2 * len(known.ids)))


def window(log: Log, first: int, steps: int) -> list[Step]:
    """Steps of the log."""
    return [log[k] for k in range(first, first + steps)]


def kidnapped(log: Log, truth: Truth, begins: int, leaves: int, arrives: int) -> tuple[Log, Array]:
    """The log from a step on whose robot is carried from where it was at one step to where it was at a later one, and
    its true poses."""
    kept = [*range(begins, leaves), *range(arrives, len(log))]
    steps = [log[k]._replace(t=float(i)) for i, k in enumerate(kept)]
    return Log.from_steps("kidnapped", log.prior, steps), truth.poses[kept]


def astray(pose: Array, true: Array, known: Map) -> bool:
    """Returns True where a pose is at another place than the true one."""
    off = pose - true
    return bool(np.hypot(off[0], off[1]) > gap(known.xy) or abs(float(wrap(off[2]))) > TURNED)
