"""The batch optimum of a log whose truth nobody knows: what the online estimates can be measured from, and no truth.

It is a maximum-likelihood estimate from the same factors that every backend gets, so smoothers come close to it by
construction, and no verdict on accuracy is drawn from it.
"""

import contextlib
import hashlib
from importlib import metadata
from pathlib import Path

import numpy as np

from ..backends import graph
from ..backends.api import Diverged
from ..datasets import archive, cache
from ..frontend.errors import InputError
from ..frontend.factors import Dataset, Log, Truth


def reference(log: Log) -> Truth | None:
    """The optimum of J by `graph`; None where there is none. Kept in the user's cache by the log's digest."""
    entry = cache.folder() / f"reference-{_key(log)}.npz"
    with contextlib.suppress(InputError):
        return archive.load(entry).truth
    batch = graph.build.make(log.prior, graph.Options(), np.random.default_rng(0))
    for step in log.identified():
        batch.step(step)
    try:
        solution = batch.finish()
    except Diverged:
        return None
    assert solution is not None
    truth = Truth(log.t, solution.path, solution.map._replace(cov=None), None, "reference")
    with contextlib.suppress(OSError):
        entry.parent.mkdir(parents=True, exist_ok=True)
        archive.save(entry, Dataset(log, truth))
    return truth


def _key(log: Log) -> str:
    """What the optimum depends on: the factors, the code that finds it and the library it uses."""
    total = hashlib.sha256(f"{log.digest} gtsam {metadata.version('gtsam')}\n".encode())
    for file in sorted(Path(graph.__file__).parent.glob("*.py")):
        total.update(file.read_bytes())
    return total.hexdigest()
