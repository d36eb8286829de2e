"""The files that describe a robot, beside its recordings, and the recording that they name."""

from collections.abc import Sequence
from pathlib import Path

from ..core.errors import InputError

ROBOT, CALIBRATION = "robot.toml", "calibration.yaml"
SETTINGS = ("settings/default.yaml", "default.yaml")  # of the original ArUco EKF system


def robot_beside(path: Path) -> Path | None:
    """The robot.toml in the folder of a recording or beside it; None where there is none."""
    return next((one for one in (path / ROBOT, path.absolute().parent / ROBOT) if one.is_file()), None)


def settings_beside(path: Path) -> Path | None:
    """The original system's settings in the folder of a recording or beside it; None where there are none."""
    places = (folder / name for folder in (path, path.absolute().parent) for name in SETTINGS)
    return next((one for one in places if one.is_file()), None)


def is_settings(path: Path) -> bool:
    """Tells if a robot's file is one of the original system's settings, not a robot.toml."""
    return path.suffix.lower() in (".yaml", ".yml")


def file_of(path: Path, name: str) -> Path:
    """The file of one of several cameras beside those of the others: poses.csv is poses-left.csv of the left one."""
    return path.with_stem(f"{path.stem}-{name}") if name else path


def recording_in(
    path: Path, table: str, source: str | None, inside: Sequence[Path], kinds: str, usual: str = ""
) -> Path:
    """The recording in a folder that the table's `source` names, else the only one `inside`.

    InputError where that is missing, or where there is none of these `kinds`, of which `usual` is a file's name, or
    several.
    """
    if source is not None:
        if not (path / source).exists():
            raise InputError(f"{path}: there is no {path / source}, which is the [{table}] source in {ROBOT}.")
        return path / source
    if len(inside) != 1:
        found = f"found {', '.join(one.name for one in inside) or 'none'}, expected one recording: {kinds}"
        missing = f" {path / usual} is missing, where {ROBOT} has [{table}]." if usual and not inside else ""
        raise InputError(f"{path}: {found}. [{table}] source in {ROBOT} selects one.{missing}")
    return inside[0]
