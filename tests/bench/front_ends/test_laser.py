"""`bench speed --frontend --only laser`: its figures, against others worked out here."""

import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import carmen_files
from csv_rows import csv_rows
from matrix_errors import judges_as_matrices_do, matrix
from slamduel.bench.cli import main
from slamduel.bench.front_ends import laser
from slamduel.bench.front_ends.laser import PARTS, LaserDrive, LaserExtent, LaserStudy, consistency, scan_cost
from slamduel.bench.front_ends.laser_references import icp, tried
from slamduel.datasets.worlds.laser_floor import Options, laser_floor
from slamduel.frontend.laser.submap import Submap

SHORT, CLOSED = 0.3, 1.3
"""Laps: without a loop, and with some."""


@cache
def study(laps: float) -> LaserStudy:
    return LaserStudy(3, LaserExtent(1, laps, 200, 3, 1))


@cache
def drives(laps: float) -> list[LaserDrive]:
    return study(laps).drives(lambda: None)


@pytest.mark.parametrize("laps", [SHORT, pytest.param(CLOSED, marks=pytest.mark.slow)])
def test_errors_and_nees_are_those_of_the_log_that_a_run_gets(laps: float) -> None:
    """By homogeneous matrices, one factor after another, from the dataset of the same drive."""
    made = laser_floor(Options(laps=laps), np.random.default_rng([3, 0, 0]))
    log, truth = made.log, made.truth
    frames = [matrix(pose) for pose in truth.poses]
    at = np.repeat(np.arange(len(log)), np.diff(log.loop_first))
    factors = {
        "step": [(k - 1, k, log.delta[k], log.delta_cov[k]) for k in range(1, len(log))],
        "loop": list(zip(log.loop_to, at, log.loop_delta, log.loop_cov, strict=True)),
    }
    found = {row.kind: row for row in consistency(drives(laps))}
    factors = {kind: of_kind for kind, of_kind in factors.items() if len(of_kind)}
    assert list(found) == list(factors)
    assert laps == SHORT or "loop" in factors
    for kind, of_kind in factors.items():
        row = found[kind]
        judges_as_matrices_do(row, [(frames[one], frames[other], *rest) for one, other, *rest in of_kind])
        assert row.stated == pytest.approx(np.sqrt([np.mean([f[3][i, i] for f in of_kind]) for i in range(3)]).tolist())


@pytest.mark.slow
def test_parts_are_within_the_whole_and_none_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    done = drives(CLOSED)
    monkeypatch.setattr(laser.time, "thread_time_ns", itertools.count(0, 2_000_000).__next__)
    row = scan_cost(done, lambda: None)
    assert row.log == "laser-floor"
    assert row.scans == sum(len(drive.recording.t) for drive in drives(CLOSED))
    assert all(part > 0 for part in row.parts)
    assert len(row.parts) == len(PARTS)
    assert sum(row.parts) < row.mean
    assert row.median <= row.p99
    assert row.icp == pytest.approx(2.0)  # ms, between two looks at that clock


def test_a_search_finds_what_trying_every_pose_does() -> None:
    row = study(SHORT).searches(drives(SHORT), lambda: None)
    assert (row.searches, row.compared, row.same) == (3, 1, 1)
    assert row.ratio > 1
    submap, search = laser.search_case(drives(SHORT)[0], np.random.default_rng(5))
    small = search._replace(window=0.4, turn=0.06)
    _, score = submap.best(small, 0.0)
    assert 0 < score == tried(small, submap)
    assert isinstance(submap, Submap)


def test_the_reference_lays_a_scan_on_the_one_before() -> None:
    before = np.random.default_rng(0).uniform(-5, 5, (100, 2))
    c, s = np.cos(0.03), np.sin(0.03)
    now = (before - (0.05, -0.04)) @ np.array([[c, -s], [s, c]])
    assert icp(before, now) == pytest.approx([0.05, -0.04, 0.03], abs=1e-9)


def test_the_command_prints_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = carmen_files.written(tmp_path / "corridor.clf", drives(SHORT)[0].recording)
    monkeypatch.setattr(laser, "QUICK", LaserExtent(1, 0.3, 150, 2, 1))
    monkeypatch.setattr(LaserStudy, "warm_up", lambda _: None)
    table = tmp_path / "t.csv"
    arguments = ["--frontend", "--only", "laser", "--quick", "--scans", str(log), "--csv", str(table)]
    assert main(["speed", *arguments]) == 0
    said = capsys.readouterr().out
    for words in ("CPU time of a laser scan", "corridor", "150", "loop search", "±7 m", "true | stated", "step"):
        assert words in said
    rows = csv_rows(table)
    assert [row["study"] for row in rows] == ["laser scan"] * 2 + ["laser search", "laser step"]
    assert [row["log"] for row in rows[:2]] == ["laser-floor", "corridor"]
    assert rows[1]["count"] == "150"
    assert float(rows[0]["ratio"]) == pytest.approx(float(rows[0]["mean_ms"]) / float(rows[0]["reference_ms"]))
    assert float(rows[3]["nees"]) > 0
