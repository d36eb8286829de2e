"""Reads a TOML file that names the logs of one dataset, and which of them belong together.

[[logs]]
path = "drives/monday-1"                 a log, a graph or a recording, or several by * and ?; from the file's folder
cluster = "monday"                       optional: logs of one cluster share a run, a robot or a building

[[logs]]
dataset = "mrclam[dataset=6,robot=all]"  or a dataset as on the command line
seed = 3                                 optional: of a dataset that draws its logs
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ...core.toml.table import TomlTable
from ..registry import Named, Source

KEYS = ("path", "dataset", "cluster", "seed")


@dataclass(frozen=True)
class Options(Named):
    """Which file."""

    path: str | None = option(None, "a TOML file that names the logs")


class Entry(NamedTuple):
    """One table of the file."""

    dataset: str  # as on the command line; "" where there is a path
    path: str  # "" where there is a dataset
    cluster: str | None
    seed: int | None
    said: str  # the path or the dataset as the file has it
    table: TomlTable

    @property
    def where(self) -> str:
        """Returns the file and the key, as a question about the entry begins."""
        return f"{self.table.file}: {'dataset' if self.dataset else 'path'}"

    def refused(self, problem: str) -> InputError:
        """Makes the refusal of the entry."""
        return self.table.refused("dataset" if self.dataset else "path", f"{self.said} {problem}.")


def make(options: Options, rng: np.random.Generator) -> Dataset:
    """Your own logs in one verdict, those that belong together as clusters: logs[path=FILE.toml]."""
    del rng
    raise InputError(f"dataset logs: found the logs of {options.path}, expected one of them.")


source = Source(make, Options)


def read(path: str | None) -> list[Entry]:
    """Reads the file's entries, one or more. InputError names the line and key of what cannot be used."""
    if path is None:
        raise InputError("option path of dataset logs is not given, expected a TOML file: logs[path=FILE.toml].")
    file = TomlTable.read(Path(path)).only(("logs",))
    found = [_entry(table, os.path.dirname(path) or ".") for table in file.tables("logs", "tables, [[logs]]")]
    if not found:
        raise InputError(f"{path}: found no logs, expected one or more tables [[logs]].")
    return found


def _entry(table: TomlTable, folder: str) -> Entry:
    table.only(KEYS)
    if table.has("path") == table.has("dataset"):
        raise table.lacks("path", "a path or a dataset, one of the two")
    key = "path" if table.has("path") else "dataset"
    said = table.text(key)
    if '"' in said and key == "path":
        raise table.refused(key, "found a double quote in the path, expected one without.")
    return Entry(
        said if key == "dataset" else "",
        os.path.join(folder, said) if key == "path" else "",
        table.text("cluster").strip() if table.has("cluster") else None,
        table.whole("seed", 0, 0) if table.has("seed") else None,
        said,
        table,
    )
