"""README and docs say what is so: commands are taken, files and names exist, Python runs, tables are those of today."""

import argparse
import re
import runpy
import sys
from importlib import import_module
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from docs_pages import PAGES, blocks
from places import ROOT
from random_logs import random_log
from recorded import at_hand
from slamduel import load, run
from slamduel.backends import registry
from slamduel.bench.check.suite import check
from slamduel.bench.cli import COMMANDS, main
from slamduel.bench.plan.spec import backend_variants, dataset_variants
from slamduel.bench.record.schema import COLUMNS, MORE, Row
from slamduel.bench.run.terminal import tables
from slamduel.bench.suite import file as suite_file
from slamduel.bench.suite.best import UNCLEAR
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.console import WIDE
from slamduel.bench.words.numerals import number
from slamduel.datasets.formats import log_folder
from svg_texts import texts

README = PAGES["README.md"]
BESIDE = {"CONTRIBUTING.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")}
SHOWN = [(page, words) for page in PAGES for block in blocks(page) for words in block]


def written() -> set[str]:
    """What the commands leave."""
    return {words[words.index("--out") + 1] for _, words in SHOWN if "--out" in words}


@pytest.mark.parametrize(("page", "words"), SHOWN, ids=[" ".join((page, *words)) for page, words in SHOWN])
def test_every_command_is_taken_and_names_what_exists(page: str, words: list[str]) -> None:
    parser = argparse.ArgumentParser()
    import_module(COMMANDS[words[0]][1], "slamduel.bench").arguments(parser)
    given: dict[str, list[str] | str] = vars(parser.parse_args(words[1:]))  # ends it where an argument is not taken
    for names in (given.get("backend") or ()) if words[0] == "run" else ():
        for variant in backend_variants(names.replace("my_module:build", "graph")):
            assert variant.builder is not None, variant.missing
    named = given.get("dataset") or ()
    for name in [named] if isinstance(named, str) else named:
        assert "/" in name or name.endswith(".toml") or name in written() or dataset_variants(name)


def test_the_page_of_commands_shows_every_one() -> None:
    assert {words[0] for page, words in SHOWN if page == "docs/commands.md"} == set(COMMANDS) | {"run"}


@pytest.mark.parametrize("page", [*PAGES, *BESIDE])
def test_every_link_leads_somewhere(page: str) -> None:
    text = (PAGES | BESIDE)[page]
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)|src=\"([^\"]+)\"", text) if "://" not in link[0]]
    for link in links:
        assert ((ROOT / page).parent / "".join(link)).exists(), link


@pytest.mark.parametrize("page", [*PAGES, *BESIDE])
def test_every_file_that_is_named_exists(page: str) -> None:
    text = re.sub(r"```.*?```", "", (PAGES | BESIDE)[page], flags=re.DOTALL)
    named = re.findall(r"`((?:backends|bench|datasets|docs|frontend|tests)/[\w./-]*\w/?)`", text)
    files = {"bench/study/studies/NAME.toml", "bench/suite/suites/NAME.toml"}
    added = {*files, *re.findall(r"such as\s`([\w/.]+)`:\n", text)}
    assert [name for name in named if name not in added and not (ROOT / name).exists()] == []


def test_every_page_is_linked_from_the_first() -> None:
    first = PAGES["docs/index.md"]
    pages = [Path(page).stem for page in PAGES if page not in {"README.md", "docs/index.md"}]
    assert [page for page in pages if f"\n{page}\n" not in first] == []  # in the site's contents
    assert "(docs/index.md)" in README


def test_the_generated_parts_are_as_make_docs_tables_writes_them() -> None:
    written: dict[Path, str] = runpy.run_path(str(ROOT / "docs" / "tables.py"))["pages"]()
    assert {path.name for path in written} == {
        "backends.md", "datasets.md", "studies.md", "standing.md",
        "online.svg", "online-cost.svg", "afterwards.svg", "afterwards-cost.svg", "map.svg",
    }  # fmt: skip
    for path, text in written.items():
        found = path.read_text(encoding="utf-8")
        if path.suffix == ".svg":  # their places depend on the fonts that are here
            assert texts(found) == texts(text), "make docs-tables draws it anew"
        else:
            assert found == text, "make docs-tables writes it anew"


def test_the_tables_of_the_results_agree_with_each_other() -> None:
    folder = ROOT / "docs" / "standing"
    named, backends, runs = map(csv_rows, (ROOT / "docs/standing.csv", folder / "backends.csv", folder / "runs.csv"))
    key = itemgetter("suite", "run", "dataset", "purpose")
    frames = {key(row): row for row in backends if row["named"] == "1"}
    for row in named:
        frame = frames.pop(key(row), None)
        if frame is None:
            assert not row["backend"] or row["purpose"] == "map"
            continue
        assert frame["backend"] == row["backend"]
        assert row["error"] == f"{number(float(frame['error_m']))} m"
        assert row["consistency"] in (frame["consistency"], UNCLEAR, "")
    assert frames == {}
    made = {(row["suite"], row["run"]) for row in runs if row["state"] == "made"}
    assert {(row["suite"], row["run"]) for row in backends} <= made


def test_the_results_are_those_of_the_suites_of_today() -> None:
    runs = csv_rows(ROOT / "docs/standing/runs.csv")
    assert {row["suite"] for row in runs} == set(suite_file.packaged())
    for row in (row for row in runs if row["state"] == "made"):
        commands = {run.name: run.command for run in suite_file.read(row["suite"]).runs}
        again = f"bench suite {row['suite']}, then bench suite --standing docs/standing.md"
        assert row["command"] == commands.get(row["run"]), again


