"""Makes datasets by name, for Python: the log, and its ground truth if known."""

from pathlib import Path

from ...core.errors import InputError
from ...core.factors import Dataset
from ...datasets.on_demand.ready import made_ready
from .spec import dataset_at, dataset_variants
from .values import as_text, as_whole
from .variant import DatasetVariant


def load(name: str | Path, seed: int = 0) -> Dataset:
    """Makes the dataset of `bench run --dataset NAME`; a `Path` is one even if a dataset has its name. InputError."""
    seed = as_whole("slamduel.load: seed", seed, 0)
    if isinstance(name, Path):
        return made(dataset_at(name, "slamduel.load"), seed)
    return made(one(as_text("slamduel.load: name", name), "slamduel.load"), seed)


def one(text: str, caller: str) -> DatasetVariant:
    """Finds the one dataset that `text` names; InputError, in the name of the `caller`, for several."""
    variants = dataset_variants(text, caller)
    if len(variants) != 1:
        raise InputError(f"{caller}: found {len(variants)} datasets, expected one.")
    return variants[0]


def made(variant: DatasetVariant, seed: int) -> Dataset:
    """Makes the dataset for `seed`; InputError where it cannot be made."""
    log = variant.log(seed)
    return made_ready(log.dataset.name, log.dataset.source, log.dataset.options, log.seed)
