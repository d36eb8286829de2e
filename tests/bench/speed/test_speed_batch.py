"""`bench speed --batch`: both solvers from the same start, and no ratio where they end apart."""

from pathlib import Path

import numpy as np
import pytest

from random_logs import random_log
from slamduel.bench.cli import main
from slamduel.bench.speed import batch
from slamduel.bench.speed.batch import Run, SolverRow, geometric_mean, measured, started


@pytest.mark.parametrize("start", batch.STARTS)
def test_both_solvers_end_at_the_minimum_from_the_same_start(start: str) -> None:
    log = random_log(np.random.default_rng(1), 60, 8, noise=0.3).log
    row = measured("random", log, start, 1)
    assert row.own.cost == pytest.approx(row.gtsam.cost, rel=1e-3)
    assert row.ratio > 0
    path, landmarks = started(log, start)
    assert path.shape == (60, 3)
    assert set(landmarks.ids.tolist()) == set(log.ids.tolist())


def test_times_to_different_minima_are_not_compared() -> None:
    rows = [
        SolverRow("a", "odometry", Run(2.0, 10.0), Run(8.0, 10.001)),
        SolverRow("b", "odometry", Run(2.0, 10.0), Run(1.0, 90.0)),
    ]
    rows.append(SolverRow("c", "odometry", Run(1.0, 5.0), Run(np.inf, np.inf)))
    assert [row.ratio for row in rows] == [4.0, None, None]
    assert geometric_mean(rows) == pytest.approx(4.0)


def test_it_prints_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(batch, "LOGS", {"city[landmarks=40,steps=60]": {"landmarks": 40, "steps": 60}})
    assert main(["speed", "--batch", "--quick", "--csv", str(tmp_path / "batch.csv")]) == 0
    assert "GTSAM / own" in capsys.readouterr().out
    lines = (tmp_path / "batch.csv").read_text().splitlines()
    assert lines[0] == "log,start,own_ms,own_j,gtsam_ms,gtsam_j"
    assert [line.split(",")[2] for line in lines[1:]] == ["incremental", "odometry"]  # the log's name has a comma
