"""Laser scans beside a log in its folder, for maps and pictures: scans.npz, which backends never see.

ranges (k, b), angles (b,), scanner (3,)       m, NaN where there is no return; rad; the scanner's pose on the robot
step (k,), share (k,)                          the last step at or before the scan, and how much of the time to the
                                               next one has passed
since (k, 3), until (k, 3)                     the robot's pose at the scan seen from that step, and from the next one
"""

from pathlib import Path

import numpy as np

from ...frontend.errors import InputError
from ...frontend.files import read_arrays, replaced
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
    columns = read_arrays(path, COLUMNS, "scans")
    if problem := misfit(columns, steps):
        raise InputError(f"{path}: {problem}.")
    return scans_from(columns)
