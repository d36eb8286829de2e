"""Atomic file writes, tables as text, files that can be read to their end, and arrays in files."""

import contextlib
import csv
import io
import os
import secrets
from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryFile, gettempdir
from typing import IO, Any
from weakref import finalize

import numpy as np
import platformdirs
from numpy.typing import DTypeLike, NDArray

from .errors import InputError

BLOCK = 10_000  # rows that are text at once


def write_whole(path: Path, content: str | bytes) -> None:
    """Put `content` in the file at `path`, a reader sees what was there before or the new, never a part."""
    with replaced(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """The text of a CSV file, one line per row; None is blank."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((header, *rows))
    return text.getvalue()


def number_rows(columns: Sequence[NDArray[Any]], between: str = ",", before: str = "") -> Iterator[str]:
    """Yields the lines of `columns` (n,) each, many in a text: `before`, then the numbers with `between` them.

    Floats read back bit for bit; NaN, and what is masked, is blank.
    """
    for first in range(0, len(columns[0]), BLOCK):
        texts = [_texts(column[first : first + BLOCK]) for column in columns]
        yield "".join([f"{before}{row}\n" for row in map(between.join, zip(*texts, strict=True))])


def _texts(numbers: NDArray[Any]) -> Sequence[str]:
    masked = np.ma.getmaskarray(numbers)
    unknown = masked | np.isnan(numbers) if numbers.dtype.kind == "f" else masked
    if unknown.all():
        return [""] * len(numbers)
    texts = list(map(repr, np.ma.getdata(numbers).tolist()))
    for row in np.flatnonzero(unknown).tolist():
        texts[row] = ""
    return texts


@contextlib.contextmanager
def replaced(path: Path, suffix: str = "") -> Generator[Path]:
    """Yields a hidden place next to `path`, whose file replaces that at `path` at the end."""
    part = beside(path)
    part = part.with_name(part.name + suffix)
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        error.filename = error.filename or str(path)  # a full disk names no file
        raise
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def beside(path: Path) -> Path:
    """A hidden temporary path next to `path`, unique to the caller."""
    whole = path.absolute()
    return whole.with_name(f".{whole.name[:40]}.{secrets.token_hex(8)}.part")


def cache_folder() -> Path:
    """The user's cache folder, which the environment variable SLAMDUEL_CACHE moves; it may not exist yet."""
    return Path(os.environ.get("SLAMDUEL_CACHE") or platformdirs.user_cache_path("slamduel"))


def read_arrays(path: Path, names: Sequence[str], what: str) -> dict[str, NDArray[Any]]:
    """The arrays with these names in an .npz file; InputError where it is damaged, or no file of `what`."""
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in names}
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]}, expected {', '.join(names)}.") from None
    except Exception as error:  # a damaged zip file raises almost any exception
        said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise InputError(f"{path}: is damaged or no file of {what} ({said}).") from None


def check_regular(path: Path) -> None:
    """Raises InputError for a pipe or a device, whose reading may never end; passes what is not there."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is a pipe or a device, expected a regular file.")


class Rows:
    """Rows of an array in a file without a name of the temporary folder, not in memory.

    OSError, with the folder's name, where there is no room for them.
    """

    def __init__(self, kind: DTypeLike, *shape: int) -> None:
        """For rows of a `shape`, none for numbers or records."""
        self._kind, self._shape, self._count = np.dtype(kind), shape, 0
        self._file = TemporaryFile()  # noqa: SIM115 - open as long as this is
        finalize(self, _close, self._file)

    def add(self, rows: NDArray[Any]) -> None:
        """Appends rows (k, ...)."""
        try:
            self._file.write(np.ascontiguousarray(rows, self._kind).tobytes())
            self._file.flush()
        except OSError as error:
            error.filename = error.filename or gettempdir()  # a full disk names no file
            raise
        self._count += len(rows)

    def all(self) -> NDArray[Any]:
        """All rows (n, ...) so far, read from the file as they are asked for."""
        shape = self._count, *self._shape
        if not self._count:  # an empty file cannot be mapped
            return np.zeros(shape, self._kind)
        return np.asarray(np.memmap(self._file, self._kind, "c", shape=shape))


def _close(file: IO[bytes]) -> None:
    """Closes a file that nobody reads any more, and so may lack what a full disk had no room for."""
    with contextlib.suppress(OSError):
        file.close()
