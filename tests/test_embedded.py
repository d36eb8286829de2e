"""Runs on the two datasets that come along: what is promised of them, and evo's word on the figures."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evo_cli import evo
from slamduel.bench.cli import main
from slamduel.bench.plan import Cell, Plan
from slamduel.bench.runner import run
from slamduel.bench.store import Store


class Silent:
    """Watches and says nothing."""

    def preparing(self, logs: int) -> None: ...
    def prepared(self, name: str) -> None: ...
    def running(self, cells: int, before: int) -> None: ...
    def finished(self, cell: Cell, status: str, reason: str, row: dict[str, Any]) -> None: ...


def test_evo_prints_the_figures_of_the_table(tmp_path: Path) -> None:
    words = ["--backend", "dead-reckoning,ekf", "--dataset", "aruco-room,victoria-park", "--seeds", "1"]
    assert main(["run", *words, "--jobs", "2", "--quiet", "--out", str(tmp_path)]) == 0
    folders = json.loads((tmp_path / "run.json").read_text())["folders"]
    with (tmp_path / "cells.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    flat = ("--project_to_plane", "xy")
    for row in rows:
        assert row["status"] == "done"
        place = tmp_path / row["dataset"] / row["seed"]
        files = ("truth.tum", f"{folders[row['backend']]}/online.tum")
        assert evo("ape", place, *files, "-a", *flat) == pytest.approx(float(row["ate_m"]), abs=1e-6)
        assert evo("ape", place, *files, *flat) == pytest.approx(float(row["ate_origin_m"]), abs=1e-6)
    kinds = {row["dataset"]: row["truth_kind"] for row in rows}
    assert kinds == {"aruco-room": "truth", "victoria-park": "reference"}
    assert all((row["nees"] == "") == (row["truth_kind"] == "reference") for row in rows)


def test_fastslam_keeps_up_with_the_ekf_in_the_room(tmp_path: Path) -> None:
    """1,000 particles, the median over 10 logs of the ratio of the aligned online errors; and both beat odometry.

    This is FastSLAM 2.0: 1.0 draws its particles without a look at the sightings, and the finer these are the more it
    falls behind.
    """
    words = {
        "backend": "dead-reckoning,ekf,fastslam[particles=1000,version=2]",
        "dataset": "aruco-room",
        "seeds": 10,
        "timeout_s": 600.0,
        "memory_mb": 4000,
    }
    run(Plan.from_words(words), tmp_path / "run", 2, ["bench", "run"], Silent())
    with Store(tmp_path / "run") as store:
        rows = [row.columns for row in store.cells()]
    assert [row["status"] for row in rows] == ["done"] * 30
    errors = {
        name: np.array([row["ate_m"] for row in sorted(rows, key=lambda row: row["seed"]) if row["backend"] == name])
        for name in ("dead-reckoning", "ekf", "fastslam")
    }
    assert np.median(errors["fastslam"] / errors["ekf"]) <= 1.3
    assert np.median(errors["ekf"] / errors["dead-reckoning"]) < 0.25
