"""The store of a study: what is in it stays, whatever happens to who writes it."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.record.database import FORMER
from slamduel.bench.record.schema import FILE, ROUND, packed
from slamduel.bench.record.store import Known, Store
from slamduel.core.errors import InputError
from small_record import Record, edited

ARRAYS = {"t": np.array([0.0, 0.1]), "online": np.array([[0.1, 0.2, 0.3]])}


def result(seed: int = 0, status: str = "done", **more: Any) -> dict[str, Any]:
    """A row as the runner makes it."""
    row = {"dataset": "circle", "dataset_options": "", "backend": "ekf", "options": "", "seed": seed, "status": status}
    return row | {"reason": "", "digest": f"d{seed}", "ate_m": 0.1 + seed, "steps": 500, "host": "here"} | more


def database(store: Store) -> sqlite3.Connection:
    return store._db  # pyright: ignore[reportPrivateUsage]


def cell(seed: int, key: str | None, **swept: Any) -> tuple[Any, ...]:
    """A row of the plan."""
    parameters = {"dataset": "circle", "backend": "ekf", "seed": seed, **swept}
    return "circle", "", "ekf", "", seed, parameters, f"log {seed}", key, None, None


def filled(folder: Path, count: int = 3) -> None:
    """A store of so many results."""
    with Store(folder, writing=True) as store:
        store.put_plan([cell(k, f"k{k}") for k in range(count)])
        for k in range(count):
            store.put_result(f"k{k}", result(k), {})


def test_the_table_is_the_plan_with_its_results(tmp_path: Path) -> None:
    tenth = 0.1 + 0.2  # no short decimal
    with Store(tmp_path, writing=True) as store:
        store.put_plan(
            [
                cell(1, "a", tags=6, gate=None, robust=True),
                cell(0, None, tags=tenth, gate="none", robust=False),
                cell(2, None, tags=12, gate=None, robust=None),
                cell(3, "nobody ran it", tags=12, gate=None, robust=None),
                cell(4, None, tags=3, gate=None, robust=None),
            ]
        )
        assert store.put_result("a", result(1, ate_m=tenth, nees=None), {})
        assert store.put_result("of an option that is swept no more", result(9), {})
        store.settle(1, None, "the log could not be made: no such file")
        store.settle(4, None, "dlr is not on this machine", skipped=True)
    with Store(tmp_path) as store:
        table = store.table(["ate_m", "nees", "seconds", "host", "steps"])
        ended = {row.columns["seed"]: (row.columns["status"], row.columns["reason"]) for row in store.cells()}
    assert ended[0] == ("error", "the log could not be made: no such file")
    assert ended[4] == ("skipped", "dlr is not on this machine")
    columns = {name: column.tolist() for name, column in table.columns.items()}
    assert list(columns)[:6] == ["dataset", "backend", "seed", "tags", "gate", "robust"]
    assert columns["seed"] == [1, 0, 2, 3, 4]
    assert columns["tags"] == [6, tenth, 12, 12, 3]
    assert [type(value) for value in columns["tags"][:2]] == [int, float]
    assert columns["gate"] == [None, "none", None, None, None]
    assert columns["robust"] == [True, False, None, None, None]
    assert columns["status"] == ["done", "error", "waiting", "waiting", "skipped"]
    assert columns["reason"][:2] == ["", "the log could not be made: no such file"]
    assert columns["reason"][2:] == [None, None, "dlr is not on this machine"]
    assert columns["digest"] == ["d1", None, None, None, None]
    assert columns["host"] == ["here", None, None, None, None]
    np.testing.assert_array_equal(table.columns["ate_m"], [tenth, *[np.nan] * 4])
    assert table.columns["nees"].dtype == float
    assert np.isnan(table.columns["nees"]).all()
    assert table.rows({"tags": 12, "gate": None}).tolist() == [2, 3]


def test_an_empty_study_is_a_table_without_rows(tmp_path: Path) -> None:
    Store(tmp_path, writing=True).close()
    with Store(tmp_path) as store:
        assert len(store.table(["ate_m"])) == 0
        assert store.statuses() == store.logs() == store.about() == {}


def test_a_parameter_keeps_its_name_beside_a_measure(tmp_path: Path) -> None:
    with Store(tmp_path, writing=True) as store:
        store.put_plan([cell(0, "a", steps=50)])
        store.put_result("a", result(steps=49), {})
        assert store.table(["steps", "ate_m"]).columns["steps"].tolist() == [50]


def test_a_plan_that_stays_is_not_written_again(tmp_path: Path) -> None:
    plan = [cell(seed, f"k{seed}", tags=6) for seed in range(20)]
    with Store(tmp_path, writing=True) as store:
        store.put_plan(plan)
        store.settle(3, "k3", "as it was")

        def written(rows: list[tuple[Any, ...]]) -> int:
            before = database(store).total_changes
            store.put_plan(rows)
            return database(store).total_changes - before

        assert written(plan) == 0
        assert written([*plan[:7], cell(7, "other", tags=6), *plan[8:]]) == 1
        assert written([*plan[:7], cell(7, "other", tags=6.0), *plan[8:]]) == 1
        assert written(plan[:5]) == 15
        table = store.table([])
        assert len(table) == 5


def test_the_first_result_of_a_key_stays_but_for_a_failure(tmp_path: Path) -> None:
    with Store(tmp_path, writing=True) as store:
        store.put_plan([cell(0, "a")])

        def found() -> tuple[str, float]:
            columns = store.table(["ate_m"]).columns
            return columns["status"][0], columns["ate_m"][0]

        assert store.put_result("a", result(status="timeout", ate_m=None), {})
        assert store.put_result("a", result(ate_m=1.0), {})
        assert found() == ("done", 1.0)
        assert not store.put_result("a", result(ate_m=2.0), {})
        assert not store.put_result("a", result(status="error", ate_m=None), {})
        assert found() == ("done", 1.0)
        assert store.statuses() == {"a": "done"}


def test_arrays_that_are_wanted_later_are_got_later(tmp_path: Path) -> None:
    known = Known("d", "t", "truth")
    with Store(tmp_path, writing=True) as store:
        store.put_log("log", ("circle", "", 0), known, {})
        store.put_log("blind", ("log", "", 0), Known("d", "", ""), {})
        store.put_result("a", result(), {})
        store.put_result("b", result(status="diverged"), {})
        assert store.statuses(arrays=True) == {"b": "diverged"}
        assert list(store.logs(arrays=True)) == ["blind"]
        assert store.put_result("a", result(), ARRAYS)
        store.put_log("log", ("circle", "", 0), known, {"t": ARRAYS["t"]})
        assert not store.put_result("a", result(), ARRAYS)
        store.put_log("log", ("circle", "", 0), known, {})
        assert store.statuses(arrays=True) == {"a": "done", "b": "diverged"}
        assert set(store.logs(arrays=True)) == {"log", "blind"}
        assert set(store.logs_made()) == {("circle", "", 0), ("log", "", 0)}
    with Store(tmp_path) as store:
        for name, array in store.archive("a").items():
            np.testing.assert_array_equal(array, ARRAYS[name])
        assert store.archive("log")["t"].tolist() == [0.0, 0.1]
        assert store.archive("b") == {}
    with Store(tmp_path, writing=True) as store:
        store.put_log("log", ("circle", "", 0), known._replace(truth_digest="another"), {})
        assert store.archive("log") == {}


def test_other_programs_read_it_while_it_is_written(tmp_path: Path) -> None:
    import pandas as pd

    with Store(tmp_path, writing=True) as store:
        store.put_plan([cell(k, f"k{k}", tags=6) for k in range(3)])
        reader = sqlite3.connect(f"file:{tmp_path / FILE}?mode=ro", uri=True)
        frame = pd.DataFrame()
        for k in range(3):
            store.put_result(f"k{k}", result(k), {})
            with Store(tmp_path) as other:
                assert other.table([]).columns["status"].tolist() == ["done"] * (k + 1) + ["waiting"] * (2 - k)
            frame = pd.read_sql("SELECT * FROM cells", reader)
            assert frame["ate_m"].tolist()[: k + 1] == [0.1 + seed for seed in range(k + 1)]
            assert frame["status"].tolist() == ["done"] * (k + 1) + ["waiting"] * (2 - k)
        assert [json.loads(words)["tags"] for words in frame["parameters"]] == [6, 6, 6]
        types = {row[1]: row[2] for row in reader.execute("PRAGMA table_info(cells)")}
        reader.close()
    assert set(types.values()) == {"TEXT", "INTEGER", "REAL"}
    assert (types["status"], types["seed"], types["ate_m"]) == ("TEXT", "INTEGER", "REAL")


def test_nothing_that_was_kept_goes_with_a_writer_that_is_killed(tmp_path: Path) -> None:
    script = f"""
