"""Laser logs of the Freiburg SLAM benchmark, in CARMEN's format, through the laser front end.

R. Kuemmerle et al., On measuring the accuracy of SLAM algorithms, Autonomous Robots 27(4), 2009. Beside each log lies a
file of relations: where the robot was at one scan as seen from another, verified by hand. One dataset is all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ..formats import carmen
from ..registry import Member, Source, find
from .catalogue import PUBLISHED, fetched, place


@dataclass(frozen=True)
class Options(carmen.Options):
    """Which file, what its scanner is, and the front end."""

    path: str | None = option(None, "the file of the log; not given: the copy from bench fetch")


@dataclass(frozen=True)
class Behind(Options):
    """The scanner of Freiburg's robot."""

    ahead: float = option(-0.04, "how far the scanner sits ahead of the robot's origin, m", minimum=-10.0, maximum=10.0)


@dataclass(frozen=True)
class Buildings:
    """Which logs."""

    path: str | None = option(
        None, "a folder with logs by their published names, such as intel.clf; not given: the copies from bench fetch"
    )


BUILDINGS = ("aces", "fr079", "intel-lab", "killian", "mit-csail")


def log_file(name: str) -> str:
    """The name of the file of scans of a published laser log."""
    return next(file for file in PUBLISHED[name].files if file.endswith(".clf"))


def _source(name: str, summary: str, options: type[Options] = Options) -> Source:
    def make(options: Any, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
        given = None if options.path is None else Path(options.path)
        path = given or fetched(name, f"{name}[path=FILE]") / log_file(name)
        published = PUBLISHED[name]
        return carmen.dataset(path, options, name, {"source": published.citation, "licence": published.licence})

    def files(options: Any) -> Sequence[Path]:
        return carmen.files(replace(options, path=options.path or str(place(name) / log_file(name))))

    make.__doc__ = summary
    return Source(make, options, costly=True, portable=False, files=files)


aces = _source("aces", "ACES building, Austin: corridors around a courtyard, 7,374 scans, odometry, true relations.")
fr079 = _source(
    "fr079", "Freiburg, building 079: offices on a corridor, 4,934 scans, odometry, true relations.", Behind
)
intel_lab = _source("intel-lab", "Intel Research Lab, Seattle: offices, 13,631 scans, odometry, true relations.")
killian = _source("killian", "MIT, Killian Court: 1.9 km of corridors, 17,480 scans, odometry, true relations.")
mit_csail = _source("mit-csail", "MIT, CSAIL building: one floor, 1,988 scans, odometry, true relations.")


def _make_all(options: Buildings, rng: np.random.Generator) -> Dataset:
    """The laser logs with relations in one verdict, each building a cluster: laser-all, laser-all[path=FOLDER]."""
    del rng
    raise InputError(f"dataset laser-all: found {len(_members(options))} logs, expected one of them.")


def _members(options: Buildings) -> list[Member]:
    """Lists the buildings that are there; without a path, where none was fetched, all of them."""
    there = _there(options)
    if options.path and not there:
        expected = " or ".join(map(log_file, BUILDINGS))
        raise InputError(f"{options.path}: found no laser log of the benchmark, expected {expected}.")
    return [
        Member(name, replace(find(name).options(), path=path), name, name)
        for name, path in (there or dict.fromkeys(BUILDINGS)).items()
    ]


def _absent(options: Buildings) -> list[str]:
    there = _there(options)
    return [name for name in BUILDINGS if name not in there] if there else []


def _there(options: Buildings) -> dict[str, str | None]:
    """The buildings that are there, each with the file of its scans, None for one that was fetched."""
    if not options.path:
        return {name: None for name in BUILDINGS if place(name).is_dir()}
    files = {name: Path(options.path) / log_file(name) for name in BUILDINGS}
    found = {name: [file, file.with_name(f"{file.name}.gz")] for name, file in files.items()}
    return {name: str(file) for name, both in found.items() for file in [one for one in both if one.is_file()][:1]}


all_buildings = Source(_make_all, Buildings, many=_members, absent=_absent)
