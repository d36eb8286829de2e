"""Exports the cells of a study or of a run as one table for other programs: one row per cell, with all its values.

Of a study its parameters come first, each in a column of its name; a measure that has the name of a parameter, as
`steps` may, is called `measured_steps` then. Of a run the columns are those of cells.csv and metrics.csv.
"""

import contextlib
import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from ...frontend.errors import InputError
from .schema import COLUMNS, FILE, KINDS, MORE
from .store import COLUMN_KINDS, Store
from .table_files import CsvFile, ParquetFile, TableFile

ROWS = 2_000
"""Of a table that are held at once."""

NAMES = {"dataset": "TEXT", "backend": "TEXT", "seed": "INTEGER"}
"""The parameters that the cells of every study have."""

INNER = ("place", "parameters", "log", "traceback")
"""Columns of the view that an exported table leaves out."""


class Cells(NamedTuple):
    """A table that is read as it goes along."""

    kinds: Mapping[str, str]  # every column, in order -> TEXT, INTEGER, REAL or BOOLEAN
    rows: Iterator[Sequence[Any]]


def holds_cells(folder: Path) -> bool:
    """Whether it is the folder of a study or of a run."""
    return (folder / FILE).is_file()


def export_cells(folder: Path, csv: Path | None, parquet: Path | None) -> list[tuple[Path, str]]:
    """Write the cells of the study or run in `folder`, all files or none; the files with what is in them.

    InputError where a file cannot be written, or the cells not be read.
    """
    wanted = [(made, path) for made, path in ((CsvFile, csv), (ParquetFile, parquet)) if path is not None]
    for _, path in wanted:
        if path.is_dir() or path.name.startswith(FILE):  # with what SQLite keeps beside them
            raise InputError(f"{path}: is {'a folder' if path.is_dir() else 'a record'}, expected a file to be made.")
    if csv is not None and parquet is not None and csv.absolute() == parquet.absolute():
        raise InputError(f"--csv and --parquet: found {csv} for both, expected a file each.")
    with _opened(folder) as cells:
        try:
            count = _written([made(path, cells.kinds) for made, path in wanted], cells.rows)
        except OSError as error:
            paths = " and ".join(str(path) for _, path in wanted)
            raise InputError(f"{paths}: cannot be written ({error.strerror or error}).") from error
        return [(path, f"{count:,} cells, {len(cells.kinds)} columns") for _, path in wanted]


def _written(files: Sequence[TableFile], rows: Iterator[Sequence[Any]]) -> int:
    """How many rows there were; no file is in its place before all are whole."""
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
    """Of a parameter that has these values."""
    types = {type(value) for value in values} - {type(None)}
    for among, found in (({bool}, "BOOLEAN"), ({int}, "INTEGER"), ({int, float}, "REAL")):
        if types and types <= among:
            return found
    return "TEXT"


def _spelt(value: Any, kind: str) -> Any:
    """As its column takes it: beside words, numbers are words as a study file has them."""
    return value if value is None or kind != "TEXT" or isinstance(value, str) else json.dumps(value)
