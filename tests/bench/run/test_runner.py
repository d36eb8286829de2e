"""A run, whatever its backends do: every cell a row, nothing lost, the same again."""

import contextlib
import dataclasses
import io
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from csv_rows import csv_rows
from places import SUPPORT
from random_logs import random_log
from slamduel.bench.plan.plan import Plan
from slamduel.bench.record.lock import claimed
from slamduel.bench.record.schema import COLUMNS, Row
from slamduel.bench.record.store import Store
from slamduel.bench.run import benchmark as benchmark_module
from slamduel.bench.run.benchmark import planned
from slamduel.bench.run.progress import Screen
from slamduel.bench.run.runner import killed_plan, recorded_plan
from slamduel.bench.words.console import screen_console
from slamduel.bench.workers.executor import Here
from slamduel.bench.workers.tasks import execute
from slamduel.core.errors import InputError, Interrupted
from slamduel.core.factors import REMARKS, Log
from slamduel.core.truth.tum import read_tum
from slamduel.datasets.formats import log_folder as logfile
from small_run import TIMES, Silent, again, go, rows
from tiers import first_quick


def arrays(folder: Path) -> dict[str, dict[str, Any]]:
    with Store(folder) as store:
        return {key: store.arrays(row) for key, row in rows(folder).items()}


def without_times(folder: Path) -> list[dict[str, str]]:
    return [{name: value for name, value in row.items() if name not in TIMES} for row in csv_rows(folder / "cells.csv")]


def test_a_run_leaves_what_the_design_says(tmp_path: Path, log_folder: Path) -> None:
    out = tmp_path / "new" / "run"
    go(out, "dead-reckoning,ekf,fastslam[particles=50],isam2,graph", log_folder)
    found = csv_rows(out / "cells.csv")
    assert list(found[0]) == list(COLUMNS)
    assert [row["status"] for row in found] == ["done"] * 6  # FastSLAM draws, so it has two seeds; the others one
    assert len({row["digest"] for row in found}) == 1
    about = json.loads((out / "run.json").read_text())
    assert about["plan"]["backend"].startswith("dead-reckoning,ekf")
    assert about["environment"]["packages"]["gtsam"]
    assert "CPU time" in about["timing_policy"]
    log, truth = logfile.read(log_folder)
    place = out / about["folders"][f"log[path={log_folder}]"] / "0"
    t, poses = read_tum(place / "truth.tum")
    assert np.array_equal(t, truth.t)
    assert np.array_equal(poses, truth.poses)
    for row in found:
        label = row["backend"] + (f"[{row['options']}]" if row["options"] else "")
        folder = place.parent / row["seed"] / about["folders"][label]
        has = {path.name for path in folder.iterdir()}
        expected = {"map.csv"}
        expected |= set() if row["backend"] == "graph" else {"online.tum", "steps.csv"}
        expected |= {"final.tum"} if row["backend"] in ("fastslam", "isam2", "graph") else set()
        assert has == expected, row["backend"]
        if "steps.csv" in has:
            steps = csv_rows(folder / "steps.csv")
            assert len(steps) == len(log) == int(row["steps"])
            errors = np.array([float(step["error_m"]) for step in steps])
            assert np.sqrt((errors**2).mean()) == pytest.approx(float(row["ate_m"]), rel=1e-9)
            inside = [float(step["nees"]) for step in steps if step["nees"]]
            assert np.mean(inside) / 3 == pytest.approx(float(row["nees"]), rel=1e-9)
        assert len(csv_rows(folder / "map.csv")) == int(row["landmarks"])


