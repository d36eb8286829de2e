"""A study runs what has no result of its own yet, and nothing else, whatever has changed in the meantime."""

from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np
import pytest

from slamduel.bench.engine.engine import Tally, run
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.measure.cell import Result
from slamduel.bench.record.store import Store
from slamduel.bench.study.file import made
from slamduel.bench.study.only import choice
from slamduel.bench.study.study import about
from slamduel.bench.workers.batch import Batch, Finished, unmade
from slamduel.bench.workers.executor import Here
from slamduel.core.errors import InputError
from slamduel.datasets.formats import log_folder
from slamduel.datasets.worlds.linear import Options, linear
from small_study import silent

STUDY = """
[[cells]]
dataset = "linear[steps=8]"
backend = ["ekf", "fastslam", "ekf[gate=0.9]"]
seeds = 2
"""
ALL = {(name, seed) for name in ("ekf", "fastslam", "ekf[gate=0.9]") for seed in (0, 1)}


class Counting(Here):
    """Cells in this process, and which they were; logs of the seeds in `lost` cannot be made."""

    slots = 4

    def __init__(self, lost: Sequence[int] = (), failing: Sequence[str] = ()) -> None:
        self.ran: list[tuple[str, int]] = []
        self.lost, self.failing = lost, failing

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        for batch in batches:
            self.ran += [(job.backend, job.seed) for _, job in batch.jobs]
            if batch.seed in self.lost:
                yield from unmade(batch, Result("error", "the log could not be made: it rains"), 0.1)
                continue
            for finished in super().run([batch], alone=alone):
                fails = finished.index is not None and dict(batch.jobs)[finished.index].backend in self.failing
                yield finished._replace(result=Result("timeout", "it took too long")) if fails else finished


def go(
    folder: Path,
    text: str = STUDY,
    *,
    executor: Counting | None = None,
    only: Sequence[str] = (),
    limit: int | None = None,
    retry: bool = False,
) -> tuple[set[tuple[str, int]], Tally]:
    """The cells that were run, none of them twice, and how far the study is."""
    study, executor = made("study.toml", text, full=False), executor or Counting()
    wanted = RunRequest(choice(study, only), limit, retry)
    tally = run(study, folder, executor, wanted, about(study, folder, ["bench", "ablate", "study.toml"]), silent())
    assert len(set(executor.ran)) == len(executor.ran)
    return set(executor.ran), tally


def statuses(folder: Path) -> list[str]:
    with Store(folder) as store:
        return store.table([]).columns["status"].tolist()


def test_what_has_a_result_is_not_run_again(tmp_path: Path) -> None:
    assert go(tmp_path) == (ALL, Tally(6, 6, 0))
    assert go(tmp_path) == (set(), Tally(6, 6, 0))


def test_one_option_runs_its_cells_and_none_when_it_is_put_back(tmp_path: Path) -> None:
    go(tmp_path)
    ran, tally = go(tmp_path, STUDY.replace("gate=0.9", "gate=0.99"))
    assert ran == {("ekf[gate=0.99]", 0), ("ekf[gate=0.99]", 1)}
    assert tally == Tally(6, 6, 0)
    assert go(tmp_path) == (set(), Tally(6, 6, 0))
    with Store(tmp_path) as store:
        assert len(store.statuses()) == 8  # nothing is thrown away


def test_another_log_runs_all_that_is_on_it(tmp_path: Path) -> None:
    go(tmp_path)
    assert go(tmp_path, STUDY.replace("steps=8", "steps=9"))[0] == ALL
    assert go(tmp_path, STUDY.replace("seeds = 2", "seeds = 3"))[0] == {(name, 2) for name, _ in ALL}


def test_the_data_of_a_log_are_what_counts_not_their_place(tmp_path: Path) -> None:
    motions, seen = tmp_path / "odometry.csv", tmp_path / "detections.csv"
    rows = [f"{t},{0.1 * t},0,0" for t in range(6)]
    motions.write_text("\n".join(["t,x,y,heading", *rows]))
    seen.write_text("t,id,range,bearing\n1,5,2.0,0.1\n3,5,1.8,0.1\n")
    text = STUDY + f'\n[[cells]]\ndataset = "csv[odometry={motions},detections={seen}]"\nbackend = "ukf"\n'
    folder = tmp_path / "out"
    assert go(folder, text)[1] == Tally(7, 7, 0)
    motions.touch()
    assert go(folder, text)[0] == set()
    seen.write_text(seen.read_text().replace("1.8", "1.9"))
    assert go(folder, text)[0] == {("ukf", 0)}
    seen.write_text(seen.read_text().replace("1.9", "1.8"))
    assert go(folder, text)[0] == set()


