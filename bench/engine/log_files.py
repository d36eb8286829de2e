"""Keeps logs beside a record, so that all its cells run on the same ones, on whatever machine.

Each is an archive in the folder `logs`, named by its content: a file never changes, and another log of the same dataset
is another file. The record says which of them counts.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import TABLES, Dataset, Log, Truth
from ...core.files import write_whole
from ...core.se2 import wrap
from ...datasets import archive
from ...datasets.truth import digest
from ..record.database import Unwritable
from ..record.store import Known
from ..workers.batch import KeptLog, digested
from .key import hashed

FOLDER = "logs"

ROUNDING = 1e-6  # m and rad, between two batch optima of one log, and between two detections in one image


class LogFiles:
    """The logs in a record's folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / FOLDER

    def entry(self, dataset: str, known: Known) -> KeptLog:
        """The place of such a log, whether it exists or not."""
        digests = known.digest, known.truth_digest
        return KeptLog(self.folder / f"{dataset}-{hashed(*digests)}.npz", digests)

    def read(self, dataset: str, known: Known) -> Dataset | None:
        """Reads the kept log with these digests; None if it is missing or damaged."""
        entry = self.entry(dataset, known)
        try:
            found = archive.load(entry.path)
        except InputError:
            return None
        return found if digested(found).digests == entry.digests else None

    def like(self, dataset: str, made: Dataset, candidates: Iterable[Known]) -> Dataset | None:
        """Finds the first candidate that is kept and differs from `made` by rounding alone; None without any."""
        kept = (self.read(dataset, known) for known in candidates)
        return next((one for one in kept if one is not None and same(one, made)), None)

    def keep(self, dataset: str, known: Known, content: bytes) -> None:
        """Writes the archive of such a log; Unwritable where it cannot be written."""
        path = self.entry(dataset, known).path
        try:
            path.parent.mkdir(exist_ok=True)
            write_whole(path, content)
        except OSError as error:
            raise Unwritable(f"{path}: cannot be written: {error.strerror}.") from None

    def tidy(self) -> None:
        """Removes what a killed writer has left."""
        for part in self.folder.glob(".*.part"):
            part.unlink(missing_ok=True)


def same(one: Dataset, other: Dataset) -> bool:
    """True if two versions of a log with its truth or reference differ by rounding alone."""
    return _same_log(one.log, other.log) and _same_truth(one.truth, other.truth)


def _same_log(one: Log, other: Log) -> bool:
    if one.digest == other.digest:
        return True
    for table in TABLES:
        mine, its = getattr(one, table), getattr(other, table)
        if (mine is None) != (its is None) or (mine is not None and not _close(mine.columns, its.columns)):
            return False
    names = ("t", "delta", "delta_cov", "sighting_first", "ids", "z", "z_cov", "loop_first", "loop_to", "loop_delta")
    return _close(*({name: getattr(log, name) for name in (*names, "loop_cov")} for log in (one, other)))


def _close(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """True if columns of these names differ by rounding alone."""
    pairs = [(one[name], other[name]) for name in one]
    return all(a.shape == b.shape and np.allclose(a, b, ROUNDING, ROUNDING, equal_nan=True) for a, b in pairs)


def _same_truth(one: Truth | None, other: Truth | None) -> bool:
    if one is None or other is None or (one.kind, other.kind) != ("reference", "reference"):
        return _digest(one) == _digest(other)
    if not np.array_equal(one.t, other.t) or one.words != other.words:
        return False
    apart = one.poses - other.poses
    apart[:, 2] = wrap(apart[:, 2])
    return bool(np.abs(apart).max(initial=0.0) <= ROUNDING)


def _digest(truth: Truth | None) -> str:
    return "" if truth is None else digest(truth)