from pathlib import Path
from slamduel.bench.record.store import Store
store = Store(Path({str(tmp_path)!r}), writing=True)
for k in range(10**6):
    store.put_result(f"k{{k}}", {{"status": "done", "seed": k}}, {{}})
    print(k, flush=True)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as writer:
        said = [writer.stdout.readline() for _ in range(50)]
        writer.send_signal(signal.SIGKILL)
        said += writer.stdout.readlines()
    last = max(int(word) for word in said if word.endswith("\n"))
    with Store(tmp_path) as store:
        assert len(store.statuses()) > last >= 49
    with Store(tmp_path, writing=True) as store:
        assert len(store.statuses()) - 1 in (last, last + 1)
        assert store.put_result("after", result(), {})


def test_a_full_disk_is_a_sentence_and_costs_nothing_that_was_written(tmp_path: Path) -> None:
    with Store(tmp_path, writing=True) as store:
        pages = database(store).execute("PRAGMA page_count").fetchone()[0]
        database(store).execute(f"PRAGMA max_page_count = {pages + 2}")
        kept: list[str] = []

        def fill() -> None:
            for k in range(1000):
                store.put_result(f"k{k}", result(k, reason="x" * 500), {})
                kept.append(f"k{k}")

        with pytest.raises(InputError, match=r"results\.sqlite: cannot be written to: database or disk is full"):
            fill()
        assert kept
        assert list(store.statuses()) == kept
        database(store).execute(f"PRAGMA max_page_count = {pages + 1000}")
        assert store.put_result("more", result(), ARRAYS)
    with Store(tmp_path, writing=True) as store:
        assert list(store.statuses()) == [*kept, "more"]