ODD = [
    ("raises", "error", "ValueError: the [brackets] of this message are <b>not</b> markup (misbehaving.py:"),
    ("shouts", "error", r"RuntimeError: bad \ud800 \x1b[31m \x00 :x: [bold]$_%&|<b> and more and more"),
    ("not_a_number", "diverged", "step 4: the pose is not finite"),
    ("leaves_the_earth", "diverged", "step 4: the pose is 3.0e+12 m from the origin, farther than the 1e+09 m"),
    ("gives_up", "diverged", "the covariance is no longer positive definite"),
    ("loops_for_ever", "timeout", "not finished after 3 s"),
    ("sleeps_for_ever", "timeout", "not finished after 3 s"),
    ("eats_memory", "error", "needed more than the memory limit of 1000 MB"),
    ("kills_itself", "error", "the process was killed by SIGKILL"),
    ("crashes", "error", "killed by SIGSEGV; its last words: reading address zero now"),
    ("exits", "error", "SystemExit: had enough"),
    ("wrong_shape", "error", "step 0: the pose has shape (2,), expected (3,)"),
    ("complex_pose", "error", "step 0: the pose is ndarray, expected an array of floats of shape (3,)"),
    ("sometimes_none", "error", "a pose at some steps and None at others"),
    ("wrong_belief", "error", "belief() returned tuple at step 0, expected Belief or None"),
    ("believes_elsewhere", "error", "step 4: the belief's pose is ["),
    ("twice_in_map", "error", "map(): the map has landmark 7 2 times, expected once"),
    ("half_landmarks", "error", "map(): the map's ids are float64 of shape (2,), expected n whole numbers"),
    ("belief_changes_path", "error", "the path differs once beliefs are asked for"),
    ("talks", "done", ""),
    ("no_builder", "error", "misbehaving:no_builder is int, expected slamduel.backends.api.Builder"),
    ("no_options", "error", "has no options that can be left out: TypeError: must be called with a dataclass"),
    ("not_there", "error", "AttributeError"),
]
"""What backends of misbehaving.py do, as (name, status, reason)."""


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory, log_folder: Path) -> dict[str, tuple[Row, Row]]:
    """The row of each of them and that of the filter that ran beside it; those without end ran with little patience."""
    found: dict[str, tuple[Row, Row]] = {}
    for patience, endless in ((3.0, True), (60.0, False)):
        names = [name for name, status, _ in ODD if (status == "timeout") == endless]
        out = tmp_path_factory.mktemp("odd") / "run"
        backends = ",".join(["ekf", *(f"misbehaving:{name}" for name in names)])
        made = {row.columns["backend"]: row for row in go(out, backends, log_folder, timeout_s=patience).values()}
        assert made.keys() == set(backends.split(","))
        assert (out / "cells.csv").read_text().count("\n") == len(names) + 2  # a row each, the filter's, the header
        found |= {name: (made[f"misbehaving:{name}"], made["ekf"]) for name in names}
    return found


@pytest.mark.parametrize(("name", "status", "reason"), ODD)
def test_whatever_a_backend_does_it_is_one_row(
    beside: dict[str, tuple[Row, Row]], name: str, status: str, reason: str
) -> None:
    bad, good = beside[name]
    assert good.columns["status"] == "done"
    assert good.columns["ate_m"] > 0
    assert bad.columns["status"] == status
    assert reason in bad.columns["reason"]
    assert bad.columns["digest"] == good.columns["digest"]


def test_a_log_with_loop_closures_is_skipped_where_they_are_not_taken(tmp_path: Path) -> None:
    log, truth = random_log(np.random.default_rng(2), 10, 5)
    closed = type(log).from_arrays(
        "closed", log.prior, log.t, log.delta, log.delta_cov, log.sighting_step, log.ids, log.z, log.z_cov,
        loop_step=np.array([9]), loop_to=np.array([0]), loop_delta=np.zeros((1, 3)), loop_cov=10 * np.eye(3)[None],
    )  # fmt: skip
    logfile.write(tmp_path / "log", closed, truth)
    found = go(tmp_path / "run", "dead-reckoning,kf,ekf,ekf[poses=1],fixed-lag,isam2", tmp_path / "log")
    rows = {row.columns["backend"] + str(row.columns["options"] or ""): row.columns for row in found.values()}
    statuses = {name: (columns["status"], columns["reason"]) for name, columns in rows.items()}
    finals = {name: columns.get("final_ate_m") for name, columns in rows.items()}
    for taking in ("ekf", "isam2"):
        assert statuses[taking][0] == "done"
        assert "left out" not in statuses[taking][1]
        assert finals[taking] is not None
    assert statuses["kf"] == ("skipped", "the log has loop closures (RelativePoses), which this backend does not take")
    assert finals["ekfposes=1"] is None
    for without in ("dead-reckoning", "fixed-lag", "ekfposes=1"):
        assert statuses[without][0] == "done"
        assert "1 loop closure is left out" in statuses[without][1]


def test_what_draws_nothing_runs_once_and_what_draws_runs_every_seed(tmp_path: Path, log_folder: Path) -> None:
    found = go(tmp_path / "run", "ekf,misbehaving:draws", log_folder, seeds=3)
    seeds = [(row.columns["backend"], row.columns["seed"]) for row in found.values()]
    assert sorted(seeds) == [("ekf", 0), *(("misbehaving:draws", seed) for seed in range(3))]
    drawn = [row.columns["ate_m"] for row in found.values() if row.columns["backend"] != "ekf"]
    assert len(set(drawn)) == 3


