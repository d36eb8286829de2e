"""`bench export` of a study's or a run's folder: its cells for other programs, exactly."""

import math
import sqlite3
import sys
from pathlib import Path
from typing import Any

import pytest

from command import refused
from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.record import table as cells_export
from slamduel.bench.record.schema import COLUMNS, MORE
from slamduel.bench.record.store import Store
from slamduel.bench.record.table import INNER
from small_record import Record

THIRD = 0.1 + 0.2
ROWS = [
    # tags, gate, robust, steps, mixed; ate_m, reason
    (6, 0.5, True, 100, 1, THIRD, ""),
    (12, 1, False, None, "none", 1 / 3, 'a reason, "quoted",\nin two lines'),
    (6, None, None, 300, True, math.inf, "ü"),
    (12, 2.5, True, 400, 0.5, None, None),
]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study of five cells, of which one has not run."""
    folder = tmp_path / "study"
    folder.mkdir()
    with Store(folder, writing=True) as store:
        store.put_about({"kind": "study"})
        plan = [
            ("circle", "", "ekf", "gate=1", k, _parameters(k, *row[:5]), "log", f"k{k}", None, None)
            for k, row in enumerate([*ROWS, ROWS[0]])
        ]
        store.put_plan(plan)
        for k, (*_, ate, reason) in enumerate(ROWS):
            row: dict[str, Any] = {"status": "done", "reason": reason, "ate_m": ate, "steps": 99 + k, "seconds": 0.25}
            store.put_result(f"k{k}", row, {})
    return folder


def _parameters(seed: int, tags: Any, gate: Any, robust: Any, steps: Any, mixed: Any) -> dict[str, Any]:
    swept = {"tags": tags, "gate": gate, "robust": robust, "steps": steps, "mixed": mixed}
    return {"dataset": "circle", "backend": "ekf[gate=1]", "seed": seed, **swept}


def export(folder: Path, *words: Any) -> int:
    return main(["export", str(folder), *map(str, words), "--quiet"])


def test_both_formats_have_every_cell_exactly(study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pyarrow.parquet as pq

    monkeypatch.setattr(cells_export, "ROWS", 2)  # of five, so that there are several chunks and a rest
    assert export(study, "--csv", tmp_path / "a.csv", "--parquet", tmp_path / "a.parquet") == 0
    table = pq.read_table(tmp_path / "a.parquet")
    columns = table.to_pydict()
    assert list(columns)[:8] == ["dataset", "backend", "seed", "tags", "gate", "robust", "steps", "mixed"]
    types = {field.name: str(field.type) for field in table.schema}
    assert [types[name] for name in ("tags", "gate", "robust", "mixed", "ate_m", "measured_steps", "status")] == [
        "int64", "double", "bool", "string", "double", "int64", "string",
    ]  # fmt: skip
    assert columns["backend"] == ["ekf[gate=1]"] * 5
    assert columns["options"] == ["gate=1"] * 5
    assert columns["seed"] == [0, 1, 2, 3, 4]
    assert columns["tags"] == [6, 12, 6, 12, 6]
    assert columns["gate"] == [0.5, 1.0, None, 2.5, 0.5]
    assert columns["robust"] == [True, False, None, True, True]
    assert columns["steps"] == [100, None, 300, 400, 100]
    assert columns["mixed"] == ["1", "none", "true", "0.5", "1"]
    assert columns["measured_steps"] == [99, 100, 101, 102, None]
    assert columns["ate_m"] == [THIRD, 1 / 3, math.inf, None, None]
    assert columns["reason"] == [row[6] for row in ROWS] + [None]
    assert columns["status"] == ["done"] * 4 + ["waiting"]
    assert {*COLUMNS, *MORE} - {"steps"} <= set(columns)

    rows = csv_rows(tmp_path / "a.csv")
    assert list(rows[0]) == list(columns)
    read = {"int64": int, "double": float, "string": str, "bool": lambda text: text == "true"}
    for name, values in columns.items():
        told = [None if row[name] == "" else read[types[name]](row[name]) for row in rows]
        assert told == [None if value == "" else value for value in values], name
    assert {row["robust"] for row in rows} == {"true", "false", ""}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.parquet", "study"]


def test_pandas_reads_either(study: Path, tmp_path: Path) -> None:
    import pandas as pd

    assert export(study, "--csv", tmp_path / "a.csv", "--parquet", tmp_path / "a.parquet") == 0
    exact = pd.read_csv(tmp_path / "a.csv")
    whole = pd.read_parquet(tmp_path / "a.parquet")
    assert whole["ate_m"].tolist()[:3] == [THIRD, 1 / 3, math.inf]
    assert exact["ate_m"].tolist()[:3] == pytest.approx([THIRD, 1 / 3, math.inf], rel=1e-15)  # pandas' own reading
    assert exact["tags"].tolist() == whole["tags"].tolist()


def test_a_run_has_the_columns_of_its_files(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    record = Record(tmp_path / "run")
    rows = [record.cell("room", "truth", "ekf", seed=seed, ate_m=THIRD, nees=1) for seed in range(2)]
    assert export(tmp_path / "run", "--parquet", tmp_path / "a.parquet") == 0
    columns = pq.read_table(tmp_path / "a.parquet").to_pydict()
    assert list(columns) == [*COLUMNS, *MORE]
    for k, row in enumerate(rows):
        assert {name: values[k] for name, values in columns.items()} == dict.fromkeys(columns) | row


def test_without_pyarrow_it_is_a_sentence(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert export(study, "--csv", tmp_path / "a.csv", "--parquet", tmp_path / "a.parquet") == 2
    assert "expected pyarrow to be installed, as slamduel[parquet] does, or --csv." in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["study"]
    assert export(study, "--csv", tmp_path / "a.csv") == 0


@pytest.mark.parametrize("option", ["--csv", "--parquet"])
def test_a_file_of_something_else_is_not_replaced_and_an_earlier_export_is(
    study: Path, tmp_path: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a").write_text("a letter")
    assert export(study, option, tmp_path / "a") == 2
    assert "a: exists and is no table of cells, expected a new file" in capsys.readouterr().err
    assert (tmp_path / "a").read_text() == "a letter"
    for _ in range(2):
        assert export(study, option, tmp_path / "b") == 0


def test_a_store_that_breaks_off_leaves_what_was_there(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.csv").write_text("dataset,as it was")

    def torn(store: Store, found: Any) -> Any:
        yield next(found)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Store, "_each", torn)
    assert export(study, "--csv", tmp_path / "a.csv", "--parquet", tmp_path / "a.parquet") == 2
    assert "a.parquet: cannot be written (No space left on device)." in capsys.readouterr().err
    assert (tmp_path / "a.csv").read_text() == "dataset,as it was"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "study"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("", "bench: export study: expected --csv FILE or --parquet FILE, for its cells."),
        ("--out x", "--out: is for a dataset, and study is the folder of a study or a run;"),
        ("--as g2o --csv x", "--as: is for a dataset, and study is the folder of a study or a run;"),
        ("--seed 0 --csv x", "--seed: is for a dataset"),
        ("--csv x --parquet x", "--csv and --parquet: found x for both, expected a file each."),
        ("--csv study", "study: is a folder, expected a file to be made."),
        ("--csv study/results.sqlite", "results.sqlite: is a record, expected a file to be made."),
        ("--csv study/results.sqlite-wal", "results.sqlite-wal: is a record, expected a file to be made."),
        ("--csv no/such.csv", "no/such.csv: cannot be written (No such file or directory)."),
        ("--parquet no/such.parquet", "no/such.parquet: cannot be written (No such file or directory)."),
    ],
)
def test_a_mistake_is_a_sentence_and_leaves_nothing(
    study: Path, words: str, sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(study.parent)
    before = sorted(study.parent.rglob("*"))
    assert sentence in refused(capsys, "export", "study", *words.split())
    assert sorted(study.parent.rglob("*")) == before


def test_it_says_what_it_wrote(study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(study), "--csv", str(tmp_path / "a.csv")]) == 0
    with sqlite3.connect(study / "results.sqlite") as db:
        width = len(db.execute("PRAGMA table_info(cells)").fetchall()) + 5 - len(INNER)  # with those that are swept
    db.close()
    assert capsys.readouterr().out == f"{tmp_path / 'a.csv'}: 5 cells, {width} columns\n"
