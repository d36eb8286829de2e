"""Mutated records of a run: each read again by bench report, compare and replay, in one sentence or with output."""

import contextlib
import io
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slamduel.bench.cli import main
from slamduel.bench.record.schema import FILE, packed, unpacked
from slamduel.bench.record.store import Store
from slamduel.bench.verdict.changes import QUANTITIES
from slamduel.core.errors import InputError
from slamduel.datasets.formats import log_folder
from small_run import go

from .ending import Ended
from .random_drive import random_drive

BACKENDS = "dead-reckoning,ekf"
TABLES = ("about", "logs", "results", "arrays", "plan")
VALUES: tuple[Any, ...] = (
    None, "", "a text", "\x1b[31m<b>", -1, 0, 1.5, 1e308, float("inf"), -1e308, 5e-324, 2**62, b"\xff\xfe", b"",
    "[]", "{}", "null", '{"a": 1}', "truth", "done",
)  # fmt: skip
COMPARED = ("dataset", "backend", "seed", "status", "digest", *(quantity.column for quantity in QUANTITIES))

ORDER = ("same", "remarked", "refused", "worse", "crashed")

Change = Callable[[Path, np.random.Generator], str]


def _bytes(folder: Path, rng: np.random.Generator) -> str:
    path = folder / FILE
    content = bytearray(path.read_bytes())
    for place in rng.integers(100 if rng.random() < 0.9 else 0, len(content), size=rng.integers(1, 20)):
        content[place] ^= 1 << int(rng.integers(8))
    path.write_bytes(content)
    return "bytes flipped"


def _cut(folder: Path, rng: np.random.Generator) -> str:
    path = folder / FILE
    path.write_bytes(path.read_bytes()[: rng.integers(path.stat().st_size)])
    return "cut off"


