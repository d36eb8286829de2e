"""Reads an occupancy grid to localise on: what `bench map` left in a folder, or a map of ROS.

    grid.npz              origin (2,), size, hits, through, x, y (n, m): the cells with what was hit in them
    NAME.yaml             image, resolution, origin, negate, occupied_thresh, free_thresh: map_server's, wiki.ros.org

Of a map of ROS it is known which cells are walls, but not where in them: 5 cm cells cost 2 cm of accuracy.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ..core.errors import InputError
from ..core.factors import Start
from ..core.files import read_arrays, replaced
from ..frontend.laser.recording import LaserRecording
from ..frontend.laser.settings import Settings
from ..frontend.maps.occupancy import FREE, UNKNOWN, WALL, Occupancy, of_states

NAME = "grid.npz"

SMALLEST, LARGEST = 0.005, 1.0  # m of a cell
FARTHEST = 1e8  # m of a grid's corner from its origin: UTM coordinates have 7 digits
OCCUPIED, FREE_BELOW = 0.65, 0.196  # map_server's thresholds, where the file has none


def localised(recording: LaserRecording, settings: Settings) -> LaserRecording:
    """The recording on the grid that its settings name; itself without one. InputError as `read_grid`."""
    if settings.grid is None:
        if settings.start != "known":
            raise InputError(f"option start={settings.start}: there is no grid to find it on, expected grid beside it.")
        return recording
    start: Start = "known" if settings.start == "known" else "unknown"
    return replace(recording, map=read_grid(Path(settings.grid)), start=start)


def grid_files(settings: Settings) -> list[Path]:
    """The files of the grid that the settings name."""
    if settings.grid is None:
        return []
    path = Path(settings.grid)
    if path.suffix.lower() not in (".yaml", ".yml"):
        return [path / NAME]
    try:
        return [path, _image(path, _words(path))]
    except InputError:
        return [path]


def write_cells(folder: Path, grid: Occupancy) -> None:
    """Writes grid.npz; OSError where that is impossible."""
    columns = {name: grid.cells[:, :, k] for k, name in enumerate(_COLUMNS)}
    with replaced(folder / NAME, ".npz") as part:
        np.savez_compressed(part, allow_pickle=False, origin=grid.origin, size=np.array(grid.size), **columns)


def read_grid(path: Path) -> Occupancy:
    """The grid at `path`; InputError names the file and what is wrong with it."""
    if path.suffix.lower() in (".yaml", ".yml"):
        return _of_ros(path)
    if not path.is_dir():
        raise InputError(
            f"{path}: there is no {'such folder' if not path.exists() else 'grid here'}, expected a folder of bench "
            "map, or the .yaml of a ROS map."
        )
    if not (path / NAME).is_file():
        inside = sorted(path.glob("*.yaml"))
        if len(inside) == 1:
            return _of_ros(inside[0])
        raise InputError(f"{path}: there is no {NAME}, expected a folder of bench map; bench map RESULTS writes them.")
    return _of_cells(path / NAME)


_COLUMNS = ("hits", "through", "x", "y")


def _of_cells(path: Path) -> Occupancy:
    found = read_arrays(path, ("origin", "size", *_COLUMNS), "a grid")
    shape = found["hits"].shape
    for name, wanted in (("origin", (2,)), ("size", ()), *((name, shape) for name in _COLUMNS)):
        if found[name].shape != wanted or found[name].dtype.kind != "f" or not np.isfinite(found[name]).all():
            kind = f"{found[name].dtype} of the shape {found[name].shape}"
            raise InputError(f"{path}: {name} is {kind}, expected finite numbers of {wanted}.")
    if np.abs(found["origin"]).max() > FARTHEST:
        raise InputError(f"{path}: origin is {found['origin'].tolist()}, expected metres, at most {FARTHEST:g}.")
    if len(shape) != 2 or not SMALLEST <= found["size"] <= LARGEST or (found["hits"] < 0).any():
        size = f"{found['size']:g} m"
        raise InputError(
            f"{path}: found cells of {size}, expected two-dimensional ones of {SMALLEST:g} to {LARGEST:g} m."
        )
    cells = np.ascontiguousarray(np.stack([found[name] for name in _COLUMNS], axis=-1), np.float32)
    return _with_walls(path, Occupancy(found["origin"].astype(np.float64), float(found["size"]), cells))


def _of_ros(path: Path) -> Occupancy:
    words = _words(path)
    image = _image(path, words)
    size = _number(path, words, "resolution", SMALLEST, LARGEST)
    origin = _there(path, words, "origin")
    if not isinstance(origin, list) or len(origin) != 3 or not all(_is_number(one) for one in origin):
        raise InputError(f"{path}: origin is {origin!r}, expected [x, y, yaw] in m and rad.")
    if max(abs(one) for one in origin[:2]) > FARTHEST:
        raise InputError(f"{path}: origin is {origin!r}, expected metres, at most {FARTHEST:g}.")
    if origin[2] != 0:
        raise InputError(f"{path}: origin is turned by {origin[2]!r} rad, expected a map that is not.")
    mode = words.get("mode", "trinary")
    if mode not in ("trinary", "scale"):
        raise InputError(f"{path}: mode is {mode!r}, expected trinary or scale.")
    occupied = _number(path, words, "occupied_thresh", 0.0, 1.0, OCCUPIED)
    free = _number(path, words, "free_thresh", 0.0, 1.0, FREE_BELOW)
    if free >= occupied:
        raise InputError(f"{path}: free_thresh is {free:g} and occupied_thresh {occupied:g}, expected it below.")
    pixels = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE) if image.is_file() else None
    if pixels is None:
        wrong = "is no picture that can be read" if image.is_file() else "is not there"
        raise InputError(f"{path}: image {image} {wrong}, expected that of the map.")
    value = pixels.astype(np.float64) / 255
    dark = value if words.get("negate", 0) else 1 - value
    states = np.where(dark > occupied, WALL, np.where(dark < free, FREE, UNKNOWN)).astype(np.uint8)
    corner = np.array(origin[:2], np.float64)
    return _with_walls(path, of_states(corner, size, np.ascontiguousarray(states[::-1].T)))


def _with_walls(path: Path, grid: Occupancy) -> Occupancy:
    if not (grid.states == WALL).any():
        raise InputError(f"{path}: has no wall, expected a map to localise on.")
    return grid


def _words(path: Path) -> dict[str, Any]:
    try:
        found = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}, expected the .yaml of a ROS map.") from None
    except (YAMLError, ValueError) as error:
        said = " ".join(str(error).split())[:100]
        raise InputError(f"{path}: is no YAML ({said}), expected that of a ROS map.") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: found no names with values, expected image, resolution and origin.")
    return found


def _image(path: Path, words: dict[str, Any]) -> Path:
    name = _there(path, words, "image")
    if not isinstance(name, str) or not name:
        raise InputError(f"{path}: image is {name!r}, expected the name of a picture.")
    return path.parent / name


def _there(path: Path, words: dict[str, Any], name: str, default: float | None = None) -> Any:
    if words.get(name, default) is None:
        raise InputError(f"{path}: has no {name}, expected image, resolution and origin, as map_server reads them.")
    return words.get(name, default)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _number(
    path: Path, words: dict[str, Any], name: str, least: float, most: float, default: float | None = None
) -> float:
    value = _there(path, words, name, default)
    if not _is_number(value) or not least <= value <= most:
        raise InputError(f"{path}: {name} is {value!r}, expected {least:g} to {most:g}.")
    return float(value)
