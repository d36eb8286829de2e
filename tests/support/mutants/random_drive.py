"""A random drive as a log, without files."""

import tempfile
from pathlib import Path

import numpy as np

import slamduel
from slamduel.core.factors import Dataset

from .csv_logs import texts, written
from .drive import drive


def random_drive(rng: np.random.Generator, seconds: float = 60.0) -> Dataset:
    """A drive of so many s with the default noise of CSV logs."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        return slamduel.load(written(Path(scratch), dict(texts(drive(rng, seconds)))))
