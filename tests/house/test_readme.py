"""The README says what is so: its commands are taken, its names exist, its table is what the terminal prints."""

import argparse
import re
import shlex
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from places import ROOT
from random_logs import random_log
from slamduel.backends import registry as backends
from slamduel.bench.cli import COMMANDS
from slamduel.bench.plan.spec import backend_variants, dataset_variants
from slamduel.bench.record.schema import COLUMNS, MORE, Row
from slamduel.bench.run.terminal import tables
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.console import WIDE
from slamduel.datasets import registry as datasets
from slamduel.datasets.formats import log_folder

README = (ROOT / "README.md").read_text()


def commands() -> list[list[str]]:
    found = [line.strip().partition("#")[0] for line in README.splitlines() if line.startswith("    bench ")]
    assert len(found) > 6
    (log,) = re.findall(r"^    LOG='(.*)'$", README, re.MULTILINE)
    return [shlex.split(line.replace("$LOG", log)) for line in found]


def written() -> set[str]:
    """What earlier commands leave."""
    return {words[words.index("--out") + 1] for words in commands() if "--out" in words}


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_every_command_is_taken_and_names_what_exists(words: list[str]) -> None:
    parser = argparse.ArgumentParser()
    import_module(COMMANDS[words[1]][1], "slamduel.bench").arguments(parser)
    given: dict[str, list[str] | str] = vars(
        parser.parse_args(words[2:])
    )  # ends the test where an argument is not taken
    for names in (given.get("backend") or ()) if words[1] == "run" else ():
        for variant in backend_variants(names.replace("my_module:build", "graph")):
            assert variant.builder is not None, variant.missing
    named = given.get("dataset") or ()
    for name in [named] if isinstance(named, str) else named:
        assert "/" in name or name in written() or dataset_variants(name)


def test_every_name_is_told() -> None:
    for name in [*backends.BUILTIN, *(name for name in datasets.BUILTIN if name != "log")]:
        assert re.search(rf"^\| .*`{name}`.* \|$", README, re.MULTILINE), name


def test_every_link_leads_somewhere() -> None:
    links = [link for link in re.findall(r"\]\(([^)]+)\)", README) if "://" not in link]
    assert len(links) >= 4
    for link in links:
        assert (ROOT / link).exists(), link


def test_the_headings_of_the_table_are_the_terminals() -> None:
    values = dict.fromkeys((*COLUMNS, *MORE)) | {"dataset": "aruco-room", "dataset_options": "", "backend": "ekf"}
    values |= {"options": "", "seed": 0, "status": "done", "truth_kind": "truth", "ate_m": 0.015, "digest": "d"}
    (table,) = tables(lines([Row(values, "")]), WIDE)
    headings = [str(column.header) for column in table.columns]
    shown = next(line for line in README.splitlines() if line.strip().startswith("backend "))
    assert re.split(r"\s{2,}", shown.strip()) == headings


def test_the_log_folder_is_as_described(tmp_path: Path) -> None:
    log, truth = random_log(np.random.default_rng(1), 5, 3)
    log_folder.write(tmp_path / "log", log, truth)
    for name in ("odometry.csv", "sightings.csv", "landmarks.csv"):
        header = (tmp_path / "log" / name).read_text().splitlines()[0]
        assert re.search(rf"{name}\s+{re.escape(header)}\s", README), name
    assert (tmp_path / "log" / "log.toml").is_file()
    assert (tmp_path / "log" / "truth.tum").is_file()


@pytest.mark.usefixtures("no_report")
def test_the_python_in_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "from_arrays" in block]
    log, truth = random_log(np.random.default_rng(2), 25, 6)
    assert truth is not None
    names = ("t", "delta", "delta_cov", "sighting_step", "ids", "z", "z_cov")
    known = {name: getattr(log, name) for name in names} | {"poses": truth.poses}
    monkeypatch.chdir(tmp_path)
    exec(code.replace("cov=1e-6 * np.eye(3)", "cov=np.eye(3)"), known)
    assert known["path"].shape == (25, 3)
    assert len(known["log"]) == 6969