def test_what_failed_is_run_again_where_that_is_asked_for(tmp_path: Path) -> None:
    assert go(tmp_path, executor=Counting(failing=["fastslam"]))[1] == Tally(6, 6, 2)
    assert go(tmp_path) == (set(), Tally(6, 6, 2))
    assert go(tmp_path, retry=True, only=["seed=1"]) == ({("fastslam", 1)}, Tally(6, 6, 1))
    assert go(tmp_path, retry=True, executor=Counting(failing=["fastslam"]))[1] == Tally(6, 6, 1)
    assert go(tmp_path, retry=True) == ({("fastslam", 0)}, Tally(6, 6, 0))


def test_so_is_what_had_no_log(tmp_path: Path) -> None:
    ran, tally = go(tmp_path, executor=Counting(lost=[1]))
    assert (ran, tally) == (ALL, Tally(6, 6, 3))
    assert statuses(tmp_path) == ["done", "error"] * 3
    assert go(tmp_path) == (set(), Tally(6, 6, 3))
    assert go(tmp_path, STUDY.replace("gate=0.9", "gate=0.99"))[0] == {("ekf[gate=0.99]", 0)}
    assert go(tmp_path, retry=True) == ({(name, 1) for name, _ in ALL}, Tally(6, 6, 0))
    assert statuses(tmp_path) == ["done"] * 6


def test_results_stay_when_their_log_cannot_be_made_once_more(tmp_path: Path) -> None:
    less = STUDY.replace('"fastslam", ', "")
    assert go(tmp_path, less)[1] == Tally(4, 4, 0)
    ran, tally = go(tmp_path, executor=Counting(lost=[1]))
    assert (ran, tally) == ({("fastslam", 0), ("fastslam", 1)}, Tally(6, 6, 1))
    assert go(tmp_path) == (set(), Tally(6, 6, 1))
    assert statuses(tmp_path).count("done") == 5
    assert go(tmp_path, retry=True) == ({("fastslam", 1)}, Tally(6, 6, 0))


def test_a_log_whose_files_have_come_is_there_without_being_asked_for(tmp_path: Path) -> None:
    motions, seen = tmp_path / "odometry.csv", tmp_path / "detections.csv"
    seen.write_text("t,id,range,bearing\n1,5,2.0,0.1\n")
    text = f'[[cells]]\ndataset = "csv[odometry={motions},detections={seen}]"\nbackend = "ekf"\n'
    folder = tmp_path / "out"
    assert go(folder, text) == (set(), Tally(1, 1, 1))  # one look was enough to know
    assert statuses(folder) == ["error"]
    assert go(folder, text) == (set(), Tally(1, 1, 1))
    motions.write_text("t,x,y,heading\n0,0,0,0\n1,0.1,0,0\n2,0.2,0,0\n")
    assert go(folder, text) == ({("ekf", 0)}, Tally(1, 1, 0))


def test_a_part_of_it_is_run_and_later_the_rest(tmp_path: Path) -> None:
    first, tally = go(tmp_path, limit=2)
    assert (len(first), tally) == (2, Tally(6, 2, 0))
    second, tally = go(tmp_path, only=["backend=fastslam"])
    assert second == {("fastslam", 0), ("fastslam", 1)} - first
    assert tally == Tally(6, len(first | second), 0)
    rest, tally = go(tmp_path)
    assert (rest, tally) == (ALL - first - second, Tally(6, 6, 0))


def test_cells_that_can_only_be_the_same_are_one_result(tmp_path: Path) -> None:
    log, truth = linear(Options(steps=8), np.random.default_rng(0))
    for copy in ("one", "other"):
        log_folder.write(tmp_path / copy, log, truth)
    text = f'cells = [{{dataset = ["{tmp_path}/one", "{tmp_path}/other"], backend = "ekf"}}]\n'
    folder = tmp_path / "out"
    assert go(folder, text)[1] == Tally(2, 2, 0)
    with Store(folder) as store:
        values = store.table(["ate_m"]).columns["ate_m"]
        assert len(store.statuses()) == 1
    assert np.isfinite(values[0])
    assert values[0] == values[1]


def test_a_folder_of_another_study_is_left_alone(tmp_path: Path) -> None:
    go(tmp_path)
    study = made("other.toml", STUDY, full=False)
    with pytest.raises(InputError, match="holds the study study, expected other or another folder"):
        run(study, tmp_path, Counting(), RunRequest(), about(study, tmp_path, []), silent())
    assert go(tmp_path)[0] == set()
