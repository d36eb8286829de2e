"""Datasets ready for the runner: the one place where a (name, options, seed) becomes a log.

The sources marked costly are kept in the user's cache folder, under a name made of everything that the log depends on,
so an entry is never stale: what has changed has another name. The environment variable SLAMDUEL_CACHE moves the folder.
"""

import contextlib
import hashlib
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from ..frontend.check import check
from ..frontend.errors import InputError
from ..frontend.factors import Dataset
from . import archive
from .registry import Source

_MADE_WITH = ("numpy", "opencv-contrib-python-headless")


def prepared(name: str, source: Source, options: Any, seed: int) -> Dataset:
    """The dataset `name` of `source`, made with `options`, for `seed`; InputError where it cannot be made.

    A costly source must depend on nothing but its options, its random generator and the code of this package.
    """
    seed = seed if source.seeded else 0
    if not source.costly:
        return _made(name, source, options, seed)
    entry = folder() / f"{_key(name, options, seed)}.npz"
    with contextlib.suppress(InputError):  # absent or damaged: made anew
        return archive.load(entry)
    dataset = _made(name, source, options, seed)
    with contextlib.suppress(OSError):  # a cache that cannot be written to only costs time
        entry.parent.mkdir(parents=True, exist_ok=True)
        archive.save(entry, dataset)
    return dataset


def folder() -> Path:
    """Where prepared logs are kept; it may not exist yet."""
    return Path(os.environ.get("SLAMDUEL_CACHE") or platformdirs.user_cache_path("slamduel"))


def generator(name: str, seed: int) -> np.random.Generator:
    """The random generator of the dataset `name` for `seed`, the same in every process.

    Options have no part in it, so that variants of one dataset share their randomness and can be compared in pairs.
    """
    word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, word]))


def _made(name: str, source: Source, options: Any, seed: int) -> Dataset:
    try:
        dataset = source.make(options, generator(name, seed))
    except OSError as error:
        raise InputError(f"dataset {name}: {error}; expected files that can be read.") from None
    check(dataset.log, where=f"dataset {name}")
    return dataset


def _key(name: str, options: Any, seed: int) -> str:
    """sha256 of what the log depends on."""
    package = Path(__file__).parent.parent
    total = hashlib.sha256(repr((name, options, seed, platform.python_version())).encode())
    for part in _MADE_WITH:
        total.update(f"\n{part} {_version(part)}\n".encode())
    for file in sorted([*package.glob("frontend/**/*.py"), *package.glob("datasets/**/*.py")]):
        total.update(f"\n{file.relative_to(package).as_posix()}\n".encode())
        total.update(file.read_bytes())
    return total.hexdigest()


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "absent"
