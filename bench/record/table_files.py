"""Writes tables as CSV and Parquet, chunk by chunk; a file is replaced as a whole or not at all."""

import contextlib
import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

from ...core.errors import InputError
from ...core.files import beside


class TableFile(ABC):
    """A table file being written: rows go to a hidden part file, removed unless it is published."""

    start: ClassVar[bytes]  # of every such file

    def __init__(self, path: Path, kinds: Mapping[str, str]) -> None:
        self.path = path
        self.kinds = kinds  # of the columns: TEXT, INTEGER, REAL or BOOLEAN
        self.part = beside(path)

    @classmethod
    def is_one(cls, path: Path) -> bool:
        """True for a file that an earlier export may have written, or that is empty."""
        with path.open("rb") as file:
            found = file.read(len(cls.start))
        return found in (b"", cls.start)

    @abstractmethod
    def begin(self) -> None:
        """Opens the part file and writes what comes before the rows."""

    @abstractmethod
    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Add rows."""

    @abstractmethod
    def finish(self) -> None:
        """Writes what comes after the rows and closes the part file; it may be closed already."""

    def publish(self) -> None:
        """Replaces the file by the part file."""
        os.replace(self.part, self.path)

    def __enter__(self) -> Self:
        try:
            self.begin()
        except BaseException:
            self.part.unlink(missing_ok=True)
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):  # on a full disk it cannot even be closed
            self.finish()
        with contextlib.suppress(OSError):
            self.part.unlink(missing_ok=True)


class CsvFile(TableFile):
    """CSV: floats round-trip; blank where there is no value."""

    start = b"dataset,"  # the first column of every table of cells

    def begin(self) -> None:
        """Writes the names of the columns."""
        self._switches = [k for k, kind in enumerate(self.kinds.values()) if kind == "BOOLEAN"]
        self._file = self.part.open("w", encoding="utf-8", newline="")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow(self.kinds)

    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Add rows."""
        for row in rows:
            values = list(row)
            for k in self._switches:
                values[k] = None if row[k] is None else str(row[k]).lower()
            self._writer.writerow(values)

    def finish(self) -> None:
        """Closes the file."""
        self._file.close()


class ParquetFile(TableFile):
    """Parquet, by pyarrow; null where there is no value."""

    start = b"PAR1"

    def begin(self) -> None:
        """Opens the file; InputError where pyarrow is not installed."""
        try:
            import pyarrow as arrow
            from pyarrow import parquet
        except ImportError:
            raise InputError(
                f"--parquet {self.path}: expected pyarrow to be installed, as slamduel[parquet] does, or --csv."
            ) from None
        types = {"TEXT": arrow.string(), "INTEGER": arrow.int64(), "REAL": arrow.float64(), "BOOLEAN": arrow.bool_()}
        self._arrow: Any = arrow
        self._schema: Any = arrow.schema([(name, types[kind]) for name, kind in self.kinds.items()])
        self._part = self.part.open("wb")
        self._file: Any = parquet.ParquetWriter(self._part, self._schema)

    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Adds rows, as a group."""
        columns = zip(zip(*rows, strict=True), self._schema.types, strict=True)
        arrays = [self._arrow.array(values, type=kind) for values, kind in columns]
        self._file.write_batch(self._arrow.RecordBatch.from_arrays(arrays, schema=self._schema))

    def finish(self) -> None:
        """Writes the footer."""
        try:
            self._file.close()
        finally:
            self._part.close()