@pytest.mark.slow
def test_the_same_run_gives_the_same_bits_whatever_runs_beside_it(tmp_path: Path, log_folder: Path) -> None:
    backends = "ekf,fastslam[particles=50],isam2,graph"
    go(tmp_path / "one", backends, log_folder, workers=1)
    stop = threading.Event()
    busy = threading.Thread(target=lambda: [np.linalg.inv(np.eye(200)) for _ in iter(stop.is_set, True)])
    busy.start()
    try:
        go(tmp_path / "two", backends, log_folder, workers=3)
    finally:
        stop.set()
        busy.join()
    one, two = arrays(tmp_path / "one"), arrays(tmp_path / "two")
    assert one.keys() == two.keys()
    for key in one:
        for name in ("online", "final", "map_xy", "cov"):
            assert (name in one[key]) == (name in two[key])
            if name in one[key]:
                assert one[key][name].tobytes() == two[key][name].tobytes(), (key, name)
    assert without_times(tmp_path / "one") == without_times(tmp_path / "two")


@pytest.mark.slow
def test_timings_are_marked_where_cells_ran_side_by_side(tmp_path: Path, log_folder: Path) -> None:
    slow = "misbehaving:slow[seconds=0.3],misbehaving:slow[seconds=0.31]"
    alone = go(tmp_path / "one", slow, log_folder, workers=1)
    beside = go(tmp_path / "two", slow, log_folder, workers=2)
    assert [row.columns["timing_alone"] for row in alone.values()] == [1, 1]
    assert [row.columns["timing_alone"] for row in beside.values()] == [0, 0]


SCRIPT = """
import sys
from pathlib import Path
sys.path[:0] = [{tests!r}]
if __name__ == "__main__":
    from small_run import go
    go(Path({out!r}), {backends!r}, {log!r}, workers=1, seeds=4, timeout_s=10.0)
"""


def start(tmp_path: Path, out: Path, backends: str, log: Path) -> subprocess.Popen[bytes]:
    """The same run in a process that can be killed, with a group of its own."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(tests=str(SUPPORT), out=str(out), backends=backends, log=str(log)))
    env = {**os.environ, "SLAMDUEL_TEST_RUN": str(os.getpid())}
    return subprocess.Popen([sys.executable, str(script)], start_new_session=True, env=env)


def wait_for_rows(process: subprocess.Popen[bytes], out: Path, wanted: int) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        assert process.poll() is None
        try:
            if len(rows(out)) >= wanted:
                return
        except InputError:  # not there yet, or not yet with tables
            pass
        time.sleep(0.1)
    pytest.fail(f"{wanted} rows did not come")


@pytest.mark.slow
def test_a_killed_run_goes_on_and_ends_like_an_undisturbed_one(tmp_path: Path, log_folder: Path) -> None:
    backends = "misbehaving:slow[seconds=0.2],misbehaving:draws,misbehaving:raises,ekf,fastslam[particles=50]"
    go(tmp_path / "undisturbed", backends, log_folder, workers=1, seeds=4)
    out = tmp_path / "disturbed"
    for wanted in (1, 8):
        process = start(tmp_path, out, backends, log_folder)
        wait_for_rows(process, out, wanted)
        process.kill()
        process.wait()
    plan = recorded_plan(out)
    assert plan is not None
    watcher = Silent()
    again(plan, out, watcher)
    assert 0 < len(watcher.ended) <= 11 - 8
    assert without_times(out) == without_times(tmp_path / "undisturbed")
    assert arrays(out).keys() == arrays(tmp_path / "undisturbed").keys()


@pytest.mark.parametrize("endless", first_quick(["sleeps_for_ever", "loops_for_ever"]))
def test_workers_do_not_outlive_a_killed_run(tmp_path: Path, log_folder: Path, endless: str) -> None:
    out = tmp_path / "run"
    process = start(tmp_path, out, f"dead-reckoning,misbehaving:{endless}", log_folder)
    wait_for_rows(process, out, 1)
    time.sleep(1.0)  # let the endless one begin
    assert len(of_run()) > 1
    process.kill()
    process.wait()
    deadline = time.monotonic() + 20
    while (left := of_run()) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left == []


def of_run() -> list[str]:
    """Command lines of the live processes that carry the run's mark in their environment."""
    found: list[str] = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"SLAMDUEL_TEST_RUN={os.getpid()}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()[:200])
    return found


