"""Reads and writes a record; at most one process writes, any number reads.

Every result is committed as it comes, in a fraction of a millisecond, so that a killed writer loses none. A result
stays, whatever comes later under its key; but a failed one is replaced, and so is one without arrays by the same with
them.
"""

import contextlib
import json
import sqlite3
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

from ...core.beside import Clouds, Scans, names
from ...core.errors import InputError
from . import rounds
from .beside_arrays import kept_beside, kept_name
from .cell_table import CellTable, joined
from .database import BROKEN, damaged, read_only, unwritable, writable
from .plan import Planned, encoded_parameters, status_of
from .remarks import by_label
from .schema import (
    COLUMNS,
    FAILED,
    FILE,
    KEY,
    MORE,
    PLANNED,
    RESULT,
    SKIPPED,
    Row,
    label,
    packed,
    unpacked,
)
from .validity import wrong_arrays, wrong_facts, wrong_row, wrong_truth

TRUTH = ("t", "poses", "ids", "xy", "times", "moving", "sighted", "sighted_at")  # the arrays of a log's truth

_PUT_RESULT = f"INSERT OR REPLACE INTO results (key, {', '.join(RESULT)}) VALUES ({', '.join('?' * (1 + len(RESULT)))})"


class Known(NamedTuple):
    """A log that the record knows."""

    digest: str
    truth_digest: str  # of what its cells are scored by, "" where there is nothing
    truth_kind: str


