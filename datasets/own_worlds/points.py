"""Reads landmarks and way points from a file: CSV, columns of numbers, or Matlab's.

    CSV              a header that names x and y, and of landmarks perhaps id; m
    columns          x y, or id x y of landmarks, between blanks or commas, without a header
    .mat             the variables lm and wp, (2, n) or with ids in a third row, one point per column

The Matlab report's `ekfslam(lm, wp)` takes these two variables, and ids from the third row of lm.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.csv_values import number
from ...core.errors import InputError
from ...core.files import check_regular
from ...core.se2 import Array, Ints
from ...core.table import LARGEST, MOST, Table, read_spaced, text
from ..formats.columns import read_columns

LANDMARKS, WAY_POINTS = "lm", "wp"  # in a .mat file
MAT = ".mat"


class Points(NamedTuple):
    """Points and where they were read."""

    path: Path
    xy: Array  # (n, 2) m
    ids: Ints  # (n,)
    places: Sequence[str]  # (n,) "line 4"

    def fault(self, row: int, message: str) -> InputError:
        """The error `message` about a point."""
        return InputError(f"{self.path}, {self.places[row]}: {message}.")


def read_landmarks(path: Path) -> Points:
    """Reads landmarks, numbered from 0 where they have no ids; InputError names the file and the row."""
    found = _read(path, LANDMARKS, with_ids=True)
    _, first = np.unique(found.ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(found.ids)), first).tolist():
        raise found.fault(row, f"id {found.ids[row]} occurs twice, expected once")
    for row in np.flatnonzero(found.ids < 0).tolist():
        raise found.fault(row, f"id is {found.ids[row]}, expected 0 to {MOST}")
    return found


def read_way_points(path: Path) -> Points:
    """Reads two way points or more, each elsewhere than the one before; InputError names the file and the row."""
    found = _read(path, WAY_POINTS, with_ids=False)
    if len(found.xy) < 2:
        raise InputError(f"{path}: found {len(found.xy)} way point, expected at least two.")
    for row in (np.flatnonzero((np.diff(found.xy, axis=0) == 0).all(axis=1)) + 1).tolist():
        x, y = found.xy[row]
        raise found.fault(row, f"the way point {x:g}, {y:g} is that before it again, expected another place")
    return found


def _read(path: Path, variable: str, *, with_ids: bool) -> Points:
    if path.suffix.lower() == MAT:
        return _of_mat(path, variable, with_ids=with_ids)
    table = _table(path, with_ids=with_ids).finite().bounded(-LARGEST, LARGEST, "x", "y")
    ids = table.whole("id") if "id" in table.columns else np.arange(len(table.rows))
    xy = np.stack((table.column("x"), table.column("y")), axis=-1)
    return Points(path, xy, ids, [f"line {line}" for line in table.lines])


def _table(path: Path, *, with_ids: bool) -> Table:
    """The table of a file: by its header, or by the number of its columns where it has none."""
    named = [("id", "x", "y")] * with_ids + [("x", "y")]
    for line in text(path).split("\n"):
        cells = line.replace(",", " ").split()
        if cells and not cells[0].startswith("#"):
            if any(number(cell) is None for cell in cells):
                break
            return read_spaced(path, next((columns for columns in named if len(columns) == len(cells)), named[-1]))
    return read_columns(path, *named)


def _of_mat(path: Path, variable: str, *, with_ids: bool) -> Points:
    values = _variable(path, variable)
    rows = (2, 3) if with_ids else (2,)
    if values.ndim != 2 or values.shape[0] not in rows:
        shape = " x ".join(map(str, values.shape))
        raise InputError(
            f"{path}: {variable} is {shape}, expected {' x n or '.join(map(str, rows))} x n, one point per column."
        )
    if not values.size:
        raise InputError(f"{path}: {variable} is empty, expected at least one point.")
    places = [f"column {column} of {variable}" for column in range(1, values.shape[1] + 1)]
    found = Points(path, values[:2].T.copy(), np.arange(len(places)), places)
    for row, axis in np.argwhere(~(np.abs(found.xy) <= LARGEST)).tolist():
        raise found.fault(row, f"{'xy'[axis]} is {found.xy[row, axis]!s}, expected {-LARGEST:g} to {LARGEST:g}")
    if len(values) == 2:
        return found
    for row in np.flatnonzero(~((np.abs(values[2]) <= MOST) & (values[2] == np.rint(values[2])))).tolist():
        raise found.fault(row, f"id is {values[2, row]!s}, expected a whole number up to {MOST}")
    return found._replace(ids=values[2].astype(np.int64))


def _variable(path: Path, name: str) -> Array:
    """A variable of a .mat file, as real numbers."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    check_regular(path)
    if not path.exists():
        raise InputError(f"{path}: there is no such file.")
    try:
        found: dict[str, Any] = loadmat(path)
    except NotImplementedError:  # HDF5
        raise InputError(f"{path}: is a file of MATLAB 7.3, expected one written by save -v7.") from None
    except (MatReadError, ValueError, TypeError, EOFError, OverflowError, MemoryError) as error:
        raise InputError(f"{path}: is no file of MATLAB ({error}), expected one written by save -v7.") from None
    if name not in found:
        has = ", ".join(one for one in found if not one.startswith("__")) or "no variables"
        raise InputError(f"{path}: found {has}, expected the variable {name}.")
    values = np.asarray(found[name])
    if values.dtype.kind not in "iufb":
        raise InputError(f"{path}: {name} holds no real numbers, expected 2 x n of them.")
    return values.astype(np.float64)
