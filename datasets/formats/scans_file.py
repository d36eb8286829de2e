"""Laser scans beside a log in its folder, for maps and pictures: scans.npz, which backends never see.

ranges (k, b), angles (b,), scanner (3,)       m, NaN where there is no return; rad; the scanner's pose on the robot
step (k,), share (k,)                          the last step at or before the scan, and how much of the time to the
                                               next one has passed
since (k, 3), until (k, 3)                     the robot's pose at the scan seen from that step, and from the next one
"""

import zipfile
from pathlib import Path

import numpy as np

from ...frontend.errors import InputError
from ...frontend.files import replaced
from ...frontend.laser_scans import COLUMNS, Scans, misfit, scan_columns, scans_from

NAME = "scans.npz"


def write_scans(folder: Path, scans: Scans) -> None:
    """Writes them to `folder`; OSError where that is impossible."""
    with replaced(folder / NAME, ".npz") as part:
        np.savez_compressed(part, allow_pickle=False, **scan_columns(scans))


def read_scans(folder: Path, steps: int) -> Scans | None:
    """The scans of the log of that many steps in `folder`; None without a file of them.

    InputError for one that is damaged or of another log.
    """
    path = folder / NAME
    if not path.exists():
        return None
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            columns = {name: np.asarray(file[name]) for name in COLUMNS}
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]}, expected {', '.join(COLUMNS)}.") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError) as error:
        said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise InputError(f"{path}: is damaged or no file of scans ({said}).") from None
    if problem := misfit(columns, steps):
        raise InputError(f"{path}: {problem}.")
    return scans_from(columns)
