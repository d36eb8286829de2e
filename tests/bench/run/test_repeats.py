"""Repeats: every cell timed in several rounds, each in a process of its own, and what is kept of them."""

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from csv_rows import csv_rows
from slamduel.bench.cli import main
from slamduel.bench.engine.engine import run as run_cells
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.work import PlannedCell, work_of
from slamduel.bench.record.schema import COLUMNS, KEY, ROUND
from slamduel.bench.run.benchmark import benchmark, planned
from slamduel.bench.run.progress import Screen
from slamduel.bench.run.result import run as run_in_python
from slamduel.bench.run.runner import recorded_plan
from slamduel.bench.run.terminal import status
from slamduel.bench.verdict.cost_words import repeat_troubles
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.columns import TIMED
from slamduel.bench.words.console import screen_console
from slamduel.bench.workers.local_executor import Local
from slamduel.core.errors import InputError
from small_run import Silent, again, rows

WORDS: dict[str, Any] = {
    "backend": "dead-reckoning,ekf",
    "dataset": "circle[steps=30]",
    "seeds": 3,
    "timeout_s": 60.0,
    "memory_mb": 1000,
}


class Order(Silent):
    """A watcher that records which cell ran when, by round."""

    def __init__(self) -> None:
        super().__init__()
        self.rounds: dict[int, list[tuple[int, str]]] = {}

    def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        super().repeated(cell, row, seconds)
        self.rounds.setdefault(row["round"], []).append((cell.cell.seed, cell.cell.backend.label))


def plan(repeats: int, **more: Any) -> Plan:
    return Plan.from_words({**WORDS, "repeats": repeats, **more})


@pytest.fixture(scope="module")
def thrice(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Order]:
    folder, watcher = tmp_path_factory.mktemp("runs") / "thrice", Order()
    again(plan(3), folder, watcher)
    return folder, watcher


def test_every_round_times_every_cell_once_log_by_log(thrice: tuple[Path, Order]) -> None:
    _, watcher = thrice
    assert sorted(watcher.rounds) == [2, 3]
    for cells in watcher.rounds.values():
        assert sorted(cells) == [(seed, name) for seed in range(3) for name in ("dead-reckoning", "ekf")]
        assert all(cells[k][0] == cells[k + 1][0] for k in (0, 2, 4))
    assert watcher.rounds[2] != watcher.rounds[3]


def test_rounds_are_in_times_csv_and_their_medians_in_cells_csv(thrice: tuple[Path, Order]) -> None:
    folder, _ = thrice
    cells, times, metrics = (csv_rows(folder / f"{name}.csv") for name in ("cells", "times", "metrics"))
    assert list(cells[0]) == list(COLUMNS)
    assert list(times[0]) == [*KEY, *ROUND]
    assert len(times) == 3 * len(cells) == 18
    for cell, more in zip(cells, metrics, strict=True):
        mine = [one for one in times if all(one[name] == cell[name] for name in KEY)]
        assert [one["round"] for one in mine] == ["1", "2", "3"]
        assert len({one["path"] for one in mine}) == 1
        assert float(cell["step_us_p50"]) == sorted(float(one["step_us_p50"]) for one in mine)[1]
        assert more["repeats"] == "3"
        assert float(more["step_us_p50_low"]) < float(cell["step_us_p50"]) < float(more["step_us_p50_high"])
        assert all(float(one["work_us"]) > 0 and 0 <= float(one["waited_share"]) < 1 for one in mine)


def test_errors_are_those_of_one_round(thrice: tuple[Path, Order], tmp_path: Path) -> None:
    folder, _ = thrice
    again(plan(1), tmp_path / "once", Silent())
    for one, other in zip(csv_rows(folder / "cells.csv"), csv_rows(tmp_path / "once" / "cells.csv"), strict=True):
        assert all(one[name] == other[name] for name in ("ate_m", "nees", "digest", "cost_j", "reason"))
    assert {row["repeats"] for row in csv_rows(tmp_path / "once" / "metrics.csv")} == {"1"}
    assert all(row["step_us_p50_low"] == "" for row in csv_rows(tmp_path / "once" / "metrics.csv"))


def test_more_repeats_add_the_missing_rounds_alone(tmp_path: Path) -> None:
    folder, first = tmp_path / "run", Order()
    again(plan(2), folder, first)
    before = csv_rows(folder / "times.csv")
    more = planned({"repeats": 4}, folder)
    assert more.repeats == 4
    second = Order()
    again(more, folder, second)
    assert sorted(second.rounds) == [3, 4]
    assert "ekf done" not in second.ended
    after = csv_rows(folder / "times.csv")
    assert [one for one in after if one["round"] in ("1", "2")] == before
    found = recorded_plan(folder)
    assert found is not None
    assert found.repeats == 4
    third = Order()
    again(found, folder, third)
    assert third.ended == []


