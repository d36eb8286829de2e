"""Tables that the robot.toml of robots of every kind has: a camera, its mounting, odometry's noise, settings."""

import re
from collections.abc import Collection
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from ..core.errors import InputError, nearest
from ..core.se2 import Array
from ..core.toml.table import TomlTable
from ..frontend.camera.calibration import read
from ..frontend.camera.camera import Camera
from ..frontend.camera.mounting import from_matrix, from_rpy
from ..frontend.wheels.encoder import Floors
from ..frontend.wheels.track import TrackNoise
from .robot_files import is_settings

TRACK = ("forward", "turning", "turning_by_turn")  # keys of the noise of integrated odometry
FRONT_ENDS = ("markers", "laser", "depth")  # the tables of which a robot.toml has one


def robot_of(path: Path, front_end: str, tables: Collection[str]) -> TomlTable | None:
    """The robot.toml at `path`, with a table of that front end and others among `tables`; None without the first.

    InputError for another front end's table beside it, and for an unknown one.
    """
    if is_settings(path):
        return None
    file = TomlTable.read(path)
    if not file.has(front_end):
        return None
    also = "" if file.has("markers") else ", or [markers] as well"
    for other in FRONT_ENDS:
        if other != front_end and file.has(other):
            raise file.refused(
                front_end, f"is given beside [{other}], expected one robot.toml for each front end{also}."
            )
    return file.only(("name", front_end, "prior", "imu", "gps", "compass", *tables))


def cameras_in(camera: TomlTable, known: Collection[str]) -> tuple[str, ...]:
    """The names of several cameras, each with a table of its own in [camera]; none for an only camera,
    whose keys are `known`.

    InputError for a name that is no part of a file's, and for keys beside such tables.
    """
    names = tuple(key for key, value in camera.entries.items() if isinstance(value, dict) and key != "mounting")
    beside = next((key for key in camera.entries if key not in names), None)
    for name in names:
        if beside is not None:
            several = f"is one of several cameras beside {beside}, expected that key in the table of each."
            meant = nearest(name, known)
            raise camera.refused(name, f"there is no such key; {meant}" if meant.startswith("did") else several)
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise camera.refused(name, f"found a camera called {name!r}, expected letters, digits, _ and - alone.")
    return names


def pose_in(camera: TomlTable, key: str) -> Array:
    """(4, 4) the pose of a camera from the table `key`, of xyz and rpy or of a matrix; without it, straight ahead."""
    given = camera.table(key).only(("xyz", "rpy", "matrix"))
    if given.has("matrix"):
        if given.has("xyz") or given.has("rpy"):
            raise given.refused("matrix", "is given beside xyz or rpy, expected one or the other.")
        return from_matrix(given.numbers("matrix", 4, 4), given.where("matrix"))
    return from_rpy(*(given.numbers(key, 3, default=(0, 0, 0)).tolist() for key in ("xyz", "rpy")))


def calibrated(camera: TomlTable, mounting: Array) -> Camera | None:
    """The camera of the file that `calibration` names, beside robot.toml; None without it."""
    if not camera.has("calibration"):
        return None
    named, home = camera.text("calibration"), Path(camera.file).parent
    name, _, which = (named, "", "") if (home / named).is_file() else named.partition("#")
    file = home / name
    if not file.is_file():
        raise camera.refused("calibration", f"there is no file {file}, expected a camera's calibration.")
    size = camera.numbers("size", 2) if camera.has("size") else None
    if size is not None and not all(side >= 1 and side == int(side) for side in size):
        raise camera.fault("size", "width and height in whole px")
    return read(file, mounting, None if size is None else (int(size[0]), int(size[1])), which or None)


def track_noise(odometry: TomlTable) -> TrackNoise:
    """The noise of integrated odometry."""
    noise: dict[str, Any] = numbers_in(odometry, TRACK, least=0)
    return TrackNoise(**noise, **floors_in(odometry))


def floors_in(table: TomlTable) -> dict[str, Any]:
    """The entry `floors`, if there is one, as an argument."""
    if not table.has("floors"):
        return {}
    given = table.table("floors").only(names_of(Floors))
    return {"floors": Floors(**numbers_in(given, names_of(Floors), above=0))}


def numbers_in(table: TomlTable, keys: Collection[str], **bounds: float) -> dict[str, Any]:
    """The given numbers among `keys`; the others keep the receiver's defaults."""
    return {key: table.number(key, **bounds) for key in keys if table.has(key)}


def names_of(cls: Any) -> tuple[str, ...]:
    """The names of a dataclass's fields."""
    return tuple(one.name for one in fields(cls))


def settings_in(table: TomlTable, cls: Any, home: Path) -> Any:
    """The settings of a front end, a dataclass of options, with what the table gives; files are in the folder `home`.

    InputError for a value out of its range, and for values that do not go together.
    """
    given = {one.name: _setting(table, one, home) for one in fields(cls) if table.has(one.name)}
    try:
        return cls(**given)
    except InputError as error:
        raise InputError(f"{table.where()}: {error}") from None


def without_none(words: dict[str, Any]) -> dict[str, Any]:
    """`words` without None and without empty tables, recursively."""
    kept = {key: without_none(value) if isinstance(value, dict) else value for key, value in words.items()}
    return {key: value for key, value in kept.items() if value is not None and value != {}}


def _setting(table: TomlTable, one: Field[Any], home: Path) -> Any:
    """The value of an option, within its range."""
    if one.metadata["choices"]:
        return table.choice(one.name, one.default, one.metadata["choices"])
    if one.default is None:
        return str(home / table.text(one.name))
    low, high = one.metadata["minimum"], one.metadata["maximum"]
    if isinstance(one.default, bool):
        return table.switch(one.name, one.default)
    if isinstance(one.default, int):
        return table.whole(one.name, one.default, int(low))
    value = table.number(one.name, least=low)
    if value > high:
        raise table.fault(one.name, f"a number from {low:g} to {high:g}")
    return value