class Store:
    """An open record. InputError, with nothing changed, where the folder has none or it cannot be used."""

    def __init__(self, folder: Path, *, writing: bool = False) -> None:
        self.folder = folder
        self._db = writable(folder) if writing else read_only(folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file."""
        self._db.close()

    def about(self) -> dict[str, Any]:
        """Reads the facts of the whole: command, environment, started; a study's text, a run's plan."""
        with self._read():
            return {name: json.loads(value) for name, value in self._all("SELECT name, value FROM about")}

    def put_about(self, facts: Mapping[str, Any]) -> None:
        """Writes such facts."""
        rows = [(name, json.dumps(value, default=repr)) for name, value in facts.items()]
        with self._writing() as db:
            db.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", rows)

    def run(self) -> dict[str, Any]:
        """Reads run.json's content: facts, `sketches` and `truths`' digests by log. InputError for an empty record."""
        about = self.about()
        if "folders" not in about:
            raise InputError(f"{self.folder}: nothing of a run or a study is in it yet; expected one that was begun.")
        of = "SELECT DISTINCT dataset, dataset_options FROM plan UNION SELECT DISTINCT backend, options FROM plan"
        if problem := wrong_facts(about, [label(name, options) for name, options in self._all(of)]):
            raise damaged(self.folder / FILE, problem)
        sketches: dict[str, Any] = {}
        truths: dict[str, str | None] = {}
        query = """SELECT DISTINCT plan.dataset, plan.dataset_options, plan.seed, truth_digest, truth_kind, sketch
                   FROM plan JOIN logs ON plan.log = logs.key WHERE digest IS NOT NULL"""
        for dataset, options, seed, truth, kind, sketch in self._all(query):
            name = f"{label(dataset, options)}, seed {seed}"
            truths[name] = truth if kind == "truth" else None
            if sketch:
                with self._read():
                    sketches[name] = json.loads(sketch)
        return about | {"sketches": sketches, "truths": truths}

    def planned(self) -> list[Planned]:
        """Reads every cell of the plan, in its order."""
        names = ", ".join(KEY)
        with self._read():
            return [
                Planned((d, do, b, o, seed), json.loads(parameters) | {"seed": seed}, log, key)
                for d, do, b, o, seed, parameters, log, key in self._all(
                    f"SELECT {names}, parameters, log, key FROM plan ORDER BY place"
                )
            ]

    def cells(self) -> Iterator[Row]:
        """Yields every cell that has ended, by dataset, backend and seed; InputError for an invalid row."""
        names = (*COLUMNS, *MORE)
        there = {row[1] for row in self._all("PRAGMA table_info(cells)")}
        asked = ", ".join(name if name in there else f"NULL AS {name}" for name in names)
        order = ", ".join(KEY)
        query = f"SELECT {asked}, traceback, log, key FROM cells WHERE status <> 'waiting' ORDER BY {order}"
        found, repeated = self._all(query), self.rounds()
        for *values, traceback, log, key in found:
            columns = dict(zip(names, values, strict=True))
            row = Row(columns, traceback or "", log or "", key or "", repeated.get(key, ()))
            if problem := wrong_row(row.columns):
                raise damaged(self.folder / FILE, f"{_named(row)}: {problem}")
            yield row

    def truth(self, row: Row) -> dict[str, Any]:
        """Reads the arrays of the cell's ground truth; empty without.

        `t` and `poses`; where known, `ids`, `xy` and how many `times` these are sighted, the ids of `moving` ones, and
        of each sighting its landmark `sighted` and step `sighted_at`. Earlier versions have no `times`.
        """
        found = self.archive(row.log, TRUTH)
        if problem := wrong_truth(found, {}):
            raise damaged(self.folder / FILE, f"{_named(row)}: {problem}")
        return found

    def scans(self, row: Row) -> Scans | None:
        """Reads the laser scans beside the cell's log; None without."""
        return self._beside(row, "scans")

    def clouds(self, row: Row) -> Clouds | None:
        """Reads the clouds of a depth camera beside the cell's log; None without."""
        return self._beside(row, "clouds")

    def _beside(self, row: Row, kind: str) -> Any:
        kept = self.archive(row.log, [kept_name(kind, name) for name in names(kind)])
        return kept_beside(kind, kept, row.columns["steps"])

    def arrays(self, row: Row, names: Collection[str] | None = None) -> dict[str, Any]:
        """Reads a cell's arrays by name; of `names`, where given, those that it has."""
        found = self.archive(row.result, names)
        problem = wrong_arrays(found, row.columns["steps"])
        if not problem and ("at" in found or "assigned" in found or "final_assigned" in found):
            problem = wrong_truth(self.archive(row.log, ("t", "poses", "sighted", "sighted_at")), found)
        if problem:
            raise damaged(self.folder / FILE, f"{_named(row)}: {problem}")
        return found

    def logs(self, *, arrays: bool = False) -> dict[str, Known]:
        """Reads the known logs by key; with `arrays`, only those whose truth's arrays are kept, if it has any."""
        kept = " AND (truth_kind = '' OR key IN (SELECT key FROM arrays))" if arrays else ""
        found = self._all(f"SELECT key, digest, truth_digest, truth_kind FROM logs WHERE digest IS NOT NULL{kept}")
        return {key: Known(*rest) for key, *rest in found}

    def logs_made(self) -> dict[tuple[str, str, int], list[Known]]:
        """Reads every log that was ever made, by any code, by its dataset, options and seed."""
        made: dict[tuple[str, str, int], list[Known]] = {}
        columns = "dataset, dataset_options, seed, digest, truth_digest, truth_kind"
        for *of, digest, truth, kind in self._all(f"SELECT {columns} FROM logs WHERE digest IS NOT NULL"):
            made.setdefault((of[0], of[1], of[2]), []).append(Known(digest, truth, kind))
        return made

    def logs_unmade(self) -> dict[str, str]:
        """Reads the keys of the logs that could not be made, and the status of their cells."""
        query = """SELECT logs.key, plan.trouble FROM logs
                   LEFT JOIN plan ON plan.log = logs.key AND plan.trouble IS NOT NULL WHERE digest IS NULL"""
        return {key: status_of(trouble or "") for key, trouble in self._all(query)}

    def put_log(
        self,
        key: str,
        of: tuple[str, str, int],
        known: Known,
        arrays: Mapping[str, Any],
        sketch: Any = None,
        remarks: Sequence[str] = (),
    ) -> None:
        """Writes a log's facts; `of` are dataset, options and seed, `arrays` those of its truth."""
        with self._writing() as db:
            same = db.execute("SELECT 1 FROM logs WHERE key = ? AND truth_digest = ?", (key, known[1])).fetchone()
            db.execute(
                "INSERT OR REPLACE INTO logs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                (key, *of, *known, None if sketch is None else json.dumps(sketch), json.dumps(remarks)),
            )
            if arrays or not same:
                _keep(db, key, arrays)

    def put_unmade(self, key: str, of: tuple[str, str, int]) -> None:
        """Records that a log could not be made, unless it once could; `of` as above."""
        with self._writing() as db:
            db.execute(
                "INSERT OR IGNORE INTO logs (key, dataset, dataset_options, seed) VALUES (?, ?, ?, ?)", (key, *of)
            )

    def remarks(self) -> dict[str, list[str]]:
        """Reads what is odd in the planned logs, by dataset label, with the seeds of which it is said if not of all."""
        if "remarks" not in {row[1] for row in self._all("PRAGMA table_info(logs)")}:
            return {}  # an earlier version's record
        query = """SELECT plan.dataset, plan.dataset_options, min(plan.seed), logs.remarks
                   FROM plan JOIN logs ON plan.log = logs.key GROUP BY 1, 2, logs.key ORDER BY 1, 2, 3"""
        with self._read():
            return by_label(self._all(query))

    def statuses(self, *, arrays: bool = False) -> dict[str, str]:
        """Reads the status of every result by key; with `arrays`, without those done that have no arrays."""
        kept = " WHERE status <> 'done' OR key IN (SELECT key FROM arrays)" if arrays else ""
        return dict(self._all(f"SELECT key, status FROM results{kept}"))

    def put_result(self, key: str, row: Mapping[str, Any], arrays: Mapping[str, Any]) -> bool:
        """Writes a result, columns of RESULT, unless the record has one that stays; True if it was written."""
        with self._writing() as db:
            before = db.execute("SELECT status FROM results WHERE key = ?", (key,)).fetchone()
            bare = not db.execute("SELECT 1 FROM arrays WHERE key = ?", (key,)).fetchone()
            if before and before[0] not in FAILED and not (arrays and bare):
                return False
            db.execute(_PUT_RESULT, (key, *map(row.get, RESULT)))
            _keep(db, key, arrays)
        return True

    def rounds(self, key: str | None = None) -> dict[str, list[dict[str, Any]]]:
        """Reads the rounds of all results, or of one, by their key, in order; InputError for an invalid one."""
        try:
            with self._read():
                return rounds.read(self._db, key)
        except BROKEN as error:
            raise damaged(self.folder / FILE, error) from None

    def put_round(self, key: str, row: Mapping[str, Any], medians: Mapping[str, Any]) -> None:
        """Writes a round of a result, columns of ROUND, and the result's columns that sum up all of them."""
        with self._writing() as db:
            rounds.put(db, key, row)
            if medians:
                rounds.put_medians(db, key, medians)

    def archive(self, key: str, names: Collection[str] | None = None) -> dict[str, Any]:
        """Reads the arrays of a log's truth or of a result, by name; none where they were not kept."""
        found = self._all("SELECT archive FROM arrays WHERE key = ?", (key,))
        try:
            return unpacked(found[0][0], names) if found else {}
        except Exception as error:  # a damaged archive may raise anything
            raise damaged(self.folder / FILE, f"the arrays of {key} cannot be read") from error

    def seconds(self) -> dict[tuple[str, str, str, str], tuple[float, int]]:
        """The mean wall time in s and the number of results, by dataset and backend with their options."""
        names = "dataset, dataset_options, backend, options"
        query = f"SELECT {names}, avg(seconds), count(*) FROM results WHERE seconds IS NOT NULL GROUP BY {names}"
        return {tuple(of): (mean, count) for *of, mean, count in self._all(query)}  # pyright: ignore[reportReturnType]

    def put_plan(self, rows: Collection[tuple[Any, ...]]) -> None:
        """Writes changes of the plan: the cell's KEY, parameters, key of log and of result, and PLANNED, each."""
        texts: dict[str, str] = {}
        encoded = [(*row[:5], encoded_parameters(row[5], texts), *row[6:]) for row in rows]
        names = ", ".join((*KEY, "parameters", "log", "key", *PLANNED))
        before = self._all(f"SELECT {names} FROM plan ORDER BY place")
        if before == encoded:
            return
        old = dict(enumerate(before))
        changed = [(place, *row) for place, row in enumerate(encoded) if old.get(place) != row]
        with self._writing() as db:
            db.execute("DELETE FROM plan WHERE place >= ?", (len(encoded),))
            marks = ", ".join("?" * (1 + len(KEY) + 3 + len(PLANNED)))
            db.executemany(f"INSERT OR REPLACE INTO plan (place, {names}) VALUES ({marks})", changed)

    def settle(self, place: int, key: str | None, trouble: str | None, *, skipped: bool = False) -> None:
        """Writes the key of a cell's result, or why there is none: an error, or a log that is not there."""
        if skipped:
            trouble = f"{SKIPPED}{trouble}"
        with self._writing() as db:
            db.execute("UPDATE plan SET key = ?, trouble = ? WHERE place = ?", (key, trouble, place))

    def table(self, measures: Sequence[str]) -> CellTable:
        """Reads parameters, status, reason, digest, cluster and these columns; a parameter precedes its namesake."""
        there = {row[1] for row in self._all("PRAGMA table_info(results)")}
        names = ["status", "reason", *(name for name in dict.fromkeys(("digest", *measures)) if name in there)]
        results = self._all(f"SELECT key, {', '.join(names)} FROM results")
        known_clusters = "cluster" in {row[1] for row in self._all("PRAGMA table_info(plan)")}  # not in an earlier one
        cluster = "cluster" if known_clusters else "NULL"
        plan = self._all(f"SELECT parameters, seed, key, trouble, {cluster} FROM plan ORDER BY place")
        with self._read():
            return joined(plan, names, results, measures)

    def view(self) -> tuple[list[str], dict[str, dict[str, Any]], Iterator[tuple[Any, ...]]]:
        """Opens the view `cells`: columns' names, decoded `parameters` without the seed, and rows, read one by one."""
        try:
            self._db.execute("BEGIN")
            texts = self._all("SELECT DISTINCT parameters FROM plan")
            found = self._db.execute("SELECT * FROM cells")
        except BROKEN as error:
            raise damaged(self.folder / FILE, error) from None
        with self._read():
            meant = {text: json.loads(text) for (text,) in texts}
        return [column[0] for column in found.description], meant, self._each(found)

    def _each(self, found: sqlite3.Cursor) -> Iterator[tuple[Any, ...]]:
        try:
            yield from found
        except BROKEN as error:
            raise damaged(self.folder / FILE, error) from None
        finally:
            with contextlib.suppress(sqlite3.Error):  # the store may be closed by now
                self._db.execute("COMMIT")

    @contextlib.contextmanager
    def _read(self) -> Generator[None]:
        """Raises InputError for content that cannot be decoded."""
        try:
            yield
        except (ValueError, TypeError, AttributeError) as error:
            raise damaged(self.folder / FILE, error) from None

    def _all(self, query: str, values: Sequence[Any] = ()) -> list[Any]:
        try:
            return self._db.execute(query, values).fetchall()
        except BROKEN as error:
            raise damaged(self.folder / FILE, error) from None

    @contextlib.contextmanager
    def together(self) -> Generator[sqlite3.Connection]:
        """Makes one transaction of all writes within."""
        with self._writing() as db:
            yield db

    @contextlib.contextmanager
    def _writing(self) -> Generator[sqlite3.Connection]:
        """Opens a transaction, or joins the open one; InputError where the file cannot be written to."""
        if self._db.in_transaction:
            yield self._db
            return
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield self._db
            self._db.execute("COMMIT")
        except BROKEN as error:
            raise unwritable(self.folder / FILE, error) from None
        finally:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")


def _named(row: Row) -> str:
    dataset, dataset_options, backend, options, seed = row.key
    return f"{label(dataset, dataset_options)} \N{MIDDLE DOT} {label(backend, options)} \N{MIDDLE DOT} seed {seed}"


def _keep(db: sqlite3.Connection, key: str, arrays: Mapping[str, Any]) -> None:
    db.execute("DELETE FROM arrays WHERE key = ?", (key,))
    if arrays:
        db.execute("INSERT INTO arrays VALUES (?, ?)", (key, packed(arrays)))
