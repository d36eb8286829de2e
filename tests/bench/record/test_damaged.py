"""A run's folder with missing, half-written or foreign files: what can be given is given, and what cannot is named."""

import contextlib
import csv
import html
import io
import json
import os
import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.cli import main
from slamduel.bench.record.files import export
from slamduel.bench.record.reader import Store
from slamduel.bench.record.schema import COLUMNS, FILE, MORE, VERSION
from slamduel.bench.record.validity import BELONGING
from slamduel.bench.run.runner import recorded_plan
from slamduel.frontend.errors import InputError
from small_record import STEPS, Record

CELLS, KEY = 4, COLUMNS[:5]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two backends on two logs of a room, with the tables that a run leaves."""
    folder = tmp_path_factory.mktemp("runs") / "whole"
    record = Record(folder)
    for seed in range(2):
        record.cell("room", "truth", "ekf", seed=seed, length_s=6.0)
        record.cell("room", "truth", "isam2", seed=seed, paths=("online", "final"))
    more = {name: np.ones(STEPS) for name in ("nis", "nis_dof", "n_eff", "wall_ns", "belief_ns")}
    for row in list(record.store.cells()):
        record.store.put_cell(row.columns, record.store.arrays(row) | more, "")
    rows = [row.columns for row in record.store.cells()]
    for name, columns in (("cells.csv", COLUMNS), ("metrics.csv", (*KEY, *MORE))):
        with (folder / name).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerows([columns, *([row[column] for column in columns] for row in rows)])
    (folder / "run.json").write_text(json.dumps(record.store.run()))
    record.store.close()
    assert sorted(path.name for path in folder.iterdir()) == ["cells.csv", "metrics.csv", FILE, "run.json"]
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


def change(folder: Path, statement: str, *values: Any) -> None:
    db = sqlite3.connect(folder / FILE)
    with db:
        db.execute(statement, values)
    db.close()


def packed(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def read(folder: Path) -> tuple[list[Any], list[int], str]:
    """Rows, the number of arrays of each, and what was left out."""
    with Store(folder) as store:
        rows = list(store.cells())
        arrays = [len(store.arrays(row)) for row in rows]
        for row in rows:
            store.truth(row.columns["dataset"], row.columns["dataset_options"], row.columns["seed"])
        assert {"folders", "environment", "command", "options", "workers", "timing_policy", "started"} <= set(
            store.run()
        )
        return rows, arrays, "\n".join(store.left_out)


def test_of_a_whole_folder_nothing_is_left_out(whole: Path) -> None:
    rows, arrays, said = read(whole)
    assert (len(rows), min(arrays) > 10, said) == (CELLS, True, "")


def test_without_its_record_a_run_is_read_from_its_tables(whole: Path, folder: Path) -> None:
    (folder / FILE).unlink()
    rows, arrays, said = read(folder)
    assert [row.columns for row in rows] == [row.columns for row in read(whole)[0]]
    assert rows[0].columns["length_s"] == 6.0
    assert arrays == [0] * CELLS
    assert "results.sqlite is not here: numbers are from cells.csv" in said
    with Store(whole) as store, Store(folder) as tables:
        assert store.run() == tables.run()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "found a record of format 0"),
        (b"not a database" * 99, "file is not a database"),
        (b"SQLite format 3\0" + bytes(4000), "results.sqlite cannot be read"),
    ],
)
def test_a_record_that_is_none_is_not_touched(folder: Path, content: bytes, said: str) -> None:
    (folder / FILE).write_bytes(content)
    rows, _, left_out = read(folder)
    assert len(rows) == CELLS
    assert said in left_out
    assert (folder / FILE).read_bytes() == content


def test_a_record_of_the_future_is_read_from_its_tables_and_not_gone_on_with(folder: Path) -> None:
    change(folder, f"PRAGMA user_version = {VERSION + 1}")
    assert "found a record of format 2, expected 1" in read(folder)[2]
    with pytest.raises(InputError, match="found a record of format 2, expected 1"):
        recorded_plan(folder)


def test_another_programs_database_is_not_written_to(folder: Path) -> None:
    (folder / FILE).unlink()
    change(folder, "CREATE TABLE bookmarks (url)")
    before = (folder / FILE).read_bytes()
    assert len(read(folder)[0]) == CELLS
    with pytest.raises(InputError, match="found a record of format 0"):
        recorded_plan(folder)
    assert (folder / FILE).read_bytes() == before


@pytest.mark.parametrize("backend", ["ekf", "isam2"])
def test_rows_behind_a_damaged_page_are_read_and_the_others_come_from_the_table(folder: Path, backend: str) -> None:
    """The page of a row is overwritten: the way to the rows behind it leads through it."""
    content = bytearray((folder / FILE).read_bytes())
    leaf = content.index(f"room{backend}done".encode())
    start = leaf - leaf % 4096
    content[start : start + 4096] = random.Random(1).randbytes(4096)
    (folder / FILE).write_bytes(content)
    rows, arrays, said = read(folder)
    assert len(rows) == CELLS
    assert 0 in arrays
    assert "results.sqlite is damaged" in said
    assert "the row is from cells.csv" in said
    with pytest.raises(InputError, match="Nothing was changed"):
        recorded_plan(folder)
    assert (folder / FILE).read_bytes() == bytes(content)


NONSENSE: list[tuple[str, Any, str, int]] = [
    ("status", "dnoe", "status is 'dnoe', expected done, diverged, timeout, error, skipped", 3),
    ("steps", "many", "steps is 'many', expected a whole number of at least 1", 3),
    ("truth_kind", 7, "truth_kind is 7, expected a text", 3),
    ("ate_m", "wide", "ate_m is 'wide', expected a number", 4),
    ("ate_m", -1.0, "ate_m is -1.0, expected a number", 4),
    ("cpu_s", b"\0", "cpu_s is b'\\x00', expected a number", 4),
]


@pytest.mark.parametrize(("column", "value", "sentence", "left"), NONSENSE)
def test_nonsense_in_a_row_is_left_out_and_named(
    folder: Path, column: str, value: Any, sentence: str, left: int
) -> None:
    """What makes no sense anywhere is the whole row, which the table has; of a number, the number."""
    change(folder, f"UPDATE cells SET {column} = ? WHERE backend = 'ekf' AND seed = 1", value)
    rows, arrays, said = read(folder)
    assert f"room · ekf · seed 1: {sentence}" in said
    assert len(rows) == CELLS
    assert 0 not in arrays
    assert ("room · ekf · seed 1: the row is from cells.csv" in said) == (left == 3)
    if left == CELLS:
        assert rows[1].columns[column] is None
    (folder / "cells.csv").unlink()
    assert len(read(folder)[0]) == left


def test_a_half_written_and_edited_table_gives_its_whole_rows(folder: Path) -> None:
    (folder / FILE).unlink()
    lines = (folder / "cells.csv").read_text().splitlines()
    edited = lines[2].replace(",done,", ",done,a remark of mine,", 1).replace("a remark of mine,,", "a remark of mine,")
    nan = lines[3].split(",")
    nan[COLUMNS.index("ate_m")] = "nan"
    (folder / "cells.csv").write_text("\n".join([*lines[:2], edited, lines[1], ",".join(nan), lines[4][:70]]))
    rows, _, said = read(folder)
    assert [row.columns["ate_m"] is None for row in rows] == [False, False, True]
    assert "cells.csv, line 4: the same cell once more: it is left out." in said
    assert f"cells.csv, line 6: found 8 values, expected {len(COLUMNS)}: it is left out." in said
    assert "room · isam2 · seed 0: ate_m is nan, expected a number" in said


@pytest.mark.parametrize(
    "content", ["{", "[]", '{"folders": {"room": "../elsewhere"}, "started": "noon", "options": 3}']
)
def test_a_damaged_run_json_is_made_good(folder: Path, content: str) -> None:
    """And no folder of it leads out of the run's."""
    (folder / FILE).unlink()
    (folder / "run.json").write_text(content)
    with Store(folder) as store:
        run = store.run()
        assert run["folders"] == {"room": "room", "ekf": "ekf", "isam2": "isam2"}
        assert run["environment"]["processor"] == "not known"
        assert isinstance(run["started"], float)
        assert any("command" in sentence and "folders" in sentence for sentence in store.left_out)