def test_a_run_killed_before_it_wrote_anything_is_begun_again(tmp_path: Path, log_folder: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "results.sqlite").touch()
    assert recorded_plan(tmp_path / "run") is None
    assert len(go(tmp_path / "run", "ekf", log_folder)) == 1


def killed_while_its_logs_were_made(folder: Path, undisturbed: Path) -> None:
    """What such a run leaves: its facts, and no plan of cells."""
    with Store(undisturbed) as store:
        facts = store.about()
    folder.mkdir()
    with Store(folder, writing=True) as store:
        store.put_about({name: value for name, value in facts.items() if name != "finished"})


def test_a_run_killed_while_its_logs_were_made_is_begun_again_as_it_was(tmp_path: Path, log_folder: Path) -> None:
    go(tmp_path / "undisturbed", "ekf", log_folder)
    out = tmp_path / "run"
    killed_while_its_logs_were_made(out, tmp_path / "undisturbed")
    assert recorded_plan(out) is None
    plan = planned({}, out)
    assert (plan, [one.label for one in plan.backends]) == (killed_plan(out), ["ekf"])
    assert len(again(plan, out, Silent())) == 1
    assert killed_plan(out) is None
    assert recorded_plan(out) is not None
    assert without_times(out) == without_times(tmp_path / "undisturbed")


def test_a_run_stopped_before_any_cell_had_ended_says_that_it_goes_on(tmp_path: Path) -> None:
    class Stopped(Screen):
        def running(self, *of: Any, **named: Any) -> None:
            raise KeyboardInterrupt

    given = {"backend": "dead-reckoning", "dataset": "circle[steps=20]", "seeds": 1}
    with Stopped(screen_console(quiet=True)) as screen, pytest.raises(Interrupted, match="continues from here"):
        benchmark_module.benchmark(given, tmp_path / "run", Here(), ["bench"], screen)
    for said in ("was stopped before any of its cells had ended: it goes on.", "1 cell in the record already"):
        console = Console(file=io.StringIO(), width=200)
        with Screen(console) as screen:
            benchmark_module.benchmark({}, tmp_path / "run", Here(), ["bench"], screen)
        first = console.file.getvalue().splitlines()[0]  # pyright: ignore[reportAttributeAccessIssue]
        assert said in first
    assert len(csv_rows(tmp_path / "run" / "cells.csv")) == 1


def test_another_run_may_take_its_folder_and_has_nothing_of_it(tmp_path: Path, log_folder: Path) -> None:
    """Its facts were kept once: the names of folders, and the record was refused at the end."""
    go(tmp_path / "undisturbed", "ekf", log_folder)
    killed_while_its_logs_were_made(tmp_path / "run", tmp_path / "undisturbed")
    found = go(tmp_path / "run", "dead-reckoning", "circle[steps=30]")
    assert {row.columns["dataset"] for row in found.values()} == {"circle"}
    with Store(tmp_path / "run") as store:
        assert store.run()["plan"]["backend"] == "dead-reckoning"


def test_a_worker_starts_with_all_backends_imported_and_numba_at_work() -> None:
    modules = "__import__('sys').modules"
    asked = [
        f"'slamduel.backends.{name}' in {modules}" for name in ("gaussian.ekf", "particles.fastslam", "graphs.graph")
    ]
    called = f"len({modules}['slamduel.core.kernels._planar'].wrap.signatures)"
    assert [ended.value for ended in execute(eval, [*asked, called], workers=1)] == [True, True, True, 1]


