"""`bench run --oracle`: backends that ask are given the ground truth, and their rows say so."""

import json
from pathlib import Path

import numpy as np
import pytest

from command import refused
from random_logs import random_log
from slamduel.bench.cli import main
from slamduel.bench.measure.cell import TOLD
from slamduel.bench.record.schema import Row
from slamduel.bench.record.store import Store
from slamduel.datasets.formats import log_folder as logfile

BACKEND = "oracle_backends:true_poses"
WITHOUT = f"{BACKEND}[needs=false]"


@pytest.fixture(scope="module")
def log_without_truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs") / "without-truth"
    logfile.write(folder, random_log(np.random.default_rng(1), 40, 8).log, None)
    return folder


def go(out: Path, *words: str | Path) -> dict[str, Row]:
    """Run without a word, and the rows by backend variant."""
    assert main(["run", "--quiet", *map(str, words), "--out", str(out)]) == 0
    return rows(out)


def rows(out: Path) -> dict[str, Row]:
    with Store(out) as store:
        return {f"{row.columns['backend']}[{row.columns['options']}]": row for row in store.cells()}


def test_a_row_whose_backend_used_the_truth_is_marked(tmp_path: Path, log_folder: Path) -> None:
    out = tmp_path / "run"
    words = ("--backend", f"dead-reckoning,{BACKEND},{WITHOUT}", "--dataset", log_folder, "--oracle")
    found = go(out, *words)
    assert {row.columns["status"] for row in found.values()} == {"done"}
    told = found[f"{BACKEND}[]"]
    assert (told.columns["told"], told.columns["reason"]) == (1, TOLD)
    assert told.columns["ate_origin_m"] == 0
    unused = found[WITHOUT].columns  # told as well
    assert (unused["told"], unused["reason"]) == (0, "")
    assert found["dead-reckoning[]"].columns["reason"] == ""
    assert json.loads((out / "run.json").read_text())["plan"]["oracle"] is True
    for report in ("report.md", "report.html"):
        assert TOLD in (out / report).read_text()


@pytest.mark.usefixtures("no_report")
def test_without_the_flag_nobody_is_told(tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    words = ["run", "--backend", f"{BACKEND},{WITHOUT}", "--dataset", str(log_folder), "--out", str(out)]
    assert main(words) == 0
    found = rows(out)
    wanted = found[f"{BACKEND}[]"].columns
    assert (wanted["status"], wanted["ate_m"]) == ("skipped", None)
    assert wanted["reason"] == "needs=true linearises at the truth, expected --oracle"
    assert wanted["steps"] == 40
    assert found[WITHOUT].columns["status"] == "done"
    assert json.loads((out / "run.json").read_text())["plan"]["oracle"] is False
    assert "expected --oracle" in capsys.readouterr().out


@pytest.mark.usefixtures("no_report")
def test_a_log_without_ground_truth_has_none_to_give(tmp_path: Path, log_without_truth: Path) -> None:
    """The batch optimum that errors are measured from there is no truth."""
    found = go(tmp_path / "run", "--backend", f"{BACKEND},{WITHOUT}", "--dataset", log_without_truth, "--oracle")
    wanted = found[f"{BACKEND}[]"].columns
    assert (wanted["status"], wanted["truth_kind"]) == ("skipped", "reference")
    assert wanted["reason"] == "--oracle: this log has no ground truth"
    assert found[WITHOUT].columns["status"] == "done"


@pytest.mark.usefixtures("no_report")
def test_a_run_that_goes_on_tells_it_still(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    words = ("--backend", f"{BACKEND},{WITHOUT}", "--dataset", log_folder)
    go(out, *words, "--oracle")
    with Store(out, writing=True) as store, store.together() as record:
        record.execute("DELETE FROM results")
    found = go(out)
    assert found[f"{BACKEND}[]"].columns["reason"] == TOLD
    assert go(out, *words, "--oracle") == found


@pytest.mark.usefixtures("no_report")
def test_a_run_without_it_does_not_become_one_with_it(
    tmp_path: Path, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    go(out, "--backend", WITHOUT, "--dataset", log_folder)
    assert "holds a run with oracle False, found oracle True" in refused(capsys, "run", "--oracle", "--out", out)
