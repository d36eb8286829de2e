"""Measurements beside a log in its folder, for maps and pictures, which backends never see: scans.npz or clouds.npz.

Both have of each of their k scans or clouds

    step (k,), share (k,)          the last step at or before it, and how much of the time to the next one has passed
    since (k, 3), until (k, 3)     the robot's pose then, seen from that step and from the next one: m, m, rad

Laser scans:

    ranges (k, b), angles (b,)     m, NaN where there is no return; rad, of each scan (k, b) where they vary
    scanner (3,)                   the scanner's pose on the robot

Clouds of a depth camera, levelled and in the robot's frame on the floor:

    first (k + 1,)                 the points of cloud k are the rows first[k] to first[k + 1]
    points (n, 3) int16            5 mm: ahead, left, and up from the floor
    colours (n, 3) uint8           red, green, blue
    camera (3,)                    the camera's place on the robot, m
"""

from pathlib import Path
from typing import Any

import numpy as np

from ...core.beside import KINDS, columns_of, misfit, names, restored
from ...core.errors import InputError
from ...core.factors import Log
from ...core.files import read_arrays, replaced

FILES = {kind: f"{kind}.npz" for kind in KINDS}  # names of the files by the field of a log


def write_beside(folder: Path, log: Log) -> None:
    """Writes what lies beside the log to `folder`; OSError where that is impossible."""
    for kind, name in FILES.items():
        found = getattr(log, kind)
        if found is not None:
            with replaced(folder / name, ".npz") as part:
                np.savez_compressed(part, allow_pickle=False, **columns_of(kind, found))


def read_beside(folder: Path, kind: str, steps: int) -> Any:
    """The scans or clouds of the log of that many steps in `folder`; None without a file of them.

    InputError for one that is damaged or of another log.
    """
    path = folder / FILES[kind]
    if not path.exists():
        return None
    columns = read_arrays(path, names(kind), kind)
    if problem := misfit(kind, columns, steps):
        raise InputError(f"{path}: {problem}.")
    return restored(kind, columns)
