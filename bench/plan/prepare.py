"""From a dataset's name to a log that cells can run on: made, checked, and given a reference where truth is unknown."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ...datasets import archive, cache
from ...datasets import registry as datasets
from ...datasets.truth import digest
from ...frontend.factors import Dataset, Map, Truth
from ...frontend.sketch import Sketch, sketch
from .given_map import localising
from .reference import known


@dataclass(frozen=True)
class Task:
    """A log to prepare, and the archive it goes to."""

    name: str
    options: Any
    seed: int
    archive: Path
    map: Map | None = None  # goes into the log's prior


class Prepared(NamedTuple):
    """A log that is ready in its archive."""

    digest: str
    truth: Truth | None  # the reference, where the dataset has none
    told: str | None  # the digest of the dataset's own truth
    sketch: Sketch


def run(task: Task) -> Prepared:
    """Make the log and write its archive. InputError where the dataset cannot be had."""
    dataset = cache.prepared(task.name, datasets.find(task.name), task.options, task.seed)
    log = dataset.log if task.map is None else localising(dataset.log, task.map, f"dataset {task.name}")
    truth = known(log, dataset.truth)
    archive.save(task.archive, Dataset(log, truth))
    return Prepared(log.digest, truth, None if dataset.truth is None else digest(dataset.truth), sketch(log))
