"""Tables of cells as files, CSV and Parquet, written chunk by chunk and there whole or not at all."""

import contextlib
import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from ...frontend.errors import InputError
from ...frontend.files import beside


class TableFile(ABC):
    """A file in the making: rows go to a hidden place beside its own, and are gone if it is not published."""

    def __init__(self, path: Path, kinds: Mapping[str, str]) -> None:
        self.path = path
        self.kinds = kinds  # of the columns: TEXT, INTEGER, REAL or BOOLEAN
        self.part = beside(path)

    @abstractmethod
    def begin(self) -> None:
        """Open the part, and write what comes before the rows."""

    @abstractmethod
    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Add rows."""

    @abstractmethod
    def finish(self) -> None:
        """Write what comes after the rows, and close the part; it may be closed already."""

    def publish(self) -> None:
        """Put the part in its place."""
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
    """Numbers with as many digits as tell them from every other; a blank where there is none."""

    def begin(self) -> None:
        """Write the names of the columns."""
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
        """Nothing comes after the rows."""
        self._file.close()


class ParquetFile(TableFile):
    """By pyarrow; null where there is no value."""

    def begin(self) -> None:
        """InputError where pyarrow is not installed."""
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
        """Add rows, as a group."""
        columns = zip(zip(*rows, strict=True), self._schema.types, strict=True)
        arrays = [self._arrow.array(values, type=kind) for values, kind in columns]
        self._file.write_batch(self._arrow.RecordBatch.from_arrays(arrays, schema=self._schema))

    def finish(self) -> None:
        """Write the footer."""
        try:
            self._file.close()
        finally:
            self._part.close()
