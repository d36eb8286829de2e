"""`bench compare`: what has become worse or better, how sure that is, and what is not to be compared."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.cli import main
from slamduel.bench.measure.repeats import over_rounds
from slamduel.bench.record.schema import ROUND, VIEW
from slamduel.bench.record.sketch import SUMS, Sketch
from slamduel.bench.record.store import Store
from slamduel.bench.verdict.changes import (
    FEW,
    GAIN,
    GONE,
    NEW,
    NOTHING,
    REGRESSION,
    ROUNDED,
    SAME,
    Change,
    by_how_much,
    changes,
    summary,
)
from slamduel.bench.verdict.pairing import paired_runs, side
from slamduel.bench.verdict.statistics import holm, signed_rank
from slamduel.bench.words.columns import TIMED
from slamduel.core.errors import InputError
from small_record import RUN, Record, edited

LOGS = 8


def run(
    folder: Path,
    logs: int = LOGS,
    backend: str = "ekf",
    random: bool = False,
    digest: Callable[[int], str] = lambda seed: f"d{seed}",
    failing: tuple[int, ...] = (),
    **factors: Any,
) -> Path:
    """A run whose values are those of every other, times a factor a log; a backend that fails on some logs."""
    record = Record(folder)
    rng = np.random.default_rng(3)
    base: dict[str, float] = {"ate_m": 0.1, "map_rmse_m": 0.2, "nees": 1.5, "cpu_s": 2.0, "step_us_p50": 9.0}
    base |= {"step_us_p99": 50.0, "peak_mb": 30.0}
    for seed in range(logs):
        columns: dict[str, Any] = {name: value * rng.uniform(0.8, 1.2) for name, value in base.items()}
        for name, factor in factors.items():
            columns[name] *= factor(seed) if callable(factor) else factor
        record.cell("room", "truth", backend, seed=seed, digest=digest(seed), **columns)
        if seed in failing:
            failed: dict[str, Any] = dict.fromkeys(columns) | {"status": "diverged", "reason": "lost its way"}
            record.cell("room", "truth", backend, seed=seed, digest=digest(seed), **failed)
    record.store.put_about({"random": [backend] * random, "cells": logs})
    record.store.close()
    return folder


def told(old: Path, new: Path, least: float | None = None, **allowed: bool) -> dict[str, Change]:
    """The changes by quantity."""
    return {change.quantity: change for change in changes(paired_runs(side(old), side(new), **allowed), least)}


def test_the_same_twice_is_the_same_to_the_last_bit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new")
    assert {change.verdict for change in told(old, new).values()} == {SAME}
    assert main(["compare", str(old), str(new)]) == 0
    assert "7 comparisons: 7 the same to the last bit." in capsys.readouterr().out


def test_a_path_that_is_further_off_on_every_log_is_a_regression_and_a_gain_the_other_way(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", ate_m=lambda seed: 1.3 + 0.02 * seed)
    ate = told(old, new)["ATE online, m"]
    assert (ate.verdict, ate.n) == (REGRESSION, LOGS)
    assert ate.low <= ate.ratio <= ate.high
    assert 1.3 <= ate.ratio <= 1.44
    assert ate.adjusted == pytest.approx(2 * 0.5**LOGS)  # all of one sign; the map is the same, and counts for nothing
    assert summary(list(told(old, new).values())) == "1 regression, no gain"
    assert told(new, old)["ATE online, m"].verdict == GAIN


def test_the_exit_status_is_1_with_a_regression_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", ate_m=1.3)
    assert main(["compare", str(old), str(new)]) == 1
    assert "regression" in capsys.readouterr().out
    assert main(["compare", str(new), str(old), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["compare", str(old), str(new), "--least", "40"]) == 0


def test_a_change_of_either_sign_is_no_difference(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", ate_m=lambda seed: 1.5 if seed % 2 else 0.6)
    assert told(old, new)["ATE online, m"].verdict == NOTHING


def test_a_real_change_that_is_too_small_to_count_says_so(tmp_path: Path) -> None:
    ate = told(run(tmp_path / "old"), run(tmp_path / "new", ate_m=1.03))["ATE online, m"]
    assert (ate.verdict, ate.beyond) == (NOTHING, False)
    assert "real, but less than the 5 % that count" in ate.words
    assert told(tmp_path / "old", tmp_path / "new", 0.02)["ATE online, m"].verdict == REGRESSION


def test_every_cost_that_differs_by_a_few_per_cent_is_no_regression(tmp_path: Path) -> None:
    """Two runs of one thing: every log agrees that the second was slower."""
    old, new = run(tmp_path / "old"), run(tmp_path / "new", cpu_s=1.2, step_us_p50=1.2, peak_mb=1.02)
    assert all(change.verdict in (SAME, NOTHING) for change in told(old, new).values())
    slow = run(tmp_path / "slow", cpu_s=1.8)
    assert told(old, slow)["CPU time, s"].verdict == REGRESSION


def test_the_correction_is_holms_over_all_of_a_kind(tmp_path: Path) -> None:
    """ATE and map are both accuracy; their p values are corrected together, those of NEES apart."""
    up, mixed = (lambda seed: 1.3 + 0.01 * seed), (lambda seed: 1.3 + 0.01 * seed if seed else 0.7)
    found = told(run(tmp_path / "old"), run(tmp_path / "new", ate_m=up, map_rmse_m=mixed, nees=up))
    p = [signed_rank(np.log([f(seed) for seed in range(LOGS)]))[0] for f in (up, mixed)]
    assert [found[name].adjusted for name in ("ATE online, m", "map, m")] == pytest.approx(list(holm(p)))
    assert found["NEES / 3"].adjusted < found["ATE online, m"].adjusted * 1.01


@pytest.mark.parametrize("logs", [1, 3])
def test_on_few_logs_what_draws_nothing_needs_no_test(tmp_path: Path, logs: int) -> None:
    old, new = run(tmp_path / "old", logs), run(tmp_path / "new", logs, ate_m=1.2, cpu_s=3.0)
    found = told(old, new)
    assert found["ATE online, m"].verdict == REGRESSION
    assert ("on this log" if logs == 1 else "on these 3 logs") in found["ATE online, m"].words
    assert found["CPU time, s"].verdict == FEW
    assert found["CPU time, s"].beyond
    assert found["CPU time, s"].ratio == pytest.approx(3)
    assert told(new, old)["ATE online, m"].verdict == GAIN


def test_on_few_logs_chance_cannot_be_told_from_change(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old", 3, random=True), run(tmp_path / "new", 3, random=True, ate_m=1.2)
    ate = told(old, new)["ATE online, m"]
    assert (ate.verdict, ate.words) == (FEW, "3 logs, a test of so many comparisons needs 6")


def test_nees_is_judged_by_how_far_it_is_from_1(tmp_path: Path) -> None:
    """1.5 and 1 / 1.5 are as bad; 1.2 is better than either."""
    old, sure = run(tmp_path / "old"), run(tmp_path / "new", nees=1 / 1.5)
    assert told(old, sure)["NEES / 3"].verdict == GAIN  # 0.8 to 1.2
    assert told(old, run(tmp_path / "worse", nees=2.0))["NEES / 3"].verdict == REGRESSION
    assert told(old, run(tmp_path / "lower", nees=1 / 4))["NEES / 3"].verdict == REGRESSION


def test_a_cell_that_was_done_and_fails_is_a_regression_whatever_the_statistics(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", failing=(2,))
    failures = told(old, new)["failures"]
    assert (failures.verdict, failures.old, failures.new) == (REGRESSION, 0, 1)
    assert "seed 2 (diverged: lost its way)" in failures.words
    assert told(old, new)["ATE online, m"].verdict == NOTHING
    assert told(new, old)["failures"].verdict == GAIN
    assert told(new, run(tmp_path / "again", failing=(2,)))["ATE online, m"].verdict == SAME


def test_new_and_gone_backends_are_named(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new")
    for folder, backend in ((old, "ukf"), (new, "isam2")):
        run(folder.with_name(f"{folder.name}-more"), backend=backend)
    found = paired_runs(side(old), side(new))
    more = paired_runs(side(old), side(new))._replace(added=[("room", "isam2")], gone=[("room", "ukf")])
    assert {change.backend: change.verdict for change in changes(more)[-2:]} == {"isam2": NEW, "ukf": GONE}
    assert len(changes(more)) == len(changes(found)) + 2
    with pytest.raises(InputError, match="no backend on any dataset in common"):
        paired_runs(side(old), side(tmp_path / "new-more"))


@pytest.mark.parametrize(("name", "value"), [("processor", "slide rule"), ("cores", 64), ("memory_gb", 3.0)])
def test_times_from_another_machine_are_left_out(tmp_path: Path, name: str, value: Any) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", ate_m=1.3, cpu_s=3.0)
    elsewhere(new, **{name: value})
    found = paired_runs(side(old), side(new))
    assert any("different machines" in note and "--any-machine" in note for note in found.notes)
    assert {change.kind for change in changes(found)} == {"accuracy", "consistency"}
    assert told(old, new)["ATE online, m"].verdict == REGRESSION
    assert told(old, new, any_machine=True)["CPU time, s"].verdict == REGRESSION


def elsewhere(folder: Path, **environment: Any) -> None:
    with Store(folder, writing=True) as store:
        store.put_about({"environment": RUN["environment"] | environment})


def test_what_differs_between_the_runs_is_listed(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new")
    elsewhere(new, revision="abc", packages={"numpy": "3.0", "gtsam": None})
    found = paired_runs(side(old), side(new))
    assert set(found.differences) == {("numpy", "2.0", "3.0"), ("revision", "none", "abc")}


def test_other_logs_are_left_out_unless_told_otherwise(tmp_path: Path) -> None:
    old = run(tmp_path / "old", ate_m=1.0)
    new = run(tmp_path / "new", ate_m=1.3, digest=lambda seed: f"{'x' if seed < 1 else 'd'}{seed}")
    assert told(old, new)["ATE online, m"].n == LOGS - 1
    assert any("room, seed 0: not the same log" in note for note in paired_runs(side(old), side(new)).notes)
    assert told(old, new, any_log=True)["ATE online, m"].n == LOGS
    other = run(tmp_path / "other", digest=lambda seed: f"x{seed}")
    with pytest.raises(InputError, match="no cell ran on the same log"):
        paired_runs(side(old), side(other))
    assert main(["compare", str(old), str(other)]) == 2


def sketched(folder: Path, seeds: int, off: float, frame: str = "f") -> Path:
    """With sketches of its logs, all `off` standard deviations from those of `off` = 0."""
    return sketches(folder, {seed: Sketch(frame, np.full(SUMS, seed + off)).words() for seed in range(seeds)})


def sketches(folder: Path, by_seed: dict[int, Any]) -> Path:
    """The run with these sketches of its logs, and no others."""
    edited(folder, "UPDATE logs SET sketch = NULL")
    for seed, words in by_seed.items():
        edited(folder, "UPDATE logs SET sketch = :words WHERE seed = :seed", words=json.dumps(words), seed=seed)
    return folder


def test_logs_that_are_the_same_to_rounding_are_compared_and_named(tmp_path: Path) -> None:
    old = sketched(run(tmp_path / "old"), LOGS, 0.0)
    new = sketched(run(tmp_path / "new", ate_m=1.3, nees=1 + 1e-9, digest=lambda seed: f"x{seed}"), LOGS, 0.01)
    notes = paired_runs(side(old), side(new)).notes
    assert any("differ by no more than rounding" in note and "at most 0.01; up to 0.1" in note for note in notes)
    assert any("within one part in a million" in note for note in notes)
    changed = told(old, new)
    assert (changed["ATE online, m"].verdict, changed["ATE online, m"].n) == (REGRESSION, LOGS)
    assert changed["NEES / 3"].verdict == ROUNDED
    for off, frame in ((0.2, "f"), (0.0, "another")):
        with pytest.raises(InputError, match="no cell ran on the same log"):
            paired_runs(side(old), side(sketched(new, LOGS, off, frame)))


def test_on_few_logs_that_differ_by_rounding_nothing_is_called_a_change(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old", 2), run(tmp_path / "new", 2, ate_m=1.3, digest=lambda seed: f"x{seed}")
    assert told(sketched(old, 2, 0.0), sketched(new, 2, 0.01))["ATE online, m"].verdict == FEW


def test_other_instructions_allow_for_rounding_and_one_processor_allows_for_none(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", nees=1 + 1e-9)
    assert told(old, new)["NEES / 3"].verdict == NOTHING
    elsewhere(old, instructions="avx2")
    elsewhere(new, instructions="avx2 avx512f")
    found = paired_runs(side(old), side(new))
    assert any("within one part in a million" in note for note in found.notes)
    assert any("(avx2)" in note and "(avx2 avx512f)" in note and "--any-machine" in note for note in found.notes)
    assert told(old, new)["NEES / 3"].verdict == ROUNDED


def test_a_damaged_sketch_is_none(tmp_path: Path) -> None:
    old = sketched(run(tmp_path / "old"), LOGS, 0.0)
    new = run(tmp_path / "new", digest=lambda seed: f"{'x' if seed < 1 else 'd'}{seed}")
    for damaged in ({}, {0: None}, {0: {"frame": "f", "sums": "none"}}):
        assert told(old, sketches(new, damaged))["ATE online, m"].n == LOGS - 1


def test_a_record_without_newer_columns_is_compared(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new")
    view = VIEW.replace("results.peak_mb, ", "")
    edited(old, "DROP VIEW cells", "ALTER TABLE results DROP COLUMN peak_mb", view)
    assert "memory, MB" not in told(old, new)
    assert told(old, new)["ATE online, m"].verdict == SAME


def test_markdown_and_json_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = run(tmp_path / "old"), run(tmp_path / "new", ate_m=1.3, map_rmse_m=0.5)
    words = ["compare", str(old), str(new), "--out", str(tmp_path / "deep" / "pr.md"), "--json"]
    assert main(words) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["status"], found["summary"]) == (1, "1 regression, 1 gain")
    assert [change["verdict"] for change in found["changes"]][:2] == [REGRESSION, GAIN]
    text = (tmp_path / "deep" / "pr.md").read_text()
    assert text.startswith("### 1 regression, 1 gain\n")
    assert text.count("<details>") == text.count("</details>") == 3
    lines = text.splitlines()
    first = lines[: next(k for k, line in enumerate(lines) if "<details>" in line)]
    assert [line.count("|") for line in first if line.startswith("|")] == [9, 9, 9, 9]
    assert any("regression" in line and "+30 %" in line and "ATE online" in line for line in first)


def test_what_is_no_run_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(run(tmp_path / "old")), str(tmp_path / "nowhere")]) == 2
    assert f"{tmp_path / 'nowhere'}: results.sqlite is not here" in capsys.readouterr().err


# What must not hide


@pytest.mark.parametrize("value", [None, float("nan")])
def test_a_value_that_is_there_no_more_is_a_regression_though_the_cell_is_done(tmp_path: Path, value: Any) -> None:
    old, new = run(tmp_path / "old"), edited(run(tmp_path / "new"), "UPDATE results SET ate_m = :value", value=value)
    assert told(old, new)["ATE online, m"].verdict == REGRESSION
    assert "none now: seeds 0, 1" in told(old, new)["ATE online, m"].words
    assert not [change for change in told(new, old).values() if change.verdict in (REGRESSION, GAIN)]


def test_a_cell_that_was_done_and_is_skipped_is_a_regression(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), edited(run(tmp_path / "new"), "UPDATE results SET status = 'skipped'")
    assert (told(old, new)["failures"].verdict, told(new, old)["failures"].verdict) == (REGRESSION, GAIN)


def test_a_distance_from_a_reference_is_not_compared_with_an_error(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old"), edited(run(tmp_path / "new"), "UPDATE results SET truth_kind = 'reference'")
    assert "ATE online, m" not in told(old, new)
    assert any("the truth has changed" in note for note in paired_runs(side(old), side(new)).notes)


def test_an_error_of_nothing_is_no_failure_and_rounding_no_change(tmp_path: Path) -> None:
    runs = [run(tmp_path / name, ate_m=factor) for name, factor in (("none", 0), ("hardly", 1e-14), ("some", 1))]
    assert told(runs[0], runs[1])["ATE online, m"].verdict == NOTHING
    assert "failing" not in by_how_much(told(runs[0], runs[2])["ATE online, m"])


def test_from_failing_has_no_interval(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old", failing=tuple(range(LOGS))), run(tmp_path / "new")
    assert by_how_much(told(old, new)["ATE online, m"]) == "from failing"
    assert by_how_much(told(new, old)["ATE online, m"]) == "to failing"


def test_clusters_count_once_and_the_sentence_says_so(tmp_path: Path) -> None:
    def made(name: str, factor: float, each: int) -> Path:
        record = Record(tmp_path / name)
        rng = np.random.default_rng(4)
        for seed in range(24):
            ate = 0.1 * rng.uniform(0.8, 1.2) * factor
            record.cell("room", "truth", "ekf", seed=seed, ate_m=ate, cluster=f"set {seed // each}")
        return tmp_path / name

    def found(each: int) -> Change:
        folders = [made(f"{name}-{each}", factor, each) for name, factor in (("old", 1.0), ("new", 1.5))]
        told = changes(paired_runs(*map(side, folders)))
        return next(change for change in told if change.quantity == "ATE online, m")

    eight, four = found(3), found(6)
    assert (eight.verdict, eight.n, eight.units) == (REGRESSION, 24, 8)
    assert "24 logs in 8 clusters" in eight.words
    assert (four.n, four.units) == (24, 4)
    assert four.words.startswith("on these 24 logs")  # too few clusters for a test, but nothing in it is random


def repeated(folder: Path, *factors: float, noise: float = 0.05) -> Path:
    """The run with a time in every round for every cell: its own, times that factor and chance."""
    rng = np.random.default_rng(len(factors))
    with Store(folder, writing=True) as store:
        for row in list(store.cells()):
            found: list[dict[str, Any]] = []
            for number, factor in enumerate(factors, 1):
                times = {n: row.columns[n] * factor * np.exp(noise * rng.normal()) for n in ("cpu_s", "step_us_p50")}
                one = {"round": number, "status": "done", "timing_alone": 1, **times}
                found.append(dict.fromkeys(ROUND) | one)
                store.put_round(row.result, one, over_rounds(found, TIMED))
    return folder


def test_costs_of_repeats_are_judged_by_their_rounds_and_need_no_six_logs(tmp_path: Path) -> None:
    old, new = repeated(run(tmp_path / "old", 2), 1.0, 1.1, 1.0, 0.9), repeated(run(tmp_path / "new", 2), 3.0, 3.3, 2.9)
    found = told(old, new)["CPU time, s"]
    assert found.verdict == REGRESSION
    assert found.words == "2 logs, 4 and 3 rounds"
    assert found.low < 3 < found.high
    assert told(new, old)["step p50, µs"].verdict == GAIN


def test_a_machine_whose_rounds_differ_that_much_bears_no_regression(tmp_path: Path) -> None:
    old, new = repeated(run(tmp_path / "old"), 1.0, 2.0, 0.7), repeated(run(tmp_path / "new"), 1.6, 4.0, 1.2)
    found = told(old, new)["CPU time, s"]
    assert found.verdict == NOTHING
    assert found.words == "8 logs, 3 and 3 rounds: not wholly beyond the 50 % that count"


def test_without_rounds_in_both_runs_costs_are_judged_by_log(tmp_path: Path) -> None:
    old, new = repeated(run(tmp_path / "old"), 1.0, 1.0, 1.0), run(tmp_path / "new", cpu_s=2.0)
    assert "rounds" not in told(old, new)["CPU time, s"].words
    assert told(old, new)["CPU time, s"].verdict == REGRESSION