BROKEN_ARRAYS: list[tuple[bytes, str]] = [
    (b"no archive", "found no archive of arrays"),
    (packed(t=np.arange(3.0)), f"t is 3, expected {STEPS}"),
    (packed(t=np.full(STEPS, np.nan)), "t has a value that is not finite"),
    (packed(t=np.arange(STEPS), online=np.zeros((STEPS, 2))), f"online is {STEPS} x 2, expected {STEPS} x 3"),
    (packed(t=np.array(["a"] * STEPS)), "t holds no numbers"),
    (packed(map_ids=np.arange(3), map_xy=np.zeros((4, 2))), "map_xy is 4 x 2, expected 3 x 2"),
    (packed(at=np.array([STEPS])), f"at names a step outside the {STEPS} there are"),
]


@pytest.mark.parametrize(("blob", "sentence"), BROKEN_ARRAYS)
def test_arrays_that_do_not_fit_are_left_out_and_named(folder: Path, blob: bytes, sentence: str) -> None:
    change(folder, "UPDATE cells SET arrays = ? WHERE backend = 'ekf' AND seed = 0", blob)
    _, arrays, said = read(folder)
    assert arrays[0] == 0
    assert min(arrays[1:]) > 0
    assert "room · ekf · seed 0: paths and costs over time cannot be read" in said
    assert sentence in said


