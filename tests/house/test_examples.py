"""The examples of CONTRIBUTING do what it says: one file and one line each, and the rest follows."""

import csv
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from places import ROOT

SCRIPT = """
import contextlib
import json
from pathlib import Path

from slamduel.backends import registry as backends
from slamduel import check
from slamduel.bench.claims.words import sized
from slamduel.bench.cli import main
from slamduel.bench.plan.spec import describe
from slamduel.bench.study.checks import MEASURES
from slamduel.datasets import registry as datasets

run = "run --executor here --quiet --seeds 2 --dataset corridor --out run --backend"
commands = {"help": ["--help"], "length": ["length", "corridor[steps=51]"]}
commands["run"] = [*run.split(), "scaled-odometry,scaled-odometry[scale=0.9]"]
for name, words in commands.items():
    with Path(f"{name}.txt").open("w") as file, contextlib.redirect_stdout(file), contextlib.suppress(SystemExit):
        assert main(words) == 0, words
builder, source = backends.find("scaled-odometry"), datasets.find("corridor")
found = {"checks": [one[:4] for one in check(builder) if one.status == "failed"]}
found |= {"measures": list(MEASURES), "sized": sized(1.5, "path_m"), "whose": builder.implementation}
found |= {"options": [describe(one.options) for one in (builder, source)]}
Path("found.json").write_text(json.dumps(found))
"""


class Example(NamedTuple):
    """A section of CONTRIBUTING, and where its line goes: at the end of what begins in a file."""

    section: str
    file: str
    begins: str
    ends: str = "\n}\n"


EXAMPLES = (
    Example("a column", "bench/words/columns.py", "\nMETRICS", "\n)  # fmt: skip\n"),
    Example("a column", "bench/measure/score.py", "\ndef score(", "\n    return Score("),
    Example("a command", "bench/cli.py", "\nCOMMANDS"),
    Example("a backend", "backends/registry.py", "\nBUILTIN"),
    Example("a dataset", "datasets/registry.py", "\nBUILTIN"),
    Example("a figure", "bench/report/figures.py", "\nFIGURES"),
)


def lines_of(section: str) -> dict[str, str]:
    """The lines that a section of CONTRIBUTING adds, by the file they go to."""
    return dict(re.findall(r"`([\w/]+\.py)`:\n\n {4}(\S.*)\n", text_of(section)))


def files_of(section: str) -> dict[str, str]:
    """The files that a section of CONTRIBUTING adds, by their paths."""
    return dict(re.findall(r"`([\w/]+\.py)`:\n\n```python\n(.*?)```\n", text_of(section), re.DOTALL))


def text_of(section: str) -> str:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition(f"\n## Adding {section}\n")[2]
    return text.partition("\n## ")[0]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a package with all the examples in it writes."""
    folder = tmp_path_factory.mktemp("examples")
    package = folder / "slamduel"
    package.symlink_to(ROOT)
    for example in EXAMPLES:
        line = lines_of(example.section)[example.file]
        insert(own(package, example.file), f"\n    {line}", example.begins, example.ends)
        for path, text in files_of(example.section).items():
            own(package, path).write_text(text, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def own(package: Path, path: str) -> Path:
    """The file of that path as one that may be written: the folders on the way are links no more, nor is the file."""
    place = package
    for part in ("", *Path(path).parts):
        place /= part
        if place.is_symlink():
            there = place.resolve()
            place.unlink()
            if there.is_dir():
                place.mkdir()
                for child in there.iterdir():
                    (place / child.name).symlink_to(child)
            else:
                shutil.copy(there, place)
    return place


@pytest.fixture(scope="module")
def found(made: Path) -> dict[str, Any]:
    """What such a package says of itself."""
    return json.loads((made / "found.json").read_text())


def insert(file: Path, line: str, begins: str, ends: str) -> None:
    before, begin, rest = file.read_text(encoding="utf-8").partition(begins)
    inside, end, after = rest.partition(ends)
    assert begin
    assert end
    file.write_text("".join((before, begin, inside, line, end, after)), encoding="utf-8")


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as opened:
        return list(csv.DictReader(opened))


def test_a_column_is_the_last_of_metrics_csv_with_its_value(made: Path) -> None:
    found = rows(made / "run" / "metrics.csv")
    assert {list(row)[-1] for row in found} == {"path_m"}
    lengths = {row["options"]: float(row["path_m"]) for row in found if row["seed"] == "0"}
    assert lengths["scale=0.9"] == pytest.approx(0.9 * lengths[""])


def test_the_record_has_the_column(made: Path) -> None:
    types: dict[str, str] = {}
    with sqlite3.connect(made / "run" / "results.sqlite") as db:
        for table in ("results", "cells"):
            types[table] = {row[1]: row[2] for row in db.execute(f"PRAGMA table_info({table})")}["path_m"]
    db.close()
    assert types == {"cells": "REAL", "results": "REAL"}


@pytest.mark.parametrize("name", ["report.html", "report.md"])
def test_a_report_defines_the_column(made: Path, name: str) -> None:
    assert "Length of the online path. In m." in (made / "run" / name).read_text(encoding="utf-8")


def test_claims_and_their_sentences_know_the_column(found: dict[str, Any]) -> None:
    assert "path_m" in found["measures"]
    assert found["sized"] == "1.50 m"


def test_a_command_is_listed_and_answers(made: Path) -> None:
    assert re.search(r"^ +length +length of a log", (made / "help.txt").read_text(), re.MULTILINE)
    assert float((made / "length.txt").read_text().split()[0]) == pytest.approx(5, abs=0.5)


def test_a_backend_and_a_dataset_have_their_options(found: dict[str, Any]) -> None:
    assert [[name for name, _, _ in options] for options in found["options"]] == [["scale"], ["steps", "noise"]]
    assert found["whose"] == "NumPy"


def test_a_backend_conforms(found: dict[str, Any]) -> None:
    assert found["checks"] == []


def test_a_backend_runs_on_a_dataset(made: Path) -> None:
    found = rows(made / "run" / "cells.csv")
    assert {row["status"] for row in found} == {"done"}
    errors = {(row["options"], row["seed"]): float(row["ate_m"]) for row in found}
    assert all(errors["scale=0.9", seed] > 2 * errors["", seed] for seed in "01")
    assert len({row["digest"] for row in found}) == 2


def test_a_figure_is_in_the_report_and_beside_it(made: Path) -> None:
    assert "Distance from the start" in (made / "run" / "report.html").read_text(encoding="utf-8")
    assert (made / "run" / "figures" / "corridor-distance.svg").is_file()
