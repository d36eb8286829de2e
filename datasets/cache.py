"""Caches the logs of sources marked costly in the user's cache folder, and seeds the generators of all.

The key is of everything that a log depends on, so an entry is never stale.
"""

import contextlib
import hashlib
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.factors import Dataset
from ..core.factors.check import check
from ..core.files import cache_folder
from . import archive
from .registry import Source

_MADE_WITH = ("numpy", "opencv-contrib-python-headless")


def cached(name: str, source: Source, options: Any, seed: int) -> Dataset:
    """Makes the dataset `name` of `source`, or reads it from the cache where it is costly; InputError if that fails.

    A costly source must depend on nothing but its options, the files that it names, its random generator and the code
    of this package.
    """
    if not source.costly:
        return _made(name, source, options, seed)
    entry = cache_folder() / f"{_key(name, source, options, seed)}.npz"
    with contextlib.suppress(InputError):  # missing or damaged: made again
        return archive.load(entry)
    dataset = _made(name, source, options, seed)
    with contextlib.suppress(OSError):  # an unwritable cache only costs time
        entry.parent.mkdir(parents=True, exist_ok=True)
        archive.save(entry, dataset)
    return dataset


def generator(name: str, seed: int) -> np.random.Generator:
    """The random generator of the dataset `name` for `seed`, the same in every process.

    It does not depend on the options: variants of a dataset share their random numbers and can be compared in pairs.
    """
    word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, word]))


def _made(name: str, source: Source, options: Any, seed: int) -> Dataset:
    try:
        dataset = source.make(options, generator(name, seed))
    except OSError as error:
        raise InputError(f"dataset {name}: {error}; expected readable files.") from None
    check(dataset.log, where=f"dataset {name}")
    return dataset


def _key(name: str, source: Source, options: Any, seed: int) -> str:
    """The cache key: sha256 of everything that the log depends on."""
    package = Path(__file__).parent.parent
    total = hashlib.sha256(repr((name, options, seed, platform.python_version())).encode())
    for read in source.files(options):
        with contextlib.suppress(OSError):  # a missing one is told of by who reads it
            content = hashlib.sha256(read.read_bytes()).hexdigest()
            total.update(f"\n{read.absolute()} {content}\n".encode())
    for part in _MADE_WITH:
        total.update(f"\n{part} {_version(part)}\n".encode())
    for file in sorted(file for layer in ("core", "frontend", "datasets") for file in package.glob(f"{layer}/**/*.py")):
        total.update(f"\n{file.relative_to(package).as_posix()}\n".encode())
        total.update(file.read_bytes())
    return total.hexdigest()


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "absent"