def _zeroed(folder: Path, rng: np.random.Generator) -> str:
    """A page of zeros, as a disk that lost one leaves it."""
    path = folder / FILE
    content = bytearray(path.read_bytes())
    first = 4096 * int(rng.integers(1, len(content) // 4096))
    content[first : first + 4096] = bytes(4096)
    path.write_bytes(content)
    return "a page of zeros"


def _opened(folder: Path) -> contextlib.closing[sqlite3.Connection]:
    return contextlib.closing(sqlite3.connect(folder / FILE, isolation_level=None))


def _told(kind: str, sentence: str) -> Change:
    """A statement about a table."""

    def change(folder: Path, rng: np.random.Generator) -> str:
        name = str(rng.choice(TABLES))
        with _opened(folder) as db:
            db.execute(sentence.format(name))
        return kind.format(name)

    return change


_table_gone = _told("no table {}", "DROP TABLE {}")
_view_gone = _told("no view", "DROP VIEW cells")
_table_empty = _told("{} empty", "DELETE FROM {}")
_row_gone = _told(
    "{0} without a row", "DELETE FROM {0} WHERE rowid = (SELECT rowid FROM {0} ORDER BY random() LIMIT 1)"
)


def _column_gone(folder: Path, rng: np.random.Generator) -> str:
    name = str(rng.choice(TABLES))
    with _opened(folder) as db:
        columns = [row[1] for row in db.execute(f"PRAGMA table_info({name})") if not row[5]]
        view = db.execute("SELECT sql FROM sqlite_master WHERE name = 'cells'").fetchone()[0]
        column = str(rng.choice(columns))
        db.execute("DROP VIEW cells")
        db.execute(f"ALTER TABLE {name} DROP COLUMN {column}")
        with contextlib.suppress(sqlite3.Error):
            db.execute(view)
    return f"{name} without a column"


def _value(folder: Path, rng: np.random.Generator) -> str:
    name = str(rng.choice(TABLES))
    with _opened(folder) as db:
        column = str(rng.choice([row[1] for row in db.execute(f"PRAGMA table_info({name})")]))
        rows = [row[0] for row in db.execute(f"SELECT rowid FROM {name}")]
        with contextlib.suppress(sqlite3.IntegrityError):
            value = VALUES[rng.integers(len(VALUES))]
            db.execute(f"UPDATE {name} SET {column} = ? WHERE rowid = ?", (value, int(rng.choice(rows))))
    return f"{name}: another value"


def _number(folder: Path, rng: np.random.Generator) -> str:
    """One number of a result a little off."""
    column = str(rng.choice([quantity.column for quantity in QUANTITIES]))
    with _opened(folder) as db:
        db.execute(f"UPDATE results SET {column} = {column} * 1.0000001 WHERE rowid = 2")
    return "results: a number a little off"


def _arrays(folder: Path, rng: np.random.Generator) -> str:
    with _opened(folder) as db:
        kept = dict(db.execute("SELECT key, archive FROM arrays"))
        key = str(rng.choice(sorted(kept)))
        arrays = unpacked(kept[key])
        name = str(rng.choice(sorted(arrays)))
        changes: list[Callable[[Any], Any]] = [
            lambda a: a[1:] if a.ndim else a,
            lambda a: a + 1,
            lambda a: a.astype(str),
            lambda a: np.full(a.shape, np.nan),
            lambda a: a[..., None],
            lambda a: np.zeros((0, *a.shape[1:])),
            lambda a: a.astype(np.complex128),
            lambda a: np.full(a.shape, 1e300),
        ]
        arrays[name] = changes[rng.integers(len(changes))](arrays[name])
        db.execute("UPDATE arrays SET archive = ? WHERE key = ?", (packed(arrays), key))
    return "arrays: another array"


def _archive(folder: Path, rng: np.random.Generator) -> str:
    with _opened(folder) as db:
        kept = dict(db.execute("SELECT key, archive FROM arrays"))
        key = str(rng.choice(sorted(kept)))
        content = bytearray(kept[key])
        content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        db.execute("UPDATE arrays SET archive = ? WHERE key = ?", (bytes(content), key))
    return "arrays: bytes flipped"


def _exchanged(folder: Path, rng: np.random.Generator) -> str:
    """The arrays of two cells in each other's place."""
    with _opened(folder) as db:
        keys = [row[0] for row in db.execute("SELECT key FROM results WHERE key IN (SELECT key FROM arrays)")]
        one, other = rng.choice(keys, 2, replace=False).tolist()
        for old, new in ((one, "-"), (other, one), ("-", other)):
            db.execute("UPDATE arrays SET key = ? WHERE key = ?", (new, old))
    return "arrays: exchanged"


def _files(folder: Path, rng: np.random.Generator) -> str:
    """A file of the folder is removed, emptied, or damaged; or a folder is in its place."""
    path = Path(str(rng.choice([str(one) for one in sorted(folder.rglob("*")) if one.is_file()])))
    content = bytearray(path.read_bytes())
    path.unlink()
    match int(rng.integers(4)):
        case 0:
            path.mkdir()
        case 1:
            path.touch()
        case 2:
            content[int(rng.integers(len(content)))] ^= 255
            path.write_bytes(content)
        case _:
            pass
    return f"{path.suffix} file damaged"


CHANGES: tuple[Change, ...] = (
    _bytes, _value, _arrays, _row_gone, _cut, _value, _archive, _column_gone, _bytes, _number, _table_empty, _value,
    _exchanged, _zeroed, _files, _table_gone, _value, _arrays, _view_gone,
)  # fmt: skip


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many records, every change in turn; each is compared, each fourth reported, each eighth replayed."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        log, sound = Path(scratch) / "log", Path(scratch) / "sound"
        log_folder.write(log, *random_drive(np.random.default_rng(seed), 20.0))
        go(sound, BACKENDS, log, workers=1, seeds=1)
        expected = _compared(sound)
        unchanged = _said("compare", sound, sound)
        changes = [CHANGES[k] for k in np.random.default_rng(seed).permutation(len(CHANGES)).tolist()]
        for case in range(cases):
            rng = np.random.default_rng([seed, case])
            folder = Path(scratch) / str(case)
            shutil.copytree(sound, folder)
            kind = changes[case % len(changes)](folder, rng)
            ends = [_compare(sound, folder, unchanged, expected)]
            ends += [] if case % 4 != 3 else [_read("report", folder)]
            ends += [] if case % 8 != 5 else [_replay(sound, folder)]
            worst = max(ends, key=lambda one: ORDER.index(one[0]))
            yield Ended(f"record {kind}", *worst)
            shutil.rmtree(folder)


def _compared(folder: Path) -> list[tuple[Any, ...]]:
    """Everything of a record that a comparison reads, and the paths."""
    with Store(folder) as store:
        return [tuple(repr(row.columns[name]) for name in COMPARED) for row in store.cells()]


def _paths(folder: Path) -> list[bytes]:
    with Store(folder) as store:
        return [store.arrays(row, ("online",))["online"].tobytes() for row in store.cells()]


def _said(command: str, *words: Path) -> tuple[int, str, str]:
    """Runs a command; its status, and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([command, *map(str, words)])
    return status, out.getvalue(), err.getvalue()


def _read(command: str, *words: Path) -> tuple[str, str]:
    """How a command ended: refused in one sentence, remarked with output, or crashed."""
    try:
        status, out, err = _said(command, *words)
    except BaseException as error:
        return "crashed", f"{command}: {type(error).__name__}: {error}"
    if status == 2:
        whole = err.startswith("bench: ") and err.count("\n") == 1 and err.rstrip()[-1] in ".?"
        return ("refused" if whole else "crashed"), f"{command}: {err}"
    if err or not out:
        return "crashed", f"{command}: status {status}, {out!r}, {err!r}"
    return ("remarked" if status else "same"), f"{command}: {out}"


def _compare(sound: Path, folder: Path, unchanged: tuple[int, str, str], expected: list[tuple[Any, ...]]) -> Any:
    """Compares with the sound record: what is not the same may not be said to be."""
    end, words = _read("compare", sound, folder)
    if end in ("refused", "crashed"):
        return end, words
    if words != f"compare: {unchanged[1]}":
        return "remarked", words
    try:
        found = _compared(folder)
    except InputError as error:
        return "worse", f"said to be the same, though it cannot be read: {error}"
    return ("same" if found == expected else "worse"), f"{words}; found {found}, expected {expected}"


def _replay(sound: Path, folder: Path) -> Any:
    """Replays; paths that are not the recorded ones may not be said to be."""
    end, words = _read("replay", folder)
    if end != "same" or "nothing to compare with" in words:
        return max(end, "remarked", key=ORDER.index), words
    try:
        same = _paths(sound) == _paths(folder)
    except (InputError, KeyError) as error:
        return "worse", f"replayed, though its paths cannot be read: {error}"
    return ("same" if same else "worse"), words
