"""The two datasets that come along: what is promised of them, and evo's word on the figures."""

import json
from pathlib import Path

import numpy as np
import pytest

from csv_rows import csv_rows
from driven import aligned_error, run
from evo_cli import evo
from room_drives import room_drive
from slamduel.bench.cli import main
from slamduel.bench.record.schema import label

LOGS = 5


@pytest.mark.slow
@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize(
    ("dataset", "backends", "kind"),
    [
        ("aruco-room[seconds=10,frame_rate=2]", ["dead-reckoning", "ekf"], "truth"),
        ("victoria-park", ["dead-reckoning"], "reference"),
    ],
)
def test_evo_prints_the_figures_of_the_table(tmp_path: Path, dataset: str, backends: list[str], kind: str) -> None:
    words = ["--backend", ",".join(backends), "--dataset", dataset, "--seeds", "1"]
    assert main(["run", *words, "--jobs", "2", "--quiet", "--out", str(tmp_path)]) == 0
    folders = json.loads((tmp_path / "run.json").read_text())["folders"]
    rows = csv_rows(tmp_path / "cells.csv")
    assert [row["status"] for row in rows] == ["done"] * len(backends)
    commands: list[tuple[str, ...]] = []
    for row in rows:
        place = f"{folders[label(row['dataset'], row['dataset_options'])]}/{row['seed']}"
        files = (f"{place}/truth.tum", f"{place}/{folders[row['backend']]}/online.tum", "--project_to_plane", "xy")
        commands += [("ape", *files, "-a"), ("ape", *files)]
    table = [float(row[name]) for row in rows for name in ("ate_m", "ate_origin_m")]
    assert evo(tmp_path, *commands) == pytest.approx(table, abs=1e-6)
    assert {row["truth_kind"] for row in rows} == {kind}
    assert all((row["nees"] == "") == (kind == "reference") for row in rows)


@pytest.mark.slow
def test_fastslam_keeps_up_with_the_ekf_in_the_room() -> None:
    """2.0 with 1,000 particles, the median over 5 logs of the ratio of the aligned online errors; both beat odometry.

    1.0 draws its particles without a look at the sightings, and the finer these are the more it falls behind.
    """
    errors = {name: np.zeros(LOGS) for name in ("dead-reckoning", "ekf", "fastslam")}
    for seed in range(LOGS):
        made, truth = room_drive(seed)
        for name, found in errors.items():
            options = {"particles": 1000, "version": 2} if name == "fastslam" else {}
            found[seed] = aligned_error(run(name, made.log, seed, **options)[1], truth.poses)
    assert np.median(errors["fastslam"] / errors["ekf"]) <= 1.3
    assert np.median(errors["ekf"] / errors["dead-reckoning"]) < 0.25
