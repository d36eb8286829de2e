"""`bench speed --association`: steps with ids and without, in turns. Nothing here asserts a time."""

import csv
from pathlib import Path

import numpy as np
import pytest

from slamduel.backends import registry
from slamduel.bench.cli import main
from slamduel.bench.measure.drive import WARM_UP
from slamduel.bench.speed import process
from slamduel.bench.speed.association import (
    AT,
    COLUMNS,
    Added,
    AssociationRow,
    added,
    as_csv,
    expectations,
    measure,
    of_one_form,
)
from slamduel.bench.speed.process import Process, Stretch, Subject
from slamduel.bench.speed.timing import Timing
from slamduel.bench.speed.world import without_ids, world
from slamduel.core.factors import UNKNOWN

LITTLE = Stretch((10,), steps=WARM_UP + 12, sightings=4, seconds=0.5)


def flat(us: float) -> Timing:
    return Timing(100, us, us, us, us, us, (us,) * 5)


def test_without_ids_all_else_is_the_same() -> None:
    drive = world(10, 5, 4, 0).drive
    for step, other in zip(drive, without_ids(drive), strict=True):
        assert (other.sightings.ids == UNKNOWN).all()
        assert len(other.sightings.ids) == len(step.sightings.ids)
        assert other.sightings.z is step.sightings.z
        assert np.array_equal(other.t, step.t)


def test_both_ways_have_a_timing_and_nearly_all_landmarks_are_found() -> None:
    subject = Subject("ekf", "ekf", registry.find("ekf").options())
    (row,) = measure(Process((subject,), 10, LITTLE))
    assert row.reason == ""
    assert row.told.steps == row.found.steps == row.idle.steps == 12
    assert 0.8 < row.share <= 1


def test_a_landmark_mapped_twice_compresses_no_filter_at_the_threshold() -> None:
    options = registry.find("ekf").options()
    assert of_one_form(options, 100).compress_above == 200
    assert of_one_form(options, 101) is options
    assert of_one_form(registry.find("smoother").options(), 100) == registry.find("smoother").options()


def test_what_fails_is_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "PATIENCE", 0.0)
    subject = Subject("ekf", "ekf", registry.find("ekf").options())
    (row,) = measure(Process((subject,), 10, LITTLE))
    assert row.told is None
    assert row.reason.startswith("its map was not made within 0 s")


def test_what_is_added_is_held_against_its_limit() -> None:
    rows = [
        AssociationRow("ekf", AT, flat(20.0), flat(34.0)._replace(p99=200.0), None, Added(14.0, 13.0, 16.0)),
        AssociationRow("ekf", 30, flat(20.0), flat(90.0), None, Added(70.0, 70.0, 70.0)),
        AssociationRow("isam2", AT, flat(300.0), flat(2500.0), None, Added(2200.0, 2100.0, 2300.0)),
        AssociationRow("ukf", AT, flat(20.0), flat(30.0)),
        AssociationRow("smoother", AT, reason="lost"),
    ]
    found = expectations(rows)
    assert [(limit.reached, limit.holds) for limit in found] == [(14.0, True), (180.0, False), (2200.0, False)]
    lines = list(csv.DictReader(as_csv(rows).splitlines()))
    assert tuple(lines[0]) == COLUMNS
    assert [lines[0][column] for column in ("added_us", "added_low_us", "added_high_us")] == ["14", "13", "16"]
    assert (lines[0]["told_p50_us"], lines[0]["p99_us"], lines[-1]["reason"]) == ("20", "200", "lost")


def test_what_is_added_is_the_median_of_tenths_with_the_second_outermost() -> None:
    """One tenth that is disturbed, and single slow steps, count for nothing; a drive all of one cost has no width."""
    told = np.full(100, 20_000)
    found = told + np.repeat(1000 * np.array([7, 3, 9, 5, 900, 4, 6, 8, -800, 2]), 10)
    found[::10] = 10**9
    assert added(told, found) == Added(5.5, 2.0, 9.0)
    assert added(told, told + 13_000) == Added(13.0, 13.0, 13.0)
    few = added(told[:4], told[:4] + 1000 * np.array([1, 2, 3, 9]))
    assert few == Added(2.5, 1.0, 9.0)


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--backend", "ekf", "--sizes", "10", "--steps", "6", "--out", str(tmp_path / "out")]
    assert main(["speed", "--association", "--quick", *asked]) == 0
    said = capsys.readouterr().out
    assert "8 sightings of the nearest landmarks" in " ".join(said.split())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["association.csv"]
