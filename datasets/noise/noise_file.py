"""Reads and writes a noise as a TOML file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from ...core.errors import InputError
from ...core.files import write_whole
from ...core.toml.table import TomlTable
from .model import Model, SightingModel
from .systematic import NAMES, Systematic

MOTIONS = ("forward", "sideways", "turn")

STEEPEST = 10  # largest power of the distance, either way


def noted(model: Model) -> dict[str, Any]:
    """The numbers as tables of a TOML file, or of a log's notes."""
    tables: dict[str, Any] = {"fitted_on": list(model.fitted_on)}
    if model.odometry is not None:
        tables["odometry"] = dict(zip(MOTIONS, map(float, model.odometry), strict=True))
    for name, one in (("range", model.range), ("bearing", model.bearing)):
        if one is not None:
            tables[name] = {key: float(value) for key, value in one._asdict().items()}
    stays = {key: float(value) for key, value in model.systematic._asdict().items() if value}
    return tables | ({"systematic": stays} if stays else {})


def write_noise(path: Path, model: Model) -> None:
    """Writes the file, whole or not at all."""
    write_whole(path, tomli_w.dumps(noted(model)))


def read_noise(path: Path) -> Model:
    """Reads the file; InputError names the file, the line and the key of what is invalid."""
    file = TomlTable.read(path).only(("fitted_on", "odometry", "range", "bearing", "systematic"))
    fitted_on = file.names("fitted_on") if file.has("fitted_on") else []
    odometry = None
    if file.has("odometry"):
        table = file.table("odometry").only(MOTIONS)
        odometry = [table.number(name, above=0.0) for name in MOTIONS]
    range_, bearing = (_sightings(file.table(name)) if file.has(name) else None for name in ("range", "bearing"))
    stays = _systematic(file.table("systematic"))
    if odometry is None and range_ is None and bearing is None and stays == Systematic():
        raise InputError(f"{path}: found no noise, expected a table [odometry], [range], [bearing] or [systematic].")
    return Model(fitted_on, odometry, range_, bearing, stays)


_LIMITS: Mapping[str, dict[str, float]] = {
    "scale": {"above": 0.0},
    "power": {},
    "reach": {"above": 0.0},
    "bias": {"least": 0.0},
    "share": {"least": 0.0},
    "time": {"above": 0.0},
    "together": {"least": 0.0},
}


def _systematic(table: TomlTable) -> Systematic:
    table = table.only(NAMES)
    found = Systematic(**{name: table.number(name, 0.0) for name in NAMES})
    for name in NAMES:
        if name.endswith("_scale") and not getattr(found, name) > -1:
            raise table.fault(name, "a number above -1")
    return found


def _sightings(table: TomlTable) -> SightingModel:
    table = table.only(SightingModel._fields)
    found = SightingModel(**{name: table.number(name, **limits) for name, limits in _LIMITS.items()})
    for name in ("share", "together"):
        if getattr(found, name) > 1:
            raise table.fault(name, "a number from 0 to 1")
    if abs(found.power) > STEEPEST:
        raise table.fault("power", f"a number from -{STEEPEST} to {STEEPEST}")
    return found