@pytest.mark.parametrize("lasting", [False, True])
def test_workers_end_before_the_report_unless_another_run_follows(
    lasting: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_then: list[bool] = []

    class Pool(Here):
        open = True

        def close(self) -> None:
            self.open = False

    def reported(*of: Any) -> Any:
        open_then.append(pool.open)
        return report(*of)

    report, pool = benchmark_module.write_report, Pool()
    monkeypatch.setattr(benchmark_module, "write_report", reported)
    given = {"backend": "dead-reckoning", "dataset": "circle[steps=20]", "seeds": 1}
    with Screen(screen_console(quiet=True)) as screen:
        benchmark_module.benchmark(given, tmp_path / "run", pool, ["bench"], screen, lasting=lasting)
    assert open_then == [lasting]


def test_two_runs_cannot_share_a_folder(tmp_path: Path, log_folder: Path) -> None:
    with claimed(tmp_path / "run"), pytest.raises(InputError, match="another run or study writes to it"):
        go(tmp_path / "run", "ekf", log_folder)
    assert not (tmp_path / "run").exists()  # nothing came of either


def test_a_remark_outlives_the_worker_that_made_the_log_and_strictly_is_a_refusal(
    tmp_path: Path, log_folder: Path
) -> None:
    log, truth = logfile.read(log_folder)
    odd = tmp_path / "odd"
    logfile.write(odd, dataclasses.replace(log, notes={REMARKS: ["no reading for 5 s"]}), truth)
    words = {"backend": "dead-reckoning", "dataset": str(odd), "seeds": 1, "timeout_s": 60.0, "memory_mb": 1000}
    plan = Plan.from_words(words)
    for place in (tmp_path / "strict", tmp_path / "run"):
        with pytest.raises(InputError, match=r"^--strict: odd: no reading for 5 s\.$"):
            again(plan, place, Silent(), strict=True)
        assert place.exists() == (place.name == "run")
        again(plan, tmp_path / "run", Silent())
        with Store(tmp_path / "run") as store:
            assert store.remarks() == {f"log[path={odd}]": ["no reading for 5 s"]}


def test_a_log_or_truth_that_has_changed_is_not_mixed_with_its_past(tmp_path: Path, log_folder: Path) -> None:
    log, truth = logfile.read(log_folder)
    assert truth is not None
    place = shutil.copytree(log_folder, tmp_path / "log")
    for _ in range(2):
        assert len(go(tmp_path / "run", "dead-reckoning", place)) == 1
    moved, part = truth.poses + np.array([1.0, 0, 0]), truth._replace(t=truth.t[:20], poses=truth.poses[:20])
    for other, said in (
        ((log.head(20), part), "has changed since this run was begun"),
        (
            (log, truth._replace(poses=moved)),
            "the truth of .* has changed .* digest is [0-9a-f]{12}, expected",
        ),
        ((log, None), "the truth of .* has changed .* digest is no truth, expected"),
    ):
        shutil.rmtree(place)
        logfile.write(place, *other)
        with pytest.raises(InputError, match=said):
            go(tmp_path / "run", "dead-reckoning", place)


def test_a_log_without_truth_gets_a_reference_and_no_consistency(tmp_path: Path, log_folder: Path) -> None:
    logfile.write(tmp_path / "log", logfile.read(log_folder).log, None)
    found = go(tmp_path / "run", "ekf,graph", tmp_path / "log")
    for row in found.values():
        assert row.columns["truth_kind"] == "reference"
        assert row.columns["nees"] is None
    final = next(row.columns["final_ate_origin_m"] for row in found.values() if row.columns["backend"] == "graph")
    assert final == pytest.approx(0, abs=1e-12)  # the reference is the batch optimum


def test_landmarks_without_a_true_path_judge_the_map_alone(tmp_path: Path, log_folder: Path) -> None:
    shutil.copytree(log_folder, tmp_path / "log")
    (tmp_path / "log" / "truth.tum").unlink()
    words = (tmp_path / "log" / "log.toml").read_text()
    (tmp_path / "log" / "log.toml").write_text(re.sub(r"\[contents\].*?(?=\[prior\])", "", words, flags=re.DOTALL))
    found = go(tmp_path / "run", "ekf,isam2,dead-reckoning", tmp_path / "log")
    for row in found.values():
        c = row.columns
        assert (c["status"], c["truth_kind"], c["nees"]) == ("done", "reference", None)
        assert (c["surveyed"], c["reference"], c["reason"]) == (1, None, "")
        assert (c["map_rmse_m"] is None) == (c["backend"] == "dead-reckoning")


def test_what_a_row_does_not_cover_is_remarked_on(tmp_path: Path, log_folder: Path) -> None:
    log, truth = logfile.read(log_folder)
    steps = list(log)
    steps[3] = steps[3]._replace(sightings=steps[3].sightings._replace(ids=np.full(len(steps[3].sightings.ids), -1)))
    some = truth._replace(t=truth.t[:10], poses=truth.poses[:10])
    logfile.write(tmp_path / "log", Log.from_steps("some", log.prior, steps), some)
    (row,) = go(tmp_path / "run", "ekf", tmp_path / "log").values()
    lost = len(steps[3].sightings.ids)
    assert lost > 0
    assert row.columns["ignored"] == lost
    assert row.columns["reason"] == (f"{lost} of {len(log.ids)} sightings have no id; truth is known at 10 of 40 steps")
