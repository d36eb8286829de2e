"""Logs from files at long paths: what the terminal, the report, its figures and a run's files call them."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from csv_rows import csv_rows
from slamduel.bench.plan.spec import dataset_variants
from slamduel.bench.record.store import Store
from slamduel.bench.replay.replay import choose
from slamduel.bench.report.report import write_report
from slamduel.bench.run.terminal import conclude
from slamduel.bench.verdict.summary import lines
from slamduel.core.errors import InputError
from small_run import go

ODOMETRY = "t,x,y,heading\n" + "".join(f"{k / 5},{k * 0.1},0,0\n" for k in range(30))
SEEN = "t,id,range,bearing\n" + "".join(f"{k / 5},7,{4 - k * 0.1},0.1\n" for k in range(30))


def drive(folder: Path) -> str:
    """The options of a small log in files of the usual names."""
    folder.mkdir(parents=True)
    (folder / "odometry.csv").write_text(ODOMETRY, encoding="utf-8")
    (folder / "detections.csv").write_text(SEEN, encoding="utf-8")
    (folder / "truth.csv").write_text(ODOMETRY, encoding="utf-8")
    return ",".join(f"{name}={folder}/{name}.csv" for name in ("odometry", "detections", "truth"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run on three logs, one of them with a name."""
    place = tmp_path_factory.mktemp("recordings-of-a-very-long-name")
    monday, friday = drive(place / "north" / "monday"), drive(place / "north" / "friday")
    again = drive(place / "south" / "monday")
    go(place / "run", "ekf", f"csv[{monday}],csv[{again}],csv[name=Friday 1,{friday}]", seeds=1)
    return place / "run"


def test_the_terminal_has_short_names(folder: Path) -> None:
    with Store(folder) as store:
        found = lines(store.cells())
    console = Console(width=100, record=True, file=io.StringIO())
    conclude(console, found)
    text = console.export_text()
    for name in ("north/monday, 1 log", "south/monday, 1 log", "Friday 1, 1 log"):
        assert name in text
    assert "odometry.csv" not in text


def test_the_report_has_them_in_headings_tables_and_figures(folder: Path) -> None:
    with Store(folder) as store:
        write_report(store)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<h2>Friday 1 " in page
    assert "<h2>north/monday " in page
    assert page.count("odometry.csv") == 3  # the values of the option, one per log
    figures = {path.name for path in (folder / "figures").iterdir()}
    assert any(name.startswith("Friday-1-") for name in figures)
    assert any(name.startswith("monday-") for name in figures)
    captions = "".join(path.read_text(encoding="utf-8") for path in (folder / "tables").iterdir())
    assert "Friday 1: " in captions
    assert "odometry.csv" not in captions


def test_the_files_have_them_and_those_of_one_name_are_apart(folder: Path) -> None:
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    places = [place for label, place in run["folders"].items() if label.startswith("csv")]
    assert sorted(place.rpartition("-")[0] for place in places) == ["Friday-1", "monday", "monday"]
    assert len(set(places)) == 3
    for place in places:
        assert (folder / place / "0" / "truth.tum").is_file()
        assert (folder / place / "0" / "ekf" / "online.tum").is_file()


def test_the_table_of_cells_has_the_dataset_as_it_was_asked_for(folder: Path) -> None:
    rows = csv_rows(folder / "cells.csv")
    assert {row["dataset"] for row in rows} == {"csv"}
    options = {row["dataset_options"] for row in rows}
    assert any(given.startswith("name=Friday 1,odometry=/") for given in options)
    assert all("detections.csv" in given for given in options)


def test_a_replay_finds_a_log_by_its_name(folder: Path) -> None:
    with Store(folder) as store:
        for name, place in (
            ("Friday 1", "north/friday/"),
            ("north/monday", "north/monday/"),
            ("south/monday", "south/"),
        ):
            assert place in choose(store, name, None, None).cells[0].dataset.label
        with pytest.raises(InputError, match=r"^--dataset friday: is not in this run, expected one of csv"):
            choose(store, "friday", None, None)


def test_a_name_changes_nothing_else(folder: Path) -> None:
    digests = [row["digest"] for row in csv_rows(folder / "cells.csv")]
    assert len(set(digests)) == 1  # the three drives are copies


@pytest.mark.parametrize("name", ["", " ", "a\nb", "x" * 41])
def test_a_name_that_no_table_can_have_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"^dataset log: option name is "):
        dataset_variants(f'log[path=x,name="{name}"]')
