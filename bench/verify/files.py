"""Compares the files of a results folder with its record, from which all of them are made."""

import csv
import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ..record.files import export
from ..record.schema import FILE, KEY, label
from ..record.store import Store
from ..words.numerals import counted
from .finding import FAILS, HOLDS, OPEN, Finding

ROUNDING = 1e-9
"""Share by which numbers may differ: those that are computed while the files are written, on another processor."""

NAMED = 8  # differences that are named; of more, their number


def check_files(folder: Path) -> list[Finding]:
    """Checks that every file is there and says what the record says."""
    if not (folder / FILE).is_file():
        return [Finding("files", FAILS, f"{FILE} is missing: the record that all other files are made from.")]
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        try:
            with Store(folder) as store:
                export(store, Path(scratch))
                ended, planned = sum(1 for _ in store.cells()), len(store.planned())
        except InputError as error:
            return [Finding("files", FAILS, str(error))]
        found = list(_compared(folder, Path(scratch)))
    wrong = [Finding("files", FAILS, sentence) for verdict, sentence in found if verdict == FAILS]
    if len(wrong) > NAMED:
        more = Finding(
            "files", FAILS, f"{counted(len(wrong) - NAMED, 'more file')} of its files differ or are missing."
        )
        wrong = [*wrong[:NAMED], more]
    wrong += [Finding("files", OPEN, sentence) for verdict, sentence in found if verdict == OPEN]
    if ended < planned:
        wrong.append(Finding("files", OPEN, f"{counted(planned - ended, 'cell')} of {planned} have not been run."))
    if any(one.verdict == FAILS for one in wrong):
        return wrong
    return [
        Finding("files", HOLDS, f"Every file is there and says what {FILE} says: {counted(ended, 'cell')}."),
        *wrong,
    ]


def _compared(folder: Path, made: Path) -> Iterator[tuple[str, str]]:
    """Yields verdict and sentence for each file of the record, `made`, that is missing in `folder` or differs."""
    for expected in sorted(path for path in made.rglob("*") if path.is_file()):
        name = expected.relative_to(made).as_posix()
        path = folder / name
        if not path.is_file():
            yield FAILS, f"{name} is missing."
            continue
        found, wanted = path.read_bytes(), expected.read_bytes()
        if found == wanted:
            continue
        try:
            texts = found.decode(), wanted.decode()
        except UnicodeDecodeError:
            yield FAILS, f"{name}: is no text, expected UTF-8."
            continue
        compare = {".json": _json, ".csv": _table}.get(path.suffix, _lines)
        yield from ((verdict, f"{name}{said}") for verdict, said in compare(*texts))


def _json(found: str, wanted: str) -> Iterator[tuple[str, str]]:
    """Names the first fact that differs."""
    try:
        told: Any = json.loads(found)
    except ValueError:
        yield FAILS, ": is not JSON."
        return
    known = json.loads(wanted)
    if not isinstance(told, dict):
        yield FAILS, ": has no facts by name."
        return
    for name in dict.fromkeys((*known, *told)):
        if known.get(name) != told.get(name):
            yield FAILS, f": {name} is not what the record says."
            return


def _table(found: str, wanted: str) -> Iterator[tuple[str, str]]:
    """Names the first value of a table that differs; columns that this version adds do not count."""
    (top, *rows), (known_top, *known_rows) = (list(csv.reader(text.splitlines())) or [[]] for text in (found, wanted))
    lacking = [name for name in known_top if name not in top]
    if strange := [name for name in top if name not in known_top]:
        yield FAILS, f": has a column {strange[0]} that the record has not."
        return
    if lacking and any(row[known_top.index(name)] for row in known_rows for name in lacking):
        yield FAILS, f": has no column {lacking[0]}."
        return
    if len(rows) != len(known_rows):
        yield FAILS, f": has {counted(len(rows), 'row')}, the record {len(known_rows)}."
        return
    places = [known_top.index(name) for name in top]
    for number, (row, known) in enumerate(zip(rows, known_rows, strict=True), 2):
        if len(row) != len(top):
            yield FAILS, f", row {number}: has {counted(len(row), 'value')}, expected {len(top)}."
            return
        for name, value, place in zip(top, row, places, strict=True):
            if not _same(value, known[place]):
                of = _cell_of(known_top, known)
                yield (
                    FAILS,
                    f", row {number}{of}: {name} is {value or 'blank'}, the record has {known[place] or 'none'}.",
                )
                return
    if lacking:
        yield OPEN, f": was written by a version without the columns {', '.join(lacking)}."


def _cell_of(top: list[str], row: list[str]) -> str:
    if not set(KEY) <= set(top):
        return ""
    dataset, options, backend, more, seed = (row[top.index(name)] for name in KEY)
    return f" ({label(dataset, options)}, {label(backend, more)}, seed {seed})"


def _lines(found: str, wanted: str) -> Iterator[tuple[str, str]]:
    """Names the first line of a path that differs."""
    rows, known = found.splitlines(), wanted.splitlines()
    for number, (row, wanted_row) in enumerate(zip(rows, known, strict=False), 1):
        values, expected = row.split(), wanted_row.split()
        if len(values) != len(expected) or not all(map(_same, values, expected)):
            yield FAILS, f", line {number}: found {row[:80]!r}, the record has {wanted_row[:80]!r}."
            return
    if len(rows) != len(known):
        yield FAILS, f": has {counted(len(rows), 'line')}, the record {len(known)}."


def _same(one: str, other: str) -> bool:
    if one == other:
        return True
    try:
        return math.isclose(float(one), float(other), rel_tol=ROUNDING)
    except ValueError:
        return False
