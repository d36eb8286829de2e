"""A new column is an entry of the table and the line that computes it, as CONTRIBUTING says: the rest follows."""

import csv
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from places import ROOT, SUPPORT

SCRIPT = """
import sqlite3
import sys
from pathlib import Path

import numpy as np

from random_logs import random_log
from slamduel.backends import registry
from slamduel.bench.claims.words import sized
from slamduel.bench.measure.cell import Job, run_on
from slamduel.bench.record.files import export
from slamduel.bench.report.report import write_report
from slamduel.bench.study.checks import MEASURES
from small_record import Record

log, truth = random_log(np.random.default_rng(1), 40, 8)
name = "oracle_backends:true_poses"
job = Job(name, name, registry.find(name).options(needs=False), 0, 100_000)
result = run_on(job, lambda: log, lambda: truth)
assert result.status == "done", result.reason
run, failed = (Record(Path(sys.argv[1]) / name) for name in ("run", "failed"))
run.cell("room", "truth", name, **result.row)
export(run.store)
failed.failed("room", "truth", name, "diverged", "lost")  # of which there are no figures to wait for
write_report(failed.store)
assert "path_m" in MEASURES
assert sized(1.5, "path_m") == "1.50 m"
"""


def examples() -> tuple[str, str]:
    """The entry and the line of code that CONTRIBUTING gives."""
    section = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Adding a column\n")[2]
    entry, value = re.findall(r"^ {4}(\S.*)$", section.partition("\n## ")[0], re.MULTILINE)
    return entry, value


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a package that has the column in addition writes: a run's files, a report, a study's tables."""
    folder = tmp_path_factory.mktemp("column")
    bench = folder / "slamduel" / "bench"
    bench.mkdir(parents=True)
    for place in ("__init__.py", "backends", "datasets", "frontend"):
        (folder / "slamduel" / place).symlink_to(ROOT / place)
    for place in (ROOT / "bench").iterdir():
        if place.name in ("words", "measure"):
            shutil.copytree(place, bench / place.name)
        else:
            (bench / place.name).symlink_to(place)
    entry, value = examples()
    insert(bench / "words" / "columns.py", f"    {entry}\n", before=')\n"""The columns of metrics.csv after')
    insert(bench / "measure" / "score.py", f"    {value}\n", before="    return Score(")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(folder), str(SUPPORT)))}
    command = [sys.executable, "-c", SCRIPT, str(folder)]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def insert(file: Path, line: str, *, before: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert text.count(before) == 1
    file.write_text(text.replace(before, line + before), encoding="utf-8")


def test_it_is_the_last_of_metrics_csv_with_its_value(made: Path) -> None:
    with (made / "run" / "metrics.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert list(row)[-1] == "path_m"
    assert float(row["path_m"]) > 1


def test_the_files_of_runs_and_studies_have_it(made: Path) -> None:
    types: dict[str, str] = {}
    with sqlite3.connect(made / "run" / "results.sqlite") as db:
        for table in ("results", "cells"):
            types[table] = {row[1]: row[2] for row in db.execute(f"PRAGMA table_info({table})")}["path_m"]
    db.close()
    assert types == {"cells": "REAL", "results": "REAL"}


@pytest.mark.parametrize("name", ["report.html", "report.md"])
def test_a_report_defines_it(made: Path, name: str) -> None:
    assert "Length of the online path. In m." in (made / "failed" / name).read_text(encoding="utf-8")
