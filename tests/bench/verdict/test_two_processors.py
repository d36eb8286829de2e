"""The same run on two kinds of processors: logs are paired, and results are the same to rounding."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import older_machine
from slamduel.bench.verdict.changes import ROUNDED, SAME, changes
from slamduel.bench.verdict.pairing import paired_runs, side

pytestmark = pytest.mark.slow

ROOM, CIRCLE = "aruco-room[markers=12,seconds=8.0]", "circle[steps=500]"


def run(folder: Path, kind: str | None) -> Path:
    words = ["--backend", "ekf,isam2", "--dataset", f"{ROOM},{CIRCLE}", "--seeds", "1", "--quiet"]
    command = [sys.executable, "-m", "slamduel.bench.cli", "run", *words, "--out", str(folder)]
    env = os.environ | {"SLAMDUEL_CACHE": str(folder.with_suffix(".cache"))}
    subprocess.run(command, env=env | (older_machine.environment(kind) if kind else {}), check=True)
    return folder


def test_every_log_is_paired_and_nothing_has_changed(tmp_path: Path) -> None:
    here, there = side(run(tmp_path / "here", None)), side(run(tmp_path / "there", "nehalem"))
    there = there._replace(run={**there.run, "environment": there.run["environment"] | {"instructions": "sse4_2"}})
    found = paired_runs(here, there)
    assert [len(pair.cells) for pair in found.pairs] == [1] * 4
    rows = {pair.dataset: [row.columns["digest"] for row in pair.cells[0]] for pair in found.pairs}
    assert len(set(rows[CIRCLE])) == 1
    told = [change for change in changes(found) if change.kind in ("accuracy", "consistency")]
    assert {change.verdict for change in told if change.dataset == CIRCLE} <= {SAME, ROUNDED}
    assert not [change for change in told if change.beyond]
    assert any("different processors" in note for note in found.notes)