def test_a_store_that_cannot_be_written_to_is_a_sentence(tmp_path: Path) -> None:
    filled(tmp_path)
    with Store(tmp_path, writing=True) as store:
        database(store).execute("PRAGMA query_only = ON")
        with pytest.raises(InputError, match=r"results\.sqlite: cannot be written to: attempt to write a readonly"):
            store.put_about({"finished": 1})
        assert len(store.statuses()) == 3
    with pytest.raises(InputError, match=r"results\.sqlite: cannot be written to: unable to open"):
        Store(tmp_path / "nowhere", writing=True)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_store_in_a_folder_that_cannot_be_written_to_is_read(tmp_path: Path) -> None:
    filled(tmp_path)
    os.chmod(tmp_path, 0o555)
    try:
        with Store(tmp_path) as store:
            assert len(store.statuses()) == 3
        with pytest.raises(InputError, match="cannot be written to"), Store(tmp_path, writing=True) as store:
            store.put_about({"finished": 1})
    finally:
        os.chmod(tmp_path, 0o755)


def _no_database(folder: Path) -> None:
    (folder / FILE).write_bytes(b"a line of text, and no database\n" * 100)


def _damaged(folder: Path) -> None:
    content = bytearray((folder / FILE).read_bytes())
    content[4096 * 2 :: 7] = b"\xff" * len(content[4096 * 2 :: 7])
    (folder / FILE).write_bytes(content)


def _as(*statements: str, anew: bool = False) -> Callable[[Path], Any]:
    def spoil(folder: Path) -> None:
        if anew:
            (folder / FILE).unlink()
        edited(folder, *statements)

    return spoil


WHOLE = "expected the record of a run or a study, whole. Nothing was changed; cells.csv beside it has the results; "
RECOVER = "sqlite3 {path} .recover gives what can still be read."
SPOILT = [
    (_no_database, f"file is not a database; {WHOLE}{RECOVER}"),
    (_as("CREATE TABLE cells (x)", anew=True), "found other tables, expected a record."),
    (_as("PRAGMA user_version = 99"), "found a record of format 99, expected 2: another version of slamduel wrote it."),
    (
        _as("CREATE TABLE run (x)", "CREATE TABLE cells (x)", "PRAGMA user_version = 1", anew=True),
        "bench run into a new folder makes a new one.",
    ),
    (_as("DROP VIEW cells", "DROP TABLE results"), f"{WHOLE}{RECOVER}"),
    (_damaged, f"{WHOLE}{RECOVER}"),
]