def test_a_run_stopped_within_a_round_goes_on_there(tmp_path: Path) -> None:
    class Stops(Order):
        def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
            super().repeated(cell, row, seconds)
            if sum(map(len, self.rounds.values())) == 8:
                raise KeyboardInterrupt

    folder, first, second = tmp_path / "run", Stops(), Order()
    with pytest.raises(KeyboardInterrupt):
        again(plan(3), folder, first)
    again(plan(3), folder, second)
    assert {number: len(cells) for number, cells in second.rounds.items()} == {3: 4}
    assert not set(first.rounds[3]) & set(second.rounds[3])


def test_fewer_repeats_than_there_are_get_a_sentence(thrice: tuple[Path, Order]) -> None:
    with pytest.raises(InputError, match="holds a run with repeats 3, found repeats 2; expected at least as many"):
        planned({"repeats": 2}, thrice[0])
    assert planned({}, thrice[0]).repeats == 3


def test_a_backend_that_differs_between_processes_is_named(tmp_path: Path) -> None:
    """Which shows that every round has a process of its own."""
    found = again(plan(2, backend="ekf,misbehaving:differs_by_process", seeds=2), tmp_path / "run", Silent())
    (said,) = repeat_troubles(lines(found.values()))
    assert said.startswith("misbehaving:differs_by_process is not deterministic: on 2 of 2 cells")


def test_a_repeat_that_fails_is_told_and_tried_again_where_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from slamduel.bench.workers.executor import Here

    folder, there = tmp_path / "run", tmp_path / "there"
    monkeypatch.setenv("FAIL_IN", str(there))

    def go(repeats: int, *, retry: bool = False) -> Silent:
        watcher = Silent()
        work = work_of(plan(repeats, backend="misbehaving:fails_where_asked", seeds=2))
        run_cells(work, folder, Here(), RunRequest(retry=retry), lambda known: {"kind": "run", **known}, watcher)
        return watcher

    go(1)
    there.mkdir()
    assert go(2).ended == ["misbehaving:fails_where_asked again error"] * 2
    found = lines(rows(folder).values())
    assert status(found) == 1
    assert "failed in 2 of 4 timings (error: ValueError: asked for" in repeat_troubles(found)[0]
    there.rmdir()
    assert go(2).ended == []
    assert go(2, retry=True).ended == ["misbehaving:fails_where_asked again done"] * 2
    assert status(lines(rows(folder).values())) == 0


def test_repeats_where_no_cell_can_be_timed_get_a_sentence(tmp_path: Path) -> None:
    class Untimed(Local):
        times = False

    unable = pytest.raises(InputError, match="repeats: found 3, and an executor that cannot run cells one at a time")
    with contextlib.closing(Untimed(2)) as executor, Screen(screen_console(quiet=True)) as screen, unable:
        benchmark({**WORDS, "repeats": 3}, tmp_path / "run", executor, ["bench"], screen)
    with pytest.raises(InputError, match="repeats: found 0, expected a whole number, at least 1"):
        run_in_python("circle", "ekf", repeats=0, out=tmp_path / "other")
    with pytest.raises(InputError, match="repeats: with these there are 6,000,000 cells"):
        plan(1_000_000)


def test_the_document_has_costs_with_intervals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--backend", "dead-reckoning,ekf", "--dataset", "circle[steps=30]", "--seeds", "2", "--repeats", "3"]
    assert main(["run", *words, "--json", "--quiet", "--out", str(tmp_path / "run")]) == 0
    (found,) = json.loads(capsys.readouterr().out)["datasets"]
    (one,) = found["verdict"]["costs"]["step_us_p50"]
    assert one["low"] < one["ratio"] < one["high"]
    assert (one["logs"], one["rounds"]) == (2, 3)
    mine: Sequence[Any] = [line["costs"]["cpu_s"] for line in found["lines"]]
    assert all(cost["low"] < cost["value"] < cost["high"] for cost in mine)
    assert all(name in TIMED for line in found["lines"] for name in line["costs"])
    page = (tmp_path / "run" / "report.html").read_text()
    assert "times are medians of 3 rounds" in page
    assert "The machine while a backend was timed" in page
