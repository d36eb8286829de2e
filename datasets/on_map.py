"""Gives the robot of a simulated world a map, and hides where it starts on it, as options of the dataset.

The map is drawn from a generator of its own: everything else of the log is the same, bit for bit.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import InputError
from ..core.factors import STARTS, Dataset, Map
from ..core.options import option
from ..core.se2 import Array

NONE, SURVEYED, FOREIGN = "none", "surveyed", "foreign"


@dataclass(frozen=True)
class OnMap:
    """The map that the robot is given, by default none; a simulated world's options inherit it."""

    map: str = option(
        NONE,
        "map that the robot is given: that of its world, surveyed, or another world's that is built like it",
        choices=(NONE, SURVEYED, FOREIGN),
    )
    map_sd: float = option(0.02, "standard deviation of the given map's landmarks, m", minimum=1e-6, maximum=10.0)
    start: str = option("known", "start on the given map: known, or unknown", choices=STARTS)


def on_map(dataset: Dataset, options: OnMap, rng: np.random.Generator) -> Dataset:
    """Puts a map into the log's prior, each landmark with an error of its own, and what is known of the start.

    InputError for an unknown start without a map, and for a world without landmarks.
    """
    log, truth = dataset
    if options.map == NONE:
        if options.start != "known":
            raise InputError(
                f"dataset {log.name}: option start={options.start}: there is no map to start on, expected "
                f"map={SURVEYED} or map={FOREIGN}."
            )
        return dataset
    if truth is None or truth.map is None:
        raise ValueError("the map that is given is the true one")
    if not len(truth.map.ids):
        raise InputError(f"dataset {log.name}: option map={options.map}: there is no landmark to put on a map.")
    errors, moved = rng.standard_normal((2, *truth.map.xy.shape))
    xy = truth.map.xy if options.map == SURVEYED else elsewhere(truth.map.xy, moved)
    xy, cov = xy + options.map_sd * errors, options.map_sd**2 * np.eye(2 * len(xy))
    xy.flags.writeable = cov.flags.writeable = False
    given = Map(truth.map.ids, xy, cov)
    prior = log.prior._replace(map=given, start="known" if options.start == "known" else "unknown")
    return Dataset(replace(log, prior=prior, notes={**log.notes, "given map": options.map}), truth)


def elsewhere(xy: Array, moved: Array) -> Array:
    """The landmarks (n, 2) of another world: their mirror image, each `moved` (n, 2) times their spacing."""
    spacing = np.sqrt(np.prod(np.ptp(xy, axis=0)) / len(xy))
    return xy * (-1.0, 1.0) + spacing * moved