@pytest.mark.parametrize(("spoil", "sentence"), SPOILT)
def test_what_is_no_sound_record_is_named_and_left_alone(tmp_path: Path, spoil: Any, sentence: str) -> None:
    filled(tmp_path, 40)
    (tmp_path / "cells.csv").touch()
    path = tmp_path / FILE
    spoil(tmp_path)
    before = path.read_bytes()
    for writing in (False, True):
        with pytest.raises(InputError) as caught, Store(tmp_path, writing=writing) as store:
            store.table(["ate_m"])
        assert str(caught.value).startswith(f"{path}: ")
        assert str(caught.value).endswith(sentence.format(path=path))
        assert path.read_bytes() == before


def test_a_folder_of_something_else_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"results\.sqlite is not here; expected the folder of a run or a study\."):
        Store(tmp_path)
    (tmp_path / FORMER).touch()
    with pytest.raises(
        InputError, match=r"holds a study of an earlier version, study\.sqlite, .*; expected the folder"
    ):
        Store(tmp_path)
    with pytest.raises(InputError, match=r"holds a study of an earlier version, study\.sqlite, .*; expected a new"):
        Store(tmp_path, writing=True)
    assert [path.name for path in tmp_path.iterdir()] == [FORMER]


@pytest.mark.parametrize(
    ("statement", "sentence"),
    [
        ("UPDATE results SET status = 'lost'", "status is 'lost', expected done, diverged"),
        ("UPDATE results SET ate_m = 'far'", "ate_m is 'far', expected a number"),
        ("UPDATE results SET nees = -1", "nees is -1, expected 0 or more"),
        ("UPDATE results SET steps = NULL", "steps None, expected whole numbers"),
        ("UPDATE results SET digest = x'ff'", "digest is b"),
    ],
)
def test_a_row_that_somebody_edited_is_refused_by_its_name(tmp_path: Path, statement: str, sentence: str) -> None:
    filled(tmp_path, 1)
    edited(tmp_path, statement)
    with Store(tmp_path) as store, pytest.raises(InputError) as caught:
        list(store.cells())
    assert "circle \N{MIDDLE DOT} ekf \N{MIDDLE DOT} seed 0" in str(caught.value)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"t": np.zeros(3)}, "t is 3 of float64, expected numbers, 2"),
        ({"t": np.zeros(2), "online": np.zeros((2, 2))}, "online is 2 x 2 of float64, expected numbers, 2 x 3"),
        ({"t": np.zeros(2), "at": np.array([5])}, "at names a step outside the 2 there are"),
        ({"t": np.array(["a", "b"])}, "t is 2 of <U1, expected numbers, 2"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(tmp_path: Path, arrays: dict[str, Any], sentence: str) -> None:
    with Store(tmp_path, writing=True) as store:
        store.put_plan([cell(0, "k0")])
        store.put_result("k0", result(steps=2), arrays)
        (row,) = store.cells()
        with pytest.raises(InputError) as caught:
            store.arrays(row)
    assert sentence in str(caught.value)


def test_a_store_that_lacks_a_column_is_read_and_completed(tmp_path: Path) -> None:
    filled(tmp_path)
    edited(tmp_path, "DROP VIEW cells", "ALTER TABLE results DROP COLUMN n_eff_least")
    with Store(tmp_path) as store:
        table = store.table(["n_eff_least", "ate_m"])
    assert np.isnan(table.columns["n_eff_least"]).all()
    np.testing.assert_array_equal(table.columns["ate_m"], [0.1, 1.1, 2.1])
    with Store(tmp_path, writing=True) as store:
        assert store.put_result("new", result(n_eff_least=5.0), {})
        store.put_plan([cell(0, "new"), cell(1, "k1")])
        np.testing.assert_array_equal(store.table(["n_eff_least"]).columns["n_eff_least"], [5.0, np.nan])


def test_rounds_that_lack_a_column_are_read_and_completed(tmp_path: Path) -> None:
    filled(tmp_path)
    one = dict.fromkeys(ROUND) | {"round": 1, "status": "done", "cpu_s": 2.0}
    with Store(tmp_path, writing=True) as store:
        store.put_round("k1", one, {})
    edited(tmp_path, *(f"ALTER TABLE rounds DROP COLUMN over_{ms}ms" for ms in (1, 10, 100)))
    with Store(tmp_path) as store:
        assert store.rounds()["k1"] == [one]
    with Store(tmp_path, writing=True) as store:
        store.put_round("k1", one | {"round": 2, "over_10ms": 0.5}, {"over_10ms": 0.5})
        assert [found["over_10ms"] for found in store.rounds()["k1"]] == [None, 0.5]


def test_what_is_put_together_is_kept_as_one(tmp_path: Path) -> None:
    filled(tmp_path, 1)

    def put(name: str, *, fails: bool) -> None:
        with store.together():
            store.put_log(name, ("city", "", 0), Known("d", "t", "truth"), {})
            store.put_result(name, result(0), {})
            assert not reader.logs()
            if fails:
                raise KeyboardInterrupt
            store.settle(0, name, None)

    with Store(tmp_path, writing=True) as store, Store(tmp_path) as reader:
        with pytest.raises(KeyboardInterrupt):
            put("lost", fails=True)
        assert store.statuses() == {"k0": "done"}
        put("kept", fails=False)
        assert reader.logs().keys() == {"kept"}
        assert reader.statuses().keys() == {"k0", "kept"}


@pytest.mark.parametrize(
    ("statement", "sentence"),
    [
        ("DELETE FROM about WHERE name = 'environment'", "about: environment is None, expected a table"),
        ("DELETE FROM about WHERE name = 'command'", "about: command is None, expected a text"),
        ("UPDATE about SET value = '3' WHERE name = 'folders'", "about: folders is 3, expected a table"),
        ("UPDATE about SET value = '{}' WHERE name = 'folders'", "about: folders has none for ekf"),
        ("UPDATE about SET value = '\"x\"' WHERE name = 'random'", "about: random is 'x', expected a list"),
        ("UPDATE about SET value = '{' WHERE name = 'options'", "Expecting property name"),
        ("UPDATE logs SET sketch = '{'", "Expecting property name"),
        ("UPDATE plan SET dataset = 'hall'", "about: folders has none for hall, which the plan names"),
    ],
)
def test_facts_that_somebody_edited_are_refused(tmp_path: Path, statement: str, sentence: str) -> None:
    record = Record(tmp_path / "run")
    record.cell("room", "truth", "ekf")
    record.store.close()
    edited(tmp_path / "run", statement)
    with Store(tmp_path / "run") as store, pytest.raises(InputError, match=r"expected the record of a run") as caught:
        store.run()
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({}, "the poses that its path is measured from are not there"),
        ({"t": np.zeros(3)}, "the truth of its log has no times or no poses"),
        ({"t": np.zeros(3), "poses": np.zeros((3, 3))}, "the truth of its log lacks poses at steps that its path"),
    ],
)
def test_a_truth_that_does_not_fit_its_cells_is_refused(tmp_path: Path, arrays: dict[str, Any], sentence: str) -> None:
    record = Record(tmp_path / "run")
    record.cell("room", "truth", "ekf")
    with record.store.together() as db:
        db.execute("DELETE FROM arrays WHERE key LIKE 'log %'")
        if arrays:
            db.execute("INSERT INTO arrays VALUES (?, ?)", ("log ('room', '', 0)", packed(arrays)))
    (row,) = record.store.cells()
    with pytest.raises(InputError, match=sentence):
        record.store.arrays(row)