def test_the_headings_of_the_table_are_the_terminals() -> None:
    values = dict.fromkeys((*COLUMNS, *MORE)) | {"dataset": "aruco-room", "dataset_options": "", "backend": "ekf"}
    values |= {"options": "", "seed": 0, "status": "done", "truth_kind": "truth", "ate_m": 0.015, "digest": "d"}
    (table,) = tables(lines([Row(values, "")]), WIDE)
    headings = [str(column.header) for column in table.columns]
    shown = next(line for line in README.splitlines() if line.strip().startswith("backend "))
    assert re.split(r"\s{2,}", shown.strip()) == headings


def test_the_readmes_table_is_the_one_of_the_results() -> None:
    shown = re.findall(r"^ {6}[\w-]+ +10/10 .*$", README, re.MULTILINE)
    assert len(shown) == 5
    assert [line for line in shown if line not in PAGES["docs/results.md"]] == []


def test_the_log_folder_is_as_described(tmp_path: Path) -> None:
    log, truth = random_log(np.random.default_rng(1), 5, 3)
    log_folder.write(tmp_path / "log", log, truth)
    for name in ("odometry.csv", "sightings.csv", "landmarks.csv"):
        header = (tmp_path / "log" / name).read_text().splitlines()[0]
        assert re.search(rf"{name}\s+{re.escape(header)}\s", PAGES["docs/own_log.md"]), name
    assert (tmp_path / "log" / "log.toml").is_file()
    assert (tmp_path / "log" / "truth.tum").is_file()


def python(page: str) -> str:
    (code,) = re.findall(r"```python\n(.*?)```", PAGES[page], re.DOTALL)
    return code


def test_every_block_of_python_is_run_here() -> None:
    run = {"README.md", "docs/own_log.md", "docs/own_map.md", "docs/own_recordings.md"}
    assert {page for page, text in PAGES.items() if "```python" in text} == run


@pytest.mark.usefixtures("no_report")
def test_the_python_with_a_log_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, truth = random_log(np.random.default_rng(2), 25, 6)
    names = ("t", "delta", "delta_cov", "sighting_step", "ids", "z", "z_cov")
    known = {name: getattr(log, name) for name in names} | {"poses": truth.poses}
    monkeypatch.chdir(tmp_path)
    exec(python("docs/own_log.md").replace("cov=1e-6 * np.eye(3)", "cov=np.eye(3)"), known)
    assert known["path"].shape == (25, 3)
    assert len(known["log"]) == 6969


@pytest.fixture
def rover(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands of the page on recordings, in a folder with what its Python makes of the rover's files."""
    data = at_hand("diddyborg")
    monkeypatch.chdir(tmp_path)
    exec(python("docs/own_recordings.md"), {"data": str(data)})
    (found,) = blocks("docs/own_recordings.md")
    return found


@pytest.mark.usefixtures("no_report")
def test_the_files_of_a_rover_become_a_log(rover: list[list[str]]) -> None:
    log, truth = load(rover[0][1])
    assert (len(log), len(log.ids), len(np.unique(log.ids))) == (386, 770, 21)
    (outside,) = log.remarks
    assert "192 of 962 detections (20 %)" in outside
    assert log.gyro is not None
    assert np.rad2deg(log.gyro.prior.mean) == pytest.approx(0.186, abs=0.005)
    assert run(log, "ekf", truth=truth).cells[0]["map_rmse_m"] == pytest.approx(0.083, abs=5e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("no_report")
def test_the_rovers_map_is_better_with_the_errors_that_its_log_tells(
    rover: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    _, noise, apply, _ = rover
    assert "landmarks" not in noise[1]
    assert main(noise) == 0
    page, printed = PAGES["docs/own_recordings.md"], capsys.readouterr().out
    said = re.findall(r"^The (?:sensor sits|odometry turns).*$", printed, re.MULTILINE)
    assert [one.partition(" ± ")[0] for one in said] == re.findall(r"^ {4}(The .*?) ± ", page, re.MULTILINE)
    assert main(apply) == 0
    log, truth = load("stated/")
    assert log.gyro is not None
    assert run(log, "ekf", truth=truth).cells[0]["map_rmse_m"] < 0.045


@pytest.mark.slow
@pytest.mark.usefixtures("no_report")
def test_the_owners_map_is_mended_and_better_with_the_errors_that_its_log_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data = at_hand("mbot")
    monkeypatch.chdir(tmp_path)
    exec(python("docs/own_map.md"), {"log": str(data)})
    page, ((validate,), (noise, _)) = PAGES["docs/own_map.md"], blocks("docs/own_map.md")
    assert main(validate) == 0
    assert main(noise) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "the true places of landmarks 5 and 6 look swapped" in printed
    said = re.findall(r"^ {4}((?:The |Ranges ).*?)([\d.]+) ± [\d.]+ (.*)$", page, re.MULTILINE)
    assert len(said) == 6
    for words, stated, which in said:  # the last digit of a number is not the same on every machine
        found = re.search(re.escape(words) + r"([\d.]+) ± [\d.]+ " + re.escape(which), printed)
        assert found is not None, (words, which)
        assert float(found[1]) == pytest.approx(float(stated), rel=0.02)
    log, truth = load("corrected/")
    assert run(log, "graph", truth=truth).cells[0]["final_map_rmse_m"] < 0.015


def test_the_backend_conforms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_module.py").write_text(python("README.md"))
    monkeypatch.syspath_prepend(tmp_path)
    builder = registry.find("my_module:build")
    monkeypatch.delitem(sys.modules, "my_module")
    assert [outcome for outcome in check(builder) if outcome.status == "failed"] == []