def test_without_any_one_of_the_arrays_there_is_no_traceback_and_a_lack_that_matters_is_named(tmp_path: Path) -> None:
    record = Record(tmp_path / "r")
    row = record.cell("room", "truth", "isam2", paths=("online", "final"))
    (kept,) = [record.store.arrays(row) for row in record.store.cells()]
    for name in kept:
        record.store.put_cell(row, {other: array for other, array in kept.items() if other != name}, "")
        with Store(record.store.folder) as store:
            export(store)
            read_all = bool(store.arrays(next(store.cells())))
            assert read_all == (name not in BELONGING.values()), name
            assert any(f"without {name}" in said for said in store.left_out) != read_all, name
    record.store.close()


@pytest.mark.parametrize(
    "statement", ["DELETE FROM logs WHERE seed = 0", "UPDATE logs SET arrays = x'00' WHERE seed = 0"]
)
def test_without_the_truth_there_are_no_errors_over_time(folder: Path, statement: str) -> None:
    change(folder, statement)
    with Store(folder) as store:
        for row in store.cells():
            known = row.columns["seed"] == 1
            assert ("aligned" in store.arrays(row)) == known
            assert "online" in store.arrays(row)
        assert any("room · ekf · seed 0" in sentence and "measured from" in sentence for sentence in store.left_out)


def test_files_of_others_are_named_and_left_as_they_are(folder: Path) -> None:
    (folder / "thesis.tex.bak").write_text("precious")
    (folder / "photos").mkdir()
    (folder / "folder-0").mkdir()
    (folder / "report.html").touch()
    assert read(folder)[2] == "photos, thesis.tex.bak: not of this run, and left as they are."


def damage(rng: random.Random, path: Path) -> None:
    """Cut it off, overwrite a stretch or single bytes of it, or take it away."""
    content = bytearray(path.read_bytes())
    kind = rng.randrange(7)
    if kind == 0:
        path.unlink()
        return
    at, n = rng.randrange(len(content)), rng.choice((1, 50, 4096, 20_000))
    if kind <= 2:
        content = content[:at]
    elif kind <= 4:
        content[at : at + n] = rng.randbytes(min(n, len(content) - at))
    else:
        for _ in range(rng.choice((1, 10, 300))):
            content[rng.randrange(len(content))] = rng.randrange(256)
    path.write_bytes(content)


@pytest.mark.parametrize("seed", range(3))
def test_whatever_happens_to_the_files_there_is_no_traceback(whole: Path, tmp_path: Path, seed: int) -> None:
    """Rows or a sentence; what is fewer than there was is named; nothing is written."""
    rng = random.Random(seed)
    for k in range(20):
        folder = Path(shutil.copytree(whole, tmp_path / str(k)))
        damaged = rng.sample([FILE, FILE, "cells.csv", "run.json", "metrics.csv"], rng.choice((1, 1, 2)))
        for name in set(damaged):
            damage(rng, folder / name)
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        refused = ""
        try:
            rows, arrays, said = read(folder)
        except InputError as error:
            refused = str(error)
        else:
            assert said or (len(rows) == CELLS and 0 not in arrays)
        assert not refused or (str(folder) in refused and not {FILE, "cells.csv"}.isdisjoint(damaged))
        with contextlib.suppress(InputError):
            recorded_plan(folder)
        after = {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.endswith(("-wal", "-shm"))}
        assert {name: before[name] for name in before} == {name: after[name] for name in before}


def without_record(folder: Path) -> None:
    (folder / FILE).unlink()


def without_arrays(folder: Path) -> None:
    change(folder, "UPDATE cells SET arrays = x'00' WHERE backend = 'ekf'")
    change(folder, "UPDATE cells SET reason = 'kept' WHERE backend = 'ekf'")


def without_truth(folder: Path) -> None:
    change(folder, "DELETE FROM logs")
    change(folder, "DELETE FROM run")


@pytest.mark.parametrize("harm", [without_record, without_arrays, without_truth])
def test_the_report_is_written_and_names_what_was_left_out(
    folder: Path, capsys: pytest.CaptureFixture[str], harm: Callable[[Path], None]
) -> None:
    harm(folder)
    (folder / "report.html").write_text("with every figure")
    tables = (folder / "cells.csv").read_text()
    assert main(["report", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "left out: " in said
    assert "report.html" in said.splitlines()[-1]
    with Store(folder) as store:
        list(store.cells())
        first = store.left_out[0] if store.left_out else ""
    page = html.unescape((folder / "report.html").read_text())
    assert "isam2" in page
    assert first.split(":")[0] in page
    assert (folder / "earlier" / "report.html").read_text() == "with every figure"
    assert tables in {
        (folder / "cells.csv").read_text(),
        *(path.read_text() for path in folder.glob("earlier/cells.csv")),
    }


def test_a_folder_that_cannot_be_written_to_is_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert main(["report", str(folder)]) == 2
    assert f"{folder}: cannot be written to" in capsys.readouterr().err


def test_a_damaged_run_is_compared_as_far_as_it_goes(
    whole: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / FILE).write_bytes((folder / FILE).read_bytes()[:20_000])
    assert main(["compare", str(whole), str(folder)]) == 0
    assert "results.sqlite is damaged" in capsys.readouterr().out
