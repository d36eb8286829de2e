"""Makes the log of a dataset, with a reference where its ground truth is not known."""

from typing import Any

from ...core.factors import Dataset, Map, Start
from ...datasets import cache
from ...datasets import registry as datasets
from .given_map import localising
from .reference import known


def prepared(name: str, options: Any, seed: int, given: Map | None = None, start: Start = "known") -> Dataset:
    """Makes the log with its truth or reference; `given` and `start` go into its prior.

    InputError where it cannot be made.
    """
    made = cache.prepared(name, datasets.find(name), options, seed)
    log = made.log if given is None else localising(made.log, given, f"dataset {name}", start)
    return Dataset(log, known(log, made.truth))
