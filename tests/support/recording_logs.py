"""The logs of recordings of any kind."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from slamduel.core.factors import Log
from slamduel.datasets.recordings.any_recording import Options, make


def of(folder: Path, **options: Any) -> Log:
    """The log of a recording."""
    return make(Options(path=str(folder), **options), np.random.default_rng(0)).log


@cache
def kept(folder: Path) -> Log:
    """The log of a recording that no test changes, made once."""
    return of(folder)
