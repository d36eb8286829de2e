"""Compares the files of a results folder with its record, from which all of them are made."""

import csv
import math
import tempfile
from pathlib import Path

from ...core.errors import InputError
from ..record.files import export
from ..record.schema import FILE
from ..record.store import Store
from ..words.numerals import counted
from .folder import HOLDS, OPEN, Finding, faults

ROUNDING = 1e-9
"""Share by which numbers may differ: those that are computed while the files are written, on another processor."""


def check_files(folder: Path) -> list[Finding]:
    """Checks that every file is there and says what the record says."""
    if not (folder / FILE).is_file():
        return faults("files", [f"{FILE} is missing: the record that all other files are made from."])
    wrong: list[str] = []
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        try:
            with Store(folder) as store:
                export(store, Path(scratch))
                ended, planned = sum(1 for _ in store.cells()), len(store.planned())
        except InputError as error:
            return faults("files", [str(error)])
        for expected in sorted(path for path in Path(scratch).rglob("*") if path.is_file()):
            name = expected.relative_to(scratch)
            if not (folder / name).is_file():
                wrong.append(f"{name.as_posix()} is missing.")
            elif said := _difference((folder / name).read_bytes(), expected.read_bytes(), table=name.suffix == ".csv"):
                wrong.append(f"{name.as_posix()}{said}")
    found = faults("files", wrong)
    if not wrong:
        said = f"Every file is there and says what {FILE} says: {counted(ended, 'cell')}."
        found.append(Finding("files", HOLDS, said))
    if ended < planned:
        found.append(Finding("files", OPEN, f"{counted(planned - ended, 'cell')} of {planned} have not been run."))
    return found


def _difference(found: bytes, wanted: bytes, *, table: bool) -> str:
    """Names the first line that differs, in a table the value; columns that this version adds do not count."""
    if found == wanted:
        return ""
    try:
        lines, known_lines = found.decode().splitlines(), wanted.decode().splitlines()
    except UnicodeDecodeError:
        return ": is no text, expected UTF-8."
    rows, known = ([*csv.reader(text)] if table else [line.split() for line in text] for text in (lines, known_lines))
    if table and rows and known:
        blank = [k for k, values in enumerate(zip(*known, strict=True)) if not any(values[1:])]
        added = [k for k in blank if known[0][k] not in rows[0]]
        known = [[value for k, value in enumerate(row) if k not in added] for row in known]
    for number, (row, expected) in enumerate(zip(rows, known, strict=False), 1):
        if len(row) == len(expected) and all(map(_same, row, expected)):
            continue
        if table and number > 1 and len(row) == len(expected):
            name, value, right = next(one for one in zip(known[0], row, expected, strict=True) if not _same(*one[1:]))
            return f", line {number}: {name} is {value or 'blank'}, the record has {right or 'none'}."
        return f", line {number}: found {lines[number - 1][:80]!r}, the record has {known_lines[number - 1][:80]!r}."
    return f": has {counted(len(rows), 'line')}, the record {len(known)}." if len(rows) != len(known) else ""


def _same(one: str, other: str) -> bool:
    try:
        return one == other or math.isclose(float(one), float(other), rel_tol=ROUNDING)
    except ValueError:
        return False
