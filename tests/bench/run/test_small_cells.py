"""Where no number of repeats is given, small cells are timed in several rounds, and others once."""

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.engine.repeats import lacking
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.measure.repeats import MOST_CELLS, ROUNDS, SMALL_S
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.work import PlannedCell, work_of
from slamduel.bench.run.benchmark import DEFAULTS, planned
from slamduel.bench.run.runner import recorded_plan, run
from slamduel.bench.verdict.costs import compare_costs
from slamduel.bench.verdict.summary import lines
from slamduel.bench.workers.local_executor import Local
from small_run import Silent, again

WORDS: dict[str, Any] = {
    "backend": "dead-reckoning,ekf,misbehaving:busy",
    "dataset": "circle[steps=30]",
    "seeds": 2,
    "timeout_s": 60.0,
    "memory_mb": 1000,
    "repeats": None,
}
SMALL = ["dead-reckoning", "ekf"]


def plan(**more: Any) -> Plan:
    return Plan.from_words({**WORDS, **more})


def counts(folder: Path) -> dict[str, set[str]]:
    """The numbers of rounds of each backend's cells."""
    found: dict[str, set[str]] = {}
    for row in csv_rows(folder / "metrics.csv"):
        found.setdefault(row["backend"], set()).add(row["repeats"])
    return found


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "made"
    again(plan(), folder, Silent())
    return folder


def test_small_cells_are_timed_in_five_rounds_and_others_once(made: Path) -> None:
    assert counts(made) == {**{name: {str(ROUNDS)} for name in SMALL}, "misbehaving:busy": {"1"}}
    times = csv_rows(made / "times.csv")
    assert len(times) == 2 * (2 * ROUNDS + 1)
    assert {row["timing_alone"] for row in times} == {"1"}


def test_all_but_times_is_as_without_repeats(made: Path, tmp_path: Path) -> None:
    again(plan(repeats=1), tmp_path / "once", Silent())
    kept = ("ate_m", "heading_rad", "nees", "map_rmse_m", "digest", "cost_j", "status", "reason")
    for one, other in zip(csv_rows(made / "cells.csv"), csv_rows(tmp_path / "once" / "cells.csv"), strict=True):
        assert [one[name] for name in kept] == [other[name] for name in kept]
    for path in sorted(made.rglob("*.tum")):
        assert path.read_bytes() == (tmp_path / "once" / path.relative_to(made)).read_bytes()


def test_a_run_that_was_stopped_ends_with_the_same_rounds(tmp_path: Path) -> None:
    class Stops(Silent):
        def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
            super().repeated(cell, row, seconds)
            if row["round"] == 3:
                raise KeyboardInterrupt

    folder, rest = tmp_path / "run", Silent()
    with pytest.raises(KeyboardInterrupt):
        again(plan(backend="dead-reckoning,ekf"), folder, Stops())
    found = recorded_plan(folder)
    assert found is not None
    assert found.repeats is None
    again(found, folder, rest)
    assert len(rest.ended) == 4 * (ROUNDS - 1) - 5
    assert counts(folder) == {name: {str(ROUNDS)} for name in SMALL}
    again(found, folder, done := Silent())
    assert done.ended == []


def test_several_workers_time_small_cells_one_at_a_time_and_their_costs_are_compared(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    found = lines(again(plan(), folder, Silent(), workers=2).values())
    assert {row["round"] == "1" for row in csv_rows(folder / "times.csv") if row["timing_alone"] == "0"} == {True}
    assert counts(folder) == {**{name: {str(ROUNDS - 1)} for name in SMALL}, "misbehaving:busy": {"1"}}
    assert [line.alone for line in found] == [line.backend in SMALL for line in found]
    reckoning, ekf, busy = found
    both = compare_costs(reckoning, ekf, "cpu_s")
    assert both is not None
    assert (both.logs, both.rounds) == (2, ROUNDS - 1)
    assert compare_costs(reckoning, busy, "cpu_s") is None


def test_without_an_executor_that_can_time_nothing_is_repeated(tmp_path: Path) -> None:
    class Untimed(Local):
        times = False

    with contextlib.closing(Untimed(1)) as executor:
        run(plan(backend="dead-reckoning"), tmp_path / "run", executor, ["bench"], Silent())
    assert counts(tmp_path / "run") == {"dead-reckoning": {"1"}}


def test_a_number_that_is_given_holds_for_all_cells_whatever_was_there(made: Path, tmp_path: Path) -> None:
    assert planned({}, made).repeats is None
    assert [planned({"repeats": n}, made).repeats for n in (1, 2, 9)] == [1, 2, 9]
    again(plan(repeats=2), tmp_path / "run", Silent())
    assert counts(tmp_path / "run") == {name: {"2"} for name in (*SMALL, "misbehaving:busy")}
    assert planned({}, tmp_path / "run").repeats == 2


def chosen(seconds: Mapping[str, list[float]], number: int = 2) -> set[str]:
    """The backends that are repeated where the first rounds of their cells took so long."""
    work = work_of(plan(backend=",".join(seconds), seeds=max(map(len, seconds.values()))))
    keys = [f"{cell.cell.backend.label} {cell.cell.seed}" for cell in work.cells]
    took = {f"{name} {k}": value for name, values in seconds.items() for k, value in enumerate(values)}
    found = {key: [{"round": 1, "status": "done", "cpu_s": took[key]}] for key in keys}
    places = lacking(work, keys, dict.fromkeys(keys, "done"), found, number, RunRequest())
    names = [work.cells[place].cell.backend.label for place in places]
    assert {names.count(name) for name in names} <= {len(seconds[name]) for name in names}
    return set(names)


def test_all_cells_of_a_backend_are_repeated_or_none() -> None:
    s = SMALL_S
    assert chosen({"ekf": [0.9 * s, 0.9 * s, 1.5 * s], "isam2": [0.8 * s, 1.1 * s, 1.2 * s]}) == {"ekf"}
    assert chosen({"ekf": [s, s, 99 * s], "isam2": [2 * s] * 3}) == {"ekf"}


def test_what_would_take_minutes_is_not_repeated() -> None:
    assert chosen({"ekf": [0.01] * MOST_CELLS}) == {"ekf"}
    assert chosen({"ekf": [0.01] * (MOST_CELLS + 1)}) == set()


@pytest.mark.parametrize("seed", range(5))
def test_load_that_makes_every_time_a_fifth_longer_changes_nothing_beyond_that(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for load in 1 + 0.2 * rng.random(20):
        took = {"ekf": (0.7 * SMALL_S * load * rng.uniform(0.9, 1.1, 5)).tolist(), "isam2": [1.3 * SMALL_S * load] * 5}
        assert chosen(took) == {"ekf"}


@pytest.mark.usefixtures("no_report")
def test_the_command_line_compares_costs_where_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(DEFAULTS, "repeats", None)
    words = ["--backend", "dead-reckoning,ekf", "--dataset", "circle[steps=30]", "--seeds", "2"]
    assert main(["run", *words, "--json", "--quiet", "--out", str(tmp_path / "run")]) == 0
    (found,) = json.loads(capsys.readouterr().out)["datasets"]
    (one,) = found["verdict"]["costs"]["cpu_s"]
    assert (one["logs"], one["rounds"]) == (2, ROUNDS)
    assert one["low"] < one["ratio"] < one["high"]
