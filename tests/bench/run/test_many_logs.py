"""A dataset of many logs, from its names to its report: one verdict, paired by log, clusters counted once."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slamduel
from csv_rows import csv_rows
from random_logs import random_log
from slamduel.bench.cli import main
from slamduel.bench.record.store import Store
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset
from slamduel.datasets.formats import log_folder

LOGS = 4


@pytest.fixture(scope="module")
def worlds() -> list[Dataset]:
    """Logs with names of their own."""
    made = [random_log(np.random.default_rng(k), 12, 3) for k in range(LOGS)]
    return [Dataset(replace(log, name=f"log-{k}"), truth) for k, (log, truth) in enumerate(made)]


@pytest.fixture
def drives(tmp_path: Path, worlds: list[Dataset], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The logs in folders, and a file that says which belong together."""
    for k, world in enumerate(worlds):
        log_folder.write(tmp_path / f"drives/{k}", *world)
    clusters = ["monday", "monday", "tuesday", "tuesday"]
    (tmp_path / "drives.toml").write_text(
        "".join(f'[[logs]]\npath = "drives/{k}"\ncluster = "{name}"\n' for k, name in enumerate(clusters))
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bench(*words: str) -> int:
    return main(["run", "--backend", "dead-reckoning,ekf", "--out", "out", "--quiet", *words])


def cells(folder: Path) -> list[dict[str, str]]:
    """Joins the rows of cells.csv and metrics.csv, which name the same cells in the same order."""
    found = zip(csv_rows(folder / "cells.csv"), csv_rows(folder / "metrics.csv"), strict=True)
    return [cell | more for cell, more in found]


@pytest.mark.usefixtures("no_report")
def test_each_log_is_a_seed_with_its_name_and_cluster(drives: Path, worlds: list[Dataset]) -> None:
    assert bench("--dataset", "drives.toml") == 0
    found = [row for row in cells(drives / "out") if row["backend"] == "ekf"]
    assert [*found[0]][[*found[0]].index("log_name") :][:2] == ["log_name", "cluster"]
    assert [(row["seed"], row["log_name"], row["cluster"]) for row in found] == [
        ("0", "drives/0", "monday"), ("1", "drives/1", "monday"),
        ("2", "drives/2", "tuesday"), ("3", "drives/3", "tuesday"),
    ]  # fmt: skip
    assert [row["digest"] for row in found] == [world.log.digest for world in worlds]
    (folder,) = {path.parent.parent.name for path in (drives / "out").glob("*/0/ekf")}
    assert sorted(path.name for path in (drives / "out" / folder).iterdir()) == ["0", "1", "2", "3"]
    plan = json.loads((drives / "out/run.json").read_text())["plan"]
    assert plan["logs"]["logs[path=drives.toml]"][3] == ["log[path=./drives/3]", "tuesday"]


@pytest.mark.usefixtures("no_report")
def test_the_verdict_counts_logs_and_clusters(drives: Path) -> None:
    assert bench("--dataset", "drives.toml") == 0
    (ruling,) = slamduel.Result(drives / "out").verdict.values()
    assert ruling.basis == "4 logs in 2 clusters; the true path is known"
    assert "4 logs in 2 clusters are too few to test, 6 clusters at least" in ruling.sentences[0]
    (c,) = ruling.comparisons["ate_m"]
    assert (c.n, c.units) == (4, 2)
    assert "drives.toml, 4 logs in 2 clusters" in repr(slamduel.Result(drives / "out"))


def test_the_report_names_the_log_that_it_draws(drives: Path) -> None:
    assert bench("--dataset", "drives/*") == 0
    page = (drives / "out/report.md").read_text()
    assert "4 logs; the true path is known" in page
    assert any(f"seed {k}, drives/{k}" in (drives / "out/report.html").read_text() for k in range(LOGS))


@pytest.mark.usefixtures("no_report")
def test_it_goes_on_with_the_same_logs_alone(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench("--dataset", "drives.toml") == 0
    before = (drives / "out/cells.csv").read_text()
    assert main(["run", "--out", "out", "--quiet"]) == 0
    assert (drives / "out/cells.csv").read_text() == before
    text = (drives / "drives.toml").read_text()
    for other in (text.replace("tuesday", "sunday"), text.rpartition("[[logs]]")[0]):
        (drives / "drives.toml").write_text(other)
        assert main(["run", "--out", "out"]) == 2
        said = capsys.readouterr().err
        assert "dataset logs[path=drives.toml]: its logs, or their clusters, have changed since this run was" in said
    assert (drives / "out/cells.csv").read_text() == before


@pytest.mark.usefixtures("no_report")
def test_one_result_serves_a_log_by_itself_and_among_many(drives: Path) -> None:
    assert bench("--dataset", "drives/2,drives.toml") == 0
    found = [row for row in cells(drives / "out") if row["backend"] == "ekf"]
    alone, among = found[0], found[3]
    assert (alone["cluster"], among["cluster"]) == ("", "tuesday")
    assert alone["ate_m"] == among["ate_m"]
    with Store(drives / "out") as store:
        assert len(store.statuses()) == 2 * LOGS  # of ten cells


def test_a_copy_of_a_log_is_the_same_log(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(drives / "drives/1", drives / "drives/9")
    assert bench("--dataset", "drives/*") == 2
    said = capsys.readouterr().err
    assert "log[path=drives/*]: drives/1 and drives/9 are the same log, whose digest is " in said
    assert not (drives / "out/cells.csv").exists()


def test_logs_that_are_judged_by_different_things_are_refused(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log_folder.write(drives / "drives/9", random_log(np.random.default_rng(9), 12, 3)[0], None)
    assert bench("--dataset", "drives/*") == 2
    assert (
        "found logs whose errors are not of one kind, drives/0 has ground truth and drives/9 has a batch optimum "
        "alone; expected the same of all" in capsys.readouterr().err
    )
    assert not (drives / "out/cells.csv").exists()


def test_what_is_no_log_is_refused_by_its_name(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (drives / "drives/readme.txt").write_text("monday: rain")
    assert bench("--dataset", "log[path=drives/*]") == 2
    assert "drives/readme.txt: there is no such folder, expected that of a log" in capsys.readouterr().err


@pytest.mark.usefixtures("drives")
def test_every_log_of_many_is_validated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "log[path=drives/*]"]) == 0
    assert [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()] == [
        f"drives/{k}" for k in range(LOGS)
    ]
    Path("drives/2/odometry.csv").unlink()
    assert main(["validate", "drives.toml"]) == 2
    assert "drives/2/odometry.csv" in capsys.readouterr().out


# ------------------------------------------------------------------------------------------------------- from Python


@pytest.mark.usefixtures("no_report")
def test_logs_in_python_are_one_dataset(tmp_path: Path, worlds: list[Dataset]) -> None:
    groups = {"monday": worlds[:2], "tuesday": worlds[2:]}
    found = slamduel.run(backend="ekf", logs=groups, out=tmp_path / "out")
    assert [(cell["log_name"], cell["cluster"]) for cell in found.cells] == [
        ("log-0", "monday"), ("log-1", "monday"), ("log-2", "tuesday"), ("log-3", "tuesday"),
    ]  # fmt: skip
    assert [cell["digest"] for cell in found.cells] == [world.log.digest for world in worlds]
    again = slamduel.run(backend="ekf", logs=groups, out=tmp_path / "out")
    assert again.cells == found.cells
    for other in (worlds, {"monday": worlds[:3], "tuesday": worlds[3:]}):
        with pytest.raises(InputError, match=r"logs\.toml: names other logs or clusters, expected the same"):
            slamduel.run(backend="ekf", logs=other, out=tmp_path / "out")


@pytest.mark.usefixtures("no_report")
def test_they_may_be_paths_and_names_and_stand_beside_other_datasets(drives: Path, worlds: list[Dataset]) -> None:
    logs = [worlds[0].log, drives / "drives/1", "circle[steps=30]"]
    with pytest.raises(InputError, match="errors are not of one kind"):
        slamduel.run("circle", "ekf", logs=logs, seeds=2, out=drives / "out")
    assert not (drives / "out").exists()  # nor is what had been written for it
    found = slamduel.run("circle[steps=30]", "ekf", logs=[worlds[0], *logs[1:]], seeds=2, out=drives / "out")
    datasets = [cell["dataset"] for cell in found.cells]
    assert datasets == ["circle", "circle", "logs", "logs", "logs"]
    assert found.cells[0]["digest"] == found.cells[4]["digest"]


@pytest.mark.parametrize(
    ("logs", "said"),
    [
        ([], "logs is empty, expected at least one"),
        ({}, "logs is empty, expected at least one"),
        ({"monday": []}, "logs is empty, expected at least one"),
        ({6: ["circle"]}, "found the cluster 6 in logs, expected its name, a text"),
        ("circle", "logs has 'circle', expected a list: each a name, a path, a Log or"),
        ({"monday": "circle"}, "logs has 'circle', expected a list"),
        ([3], "logs is 3, expected a name, a path"),
        (["circle", "circle"], "found the same log twice, circle"),
        (["nothing"], "there is no dataset 'nothing'"),
        ([Path("gone")], "gone: there is no such folder"),
    ],
)
def test_what_python_cannot_mean_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, logs: object, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=said):
        slamduel.run(backend="ekf", logs=logs, out="out")  # pyright: ignore[reportArgumentType]
    assert not Path("out").exists()
