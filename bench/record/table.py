"""Exports the cells of a study or of a run as a table for other programs: one row per cell.

A study's parameters come first, each in a column of its name; a measure with the name of a parameter, as `steps` may
have, is then called `measured_steps`. A run's columns are those of cells.csv and metrics.csv.
"""

import contextlib
import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from ..words.numerals import counted
from .cell_table import COLUMN_KINDS
from .schema import COLUMNS, FILE, KINDS, MORE
from .store import Store
from .table_files import CsvFile, ParquetFile, TableFile

ROWS = 2_000  # rows of a table that are held at once
NAMES = {"dataset": "TEXT", "backend": "TEXT", "seed": "INTEGER"}  # the parameters of every study's cells
INNER = ("place", "parameters", "log", "traceback")  # columns of the view that an exported table leaves out


class Cells(NamedTuple):
    """A table that is read row by row."""

    kinds: Mapping[str, str]  # every column, in order -> TEXT, INTEGER, REAL or BOOLEAN
    rows: Iterator[Sequence[Any]]


def holds_cells(folder: Path) -> bool:
    """True for the folder of a study or of a run."""
    return (folder / FILE).is_file()


def export_cells(folder: Path, csv: Path | None, parquet: Path | None) -> list[tuple[Path, str]]:
    """Writes a folder's cells, all files or none; returns each with its content. InputError where impossible."""
    wanted = [(made, path) for made, path in ((CsvFile, csv), (ParquetFile, parquet)) if path is not None]
    for made, path in wanted:
        if path.is_dir() or path.name.startswith(FILE):  # with what SQLite keeps beside them
            raise InputError(f"{path}: is {'a folder' if path.is_dir() else 'a record'}, expected a file to be made.")
        if path.is_file() and not made.is_one(path):
            raise InputError(
                f"{path}: exists and is no table of cells, expected a new file, or one of an earlier export."
            )
    if csv is not None and parquet is not None and csv.absolute() == parquet.absolute():
        raise InputError(f"--csv and --parquet: found {csv} for both, expected a file each.")
    with _opened(folder) as cells:
        try:
            count = _written([made(path, cells.kinds) for made, path in wanted], cells.rows)
        except OSError as error:
            paths = " and ".join(str(path) for _, path in wanted)
            raise InputError(f"{paths}: cannot be written ({error.strerror or error}).") from error
        return [(path, f"{counted(count, 'cell')}, {len(cells.kinds)} columns") for _, path in wanted]


def _written(files: Sequence[TableFile], rows: Iterator[Sequence[Any]]) -> int:
    """Writes the rows to all files and counts them; no file is replaced before all are complete."""
    count = 0
    with contextlib.ExitStack() as stack:
        for file in files:
            stack.enter_context(file)
        while chunk := list(islice(rows, ROWS)):
            count += len(chunk)
            for file in files:
                file.write(chunk)
        for file in files:
            file.finish()
        for file in files:
            file.publish()
    return count


@contextlib.contextmanager
def _opened(folder: Path) -> Generator[Cells]:
    with Store(folder) as store:
        if store.about().get("kind") == "study":
            yield _of_study(store)
        else:
            names = (*COLUMNS, *MORE)
            rows = ([row.columns[name] for name in names] for row in store.cells())
            yield Cells({name: KINDS[name] for name in names}, rows)


def _of_study(store: Store) -> Cells:
    names, sets, rows = store.view()
    swept = dict.fromkeys(name for found in sets.values() for name in found if name not in NAMES)
    parameters = dict(NAMES) | {name: _kind([found.get(name) for found in sets.values()]) for name in swept}
    spelt = {text: [_spelt(found.get(name), parameters[name]) for name in swept] for text, found in sets.items()}
    at = names.index("parameters")
    others = [k for k, name in enumerate(names) if name not in (*NAMES, *INNER)]
    kinds = parameters | {
        f"measured_{names[k]}" if names[k] in parameters else names[k]: COLUMN_KINDS.get(names[k], "TEXT")
        for k in others
    }
    seed = names.index("seed")
    values = (
        [sets[row[at]]["dataset"], sets[row[at]]["backend"], row[seed], *spelt[row[at]], *(row[k] for k in others)]
        for row in rows
    )
    return Cells(kinds, values)


def _kind(values: Sequence[Any]) -> str:
    types = {type(value) for value in values} - {type(None)}
    for among, found in (({bool}, "BOOLEAN"), ({int}, "INTEGER"), ({int, float}, "REAL")):
        if types and types <= among:
            return found
    return "TEXT"


def _spelt(value: Any, kind: str) -> Any:
    """Converts a value for its column: in one of texts, numbers are written as a study file has them."""
    return value if value is None or kind != "TEXT" or isinstance(value, str) else json.dumps(value)
