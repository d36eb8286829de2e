"""Text logs whose rows begin with a keyword: a motion opens a step, and the sightings below it belong to that step."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.csv_values import no_number, number, shortened
from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import LARGEST, MOST, text

Flags = NDArray[np.bool_]

_SHARE = 1e-9
"""Share of a covariance's largest eigenvalue below which the smallest counts as singular."""

FLOOR = 1e-8  # the variance added to a singular covariance: 0.1 mm or 0.1 mrad

FLOORED = (
    f"a singular one is given {FLOOR:g} m^2 and rad^2 on its diagonal, or {2 * _SHARE:g} of its largest eigenvalue"
)
"""Describes `definite` in the notes of a log."""


class FileRow(NamedTuple):
    """A line of the file that is neither blank nor a comment."""

    path: Path
    line: int  # counted from 1
    word: str
    cells: list[str]

    def fault(self, message: str) -> InputError:
        """The error `message` about this row."""
        return InputError(f"{self.path}, line {self.line}: {message}.")

    def numbers(self, columns: Sequence[str], cells: Sequence[str]) -> list[float]:
        """`cells`, as many as `columns`, as finite numbers."""
        self.check_count(columns, cells)
        return [self._number(*pair) for pair in zip(columns, cells, strict=True)]

    def check_count(self, columns: Sequence[str], cells: Sequence[str]) -> None:
        """Raises InputError unless there are as many `cells` as `columns`."""
        if len(cells) != len(columns):
            wanted = f"{len(columns)} ({' '.join(columns)})"
            raise self.fault(f"found {len(cells)} numbers after {self.word}, expected {wanted}")

    def identity(self, cell: str, least: int) -> int:
        """Parses `cell` as the id of a landmark, from `least` on."""
        digits = cell.removeprefix("-")
        found = int(cell) if digits.isascii() and digits.isdigit() and len(digits) <= len(str(MOST)) else least - 1
        if not least <= found <= MOST:
            raise self.fault(f"id is {shortened(cell)}, expected a whole number from {least} to {MOST}")
        return found

    def _number(self, column: str, cell: str) -> float:
        found = number(cell)
        if found is None:
            raise self.fault(f"{column} {no_number(cell)}")
        if not abs(found) <= LARGEST:
            raise self.fault(f"{column} is {shortened(cell)}, expected a number no larger than {LARGEST:g}")
        return found


def read_rows(path: Path) -> Iterator[FileRow]:
    """Yields the rows of `path` in order; InputError if it is missing, empty or not text."""
    for line, content in enumerate(text(path).split("\n"), start=1):
        word, *cells = content.split() or [""]
        if word and not word.startswith("#"):
            yield FileRow(path, line, word, cells)


def definite(cov: Array, rows: Sequence[FileRow]) -> tuple[Array, int]:
    """`cov` (m, k, k), one per row, with FLOOR added to the diagonal of singular ones, and the number of these.

    The floor is at least a billionth of the covariance's largest eigenvalue, to leave significant digits. InputError
    for a matrix whose smallest eigenvalue is negative by more than rounding.
    """
    if not len(cov):
        return cov, 0
    values = np.linalg.eigvalsh(cov)
    least, most = values[:, 0], values[:, -1]
    for k in np.flatnonzero(least < -_SHARE * most).tolist():
        found = f"the covariance's smallest eigenvalue is {least[k]:.6g}, its largest {most[k]:.6g}"
        raise rows[k].fault(f"{found}, expected none below 0")
    singular = least <= _SHARE * most
    floor = np.where(singular, np.maximum(FLOOR, 2 * _SHARE * most), 0.0)
    return cov + floor[:, None, None] * np.eye(cov.shape[-1]), int(singular.sum())