def test_a_record_without_rounds_is_read_and_completed(tmp_path: Path) -> None:
    """As versions before repeats wrote it."""
    filled(tmp_path)
    edited(tmp_path, "DROP TABLE rounds")
    with Store(tmp_path) as store:
        assert {row.rounds for row in store.cells()} == {()}
    with Store(tmp_path, writing=True) as store:
        key = next(row.result for row in store.cells() if row.columns["status"] == "done")
        store.put_round(key, {"round": 1, "status": "done", "step_us_p50": 3.0}, {"step_us_p50": 3.0, "repeats": 1})
        (found,) = [row for row in store.cells() if row.rounds]
    assert (found.columns["step_us_p50"], found.columns["repeats"]) == (3.0, 1)
    assert found.rounds[0]["step_us_p50"] == 3.0


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("round", 0, "expected a whole number from 1 on"),
        ("status", "well", "status is 'well', expected done"),
        ("cpu_s", -1.0, "cpu_s is -1.0, expected a number, 0 or more"),
        ("step_us_p50", "fast", "step_us_p50 is 'fast', expected a number"),
        ("path", b"bits", "reason, path or host is no text"),
    ],
)
def test_an_invalid_round_is_refused(tmp_path: Path, name: str, value: Any, problem: str) -> None:
    filled(tmp_path)
    with Store(tmp_path, writing=True) as store:
        store.put_round("key", {"round": 1, "status": "done"} | {name: value}, {})
        with pytest.raises(InputError, match=problem):
            store.rounds()
