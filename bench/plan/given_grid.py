"""An occupancy grid that --map gives: an option of every laser log of the run."""

import glob
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...datasets.grid_file import NAME
from .spec import dataset_variant
from .variant import DatasetVariant

FILES = (".npz", ".pgm", ".png")
"""Endings of what lies in the folder of a grid, or beside the .yaml of a map."""


def is_grid(source: Any) -> bool:
    """True for the folder of a grid, one for each seed with a *, or for a map of ROS; InputError for a file of one."""
    if not isinstance(source, str):
        return False
    if source.lower().endswith(FILES) and Path(source).is_file():
        raise InputError(
            f"--map {source}: is a file of a grid, expected the folder that bench map wrote, or the .yaml of a ROS map."
        )
    if source.lower().endswith((".yaml", ".yml")):
        return True
    folders = glob.glob(source) if "*" in source else [source]
    return any((Path(folder) / NAME).is_file() for folder in folders)


def on_grid(
    datasets: Sequence[DatasetVariant], words: Mapping[str, Any]
) -> tuple[tuple[DatasetVariant, ...], dict[str, Any]]:
    """Gives the grid to every dataset as an option, and takes it from the run's words; InputError where it has none."""
    source, start = words["map"], words.get("start", "known")
    if words.get("map_fixed"):
        raise InputError(f"--map-fixed: {source} is an occupancy grid, which is fixed as it is; expected it without.")
    if source.count("*") > 1:
        raise InputError(f"--map {source}: has {source.count('*')} *, expected one: it is the seed of each log.")
    found: list[DatasetVariant] = []
    for dataset in datasets:
        if not any(field.name == "grid" for field in fields(dataset.options)):
            raise InputError(
                f"--map {source}: is an occupancy grid, and {dataset.label} takes none; expected a laser log, such as "
                "laser-floor or a CARMEN file; a recording has it in robot.toml, [laser] grid."
            )
        if dataset.options.grid is not None:
            raise InputError(f"--map {source}: {dataset.label} has a grid already, expected one of the two.")
        if dataset.options.start != "known":
            raise InputError(
                f"--map {source}: {dataset.label} has the option start, expected --start {dataset.options.start}."
            )
        found.append(dataset_variant(dataset.name, replace(dataset.options, grid=source, start=start)))
    return tuple(found), {**words, "map": None, "start": "known"}
