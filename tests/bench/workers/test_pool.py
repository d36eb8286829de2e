"""A pool of processes that each do many cells: the same numbers as in a process each, whatever becomes of one."""

import dataclasses
import gc
import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Generator, Iterable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import lasting_workers
from random_logs import random_log
from slamduel.backends import registry as backends
from slamduel.bench.measure.cell import Job, Result
from slamduel.bench.plan.reference import made_with_reference
from slamduel.bench.process.memory import limited
from slamduel.bench.workers import batch as batch_module
from slamduel.bench.workers import local_executor, pool_worker
from slamduel.bench.workers.batch import Batch, Finished
from slamduel.bench.workers.batch_queue import BatchQueue
from slamduel.bench.workers.executor import Here
from slamduel.bench.workers.local_executor import Local
from slamduel.core.factors import Dataset, Log
from slamduel.datasets import registry as datasets
from slamduel.datasets.formats import log_folder
from small_run import TIMES

MANY = ("ekf", "fastslam", "isam2", "ukf")


def batch(
    jobs: Sequence[str], *, seed: int = 0, first: int = 0, timeout_s: float = 60.0, keep: bool = False, **options: Any
) -> Batch:
    """Those backends on a small city; `options` are of backends, by their names."""
    city = dataclasses.replace(datasets.find("city").options(), steps=60, landmarks=40)
    return Batch("city", city, seed, tuple(numbered(jobs, seed, first, options)), timeout_s, keep)


def numbered(jobs: Sequence[str], seed: int, first: int, options: dict[str, Any]) -> Iterable[tuple[int, Job]]:
    for k, name in enumerate(jobs, first):
        builder = backends.find(name)
        chosen = dataclasses.replace(builder.options(), **options.get(name, {}))
        yield k, Job(name, name, chosen, seed, 300 if name.endswith("eats_memory") else 1000)


def children() -> set[int]:
    return {process.pid or 0 for process in multiprocessing.active_children()}


def by_index(ended: Iterable[Finished]) -> dict[int, Result]:
    found: dict[int, Result] = {}
    for finished in ended:
        assert finished.index is not None
        assert finished.index not in found
        found[finished.index] = finished.result
    return found


def numbers(result: Result) -> dict[str, Any]:
    """All of a result that must be the same every time, to the last bit."""
    row = {name: value for name, value in result.row.items() if name not in TIMES}
    arrays = {name: value for name, value in result.arrays.items() if not name.endswith("_ns")}
    return {"status": result.status, "reason": result.reason, **row} | {
        name: (value.dtype, value.shape, value.tobytes()) for name, value in arrays.items()
    }


@pytest.fixture(autouse=True, scope="module")
def alone() -> None:
    """Workers of other tests' runs are no children of these pools."""
    lasting_workers.end()


@pytest.fixture
def pool() -> Generator[Local]:
    made = Local(2)
    yield made
    made.close()
    assert not children()


def test_numbers_are_those_of_this_process_in_any_order(pool: Local) -> None:
    batches = [batch(MANY, seed=seed, first=10 * seed, keep=True) for seed in (0, 1)]
    with threadpool_limits(limits=2):  # as many as a notebook may have, and a worker has one
        here = by_index(Here().run(batches, alone=False))
    single = [dataclasses.replace(one, jobs=(job,)) for one in batches for job in one.jobs]
    random.Random(5).shuffle(single)
    pooled = by_index(pool.run(single, alone=False))
    assert here.keys() == pooled.keys()
    for index, result in here.items():
        assert result.status == "done"
        assert numbers(result) == numbers(pooled[index])
    alone = by_index(pool.run(single, alone=True))
    assert {index: numbers(result) for index, result in alone.items()} == {k: numbers(r) for k, r in here.items()}


def test_a_log_that_cannot_be_made_in_time_or_at_all_is_said_of_all_its_jobs(pool: Local) -> None:
    great = dataclasses.replace(datasets.find("city").options(), steps=1_000_000, landmarks=1_000_000)
    slow = dataclasses.replace(batch(["ekf", "ukf"], timeout_s=0.5), options=great)
    absent = dataclasses.replace(batch(["ekf"], first=7), dataset="log", options=log_folder.Options("not/there"))
    ended = list(pool.run([slow, absent, batch([], seed=3)], alone=False))
    found = {finished.index: finished for finished in ended}
    assert sorted(map(str, found)) == ["0", "1", "7", "None"]
    assert found[0].result.status == found[1].result.status == "timeout"
    assert found[7].result.status == "error"
    assert "not/there" in found[7].result.reason
    assert all(found[index].result.reason.startswith("the log could not be made: ") for index in (0, 1, 7))
    looked = found[None]
    assert (looked.result.status, len(looked.log.digest)) == ("done", 64)


def test_a_worker_that_somebody_kills_costs_no_result(pool: Local) -> None:
    pace: dict[str, Any] = {"misbehaving:slow": {"seconds": 0.15}}
    batches = [batch(["misbehaving:slow"] * 3, seed=seed, first=10 * seed, **pace) for seed in range(2)]
    results, killed = dict[int, Result](), 0
    for finished in pool.run(batches, alone=False):
        assert finished.index is not None
        results[finished.index] = finished.result
        if len(results) in (1, 3):
            os.kill(min(children()), signal.SIGKILL)
            killed += 1
    assert killed == 2
    assert {index: result.status for index, result in results.items()} == dict.fromkeys((0, 1, 2, 10, 11, 12), "done")


def test_an_idle_worker_that_is_gone_is_replaced(pool: Local) -> None:
    assert len(by_index(pool.run([batch(["ekf"])], alone=False))) == 1
    for pid in children():
        os.kill(pid, signal.SIGKILL)
    assert by_index(pool.run([batch(["ekf"])], alone=False))[0].status == "done"


def test_workers_are_replaced_after_many_cells_and_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_executor, "MOST_JOBS", 3)
    pool, seen = Local(1), list[set[int]]()
    jobs = ["dead-reckoning"] * 6
    for finished in pool.run([batch([name], first=k) for k, name in enumerate(jobs)], alone=True):
        assert finished.alone
        seen.append(children())
    assert all(len(pids) == 1 for pids in seen)
    assert [seen[k] == seen[k + 1] for k in range(5)] == [True, True, False, True, True]
    before = children()
    assert [f.result.status for f in pool.run([batch(["misbehaving:raises"])], alone=True)] == ["error"]
    assert not before & children()
    pool.close()


def test_alone_every_backend_has_a_process_of_its_own(pool: Local) -> None:
    list(pool.run([batch(["ekf"], seed=seed, first=seed) for seed in range(3)], alone=False))
    assert len(children()) == 2
    seen: list[set[int]] = []
    for finished in pool.run([batch(["ekf", "ukf"], seed=seed, first=10 * seed) for seed in range(2)], alone=True):
        assert finished.alone
        seen.append(children())
    assert [len(pids) for pids in seen] == [2] * 4
    assert all(pids == seen[0] for pids in seen)
    before = children()
    assert len(list(pool.run([batch(["ekf", "ukf"])], alone=True))) == 2
    assert children() == before


def test_alone_a_backend_that_goes_wrong_while_it_warms_up_is_one_result(pool: Local) -> None:
    names = ["ekf", "misbehaving:raises", "misbehaving:kills_itself", "misbehaving:sleeps_for_ever"]
    found = by_index(pool.run([batch(names, timeout_s=8.0)], alone=True))
    assert [found[k].status for k in range(4)] == ["done", "error", "error", "timeout"]


def test_alone_no_more_than_so_many_backends_keep_theirs(monkeypatch: pytest.MonkeyPatch, pool: Local) -> None:
    monkeypatch.setattr(local_executor, "MOST_POOLS", 2)
    for _ in pool.run([batch(["ekf", "ukf", "dead-reckoning"])], alone=True):
        assert len(children()) <= 2


def test_logs_are_made_on_every_core() -> None:
    pool = Local(1)
    made = list(pool.run([batch([], seed=seed) for seed in range(6)], alone=False))
    assert [finished.log is not None for finished in made] == [True] * 6
    assert len(children()) == min(6, os.cpu_count() or 1)
    pool.close()


def test_who_stops_listening_leaves_nothing_at_work(pool: Local) -> None:
    ended = pool.run([batch(["dead-reckoning", "misbehaving:sleeps_for_ever"])], alone=False)
    next(ended)
    assert children()
    ended.close()  # type: ignore[attr-defined]
    assert not children()
    assert by_index(pool.run([batch(["ekf"])], alone=False))[0].status == "done"


@pytest.mark.slow
def test_an_interrupt_leaves_nothing_at_work(pool: Local) -> None:
    ended = pool.run([batch(["dead-reckoning", "misbehaving:sleeps_for_ever"])], alone=False)
    next(ended)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        next(ended)
    timer.join()
    assert not children()


def test_pools_of_several_threads_inside_of_somebody_elses_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)  # type: ignore[attr-defined]
    found: dict[int, dict[int, Result]] = {}

    def run(seed: int) -> None:
        mine = Local(1)
        for k in range(2):
            found.setdefault(seed, {}).update(by_index(mine.run([batch(["ekf"], seed=seed, first=k)], alone=True)))
        mine.close()

    threads = [threading.Thread(target=run, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {seed: [result.status for result in ended.values()] for seed, ended in found.items()} == {
        seed: ["done", "done"] for seed in range(3)
    }
    assert not children()


def test_a_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    pool, digests = Local(1), list[str]()
    for steps in (20, 20, 21):
        log, truth = random_log(np.random.default_rng(1), steps, 8)
        assert isinstance(log, Log)
        shutil.rmtree(tmp_path / "log", ignore_errors=True)
        log_folder.write(tmp_path / "log", log, truth)
        on_file = dataclasses.replace(batch(["dead-reckoning"]), dataset="log",
                                      options=log_folder.Options(str(tmp_path / "log")))  # fmt: skip
        (ended,) = pool.run([on_file], alone=False)
        assert ended.log.digest == ended.result.row["digest"]
        digests.append(ended.log.digest)
    pool.close()
    assert digests[0] == digests[1] != digests[2]


def test_batches_on_one_log_go_to_one_worker() -> None:
    batches = [batch(["ekf"], seed=seed, first=10 * seed + k) for k in range(2) for seed in range(3)]
    queue = BatchQueue(batches)
    logs = [one.log for one in batches[:3]]
    assert len(queue) == 6
    first = queue.take([], set(), fresh=True)
    assert first == batches[0]
    assert queue.take([], {logs[0]}, fresh=True) == batches[1]  # the other worker has log 0
    assert queue.take([logs[0]], {logs[1]}, fresh=False) == batches[3]  # of log 0
    assert first is not None
    assert queue.try_again(first)
    assert not queue.try_again(first)
    assert queue.take([logs[0]], {logs[1]}, fresh=False) == batches[2]  # what is tried again is for another process
    assert queue.take([], set(), fresh=True) == first
    queue.put_back([batches[2]])
    assert [queue.take([], set(), fresh=False) for _ in range(3)] == [batches[4], batches[2], batches[5]]
    assert queue.take([], set(), fresh=True) is None
    assert len(queue) == 0


@pytest.mark.skipif(sys.platform != "linux", reason="no other kernel keeps the limit")
@pytest.mark.parametrize(("large_mb", "made", "held"), [(1000.0, 1, True), (0.0, 2, False)])
def test_a_worker_holds_no_large_log_between_batches(
    large_mb: float, made: int, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch_module, "LARGE_MB", large_mb)
    logs: list[weakref.ref[Log]] = []

    def making(*of: Any) -> Dataset:
        dataset = made_with_reference(*of)
        logs.append(weakref.ref(dataset.log))
        return dataset

    monkeypatch.setattr(batch_module, "made_with_reference", making)
    pipe = Script([batch(["ekf"], keep=True), batch(["ekf"], keep=True)], lambda: logs and logs[0]() is not None)
    pool_worker.serve(cast("Any", pipe))
    assert len(logs) == made
    assert pipe.looks == [False, held, held]
    first, second = (said.result for said in pipe.said if isinstance(said, pool_worker.Reply))
    assert numbers(first) == numbers(second)


class Script:
    """A worker's end of a pipe, which gives it these batches and looks whether it holds a log before each."""

    def __init__(self, batches: Sequence[Batch], held: Callable[[], bool | list[Any]]) -> None:
        self._batches, self._held = list(batches), held
        self.said, self.looks = list[Any](), list[bool]()

    def recv(self) -> tuple[int, Batch]:
        gc.collect()
        self.looks.append(bool(self._held()))
        if not self._batches:
            raise EOFError
        return 1, self._batches.pop(0)

    def send(self, said: Any) -> None:
        self.said.append(said if isinstance(said, pool_worker.Reply) else None)


def test_a_limit_of_memory_is_put_back() -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    for _ in range(2):
        with pytest.raises(MemoryError), limited(200):
            np.ones(50_000_000)
        assert resource.getrlimit(resource.RLIMIT_AS) == before
    assert len(np.ones(50_000_000)) == 50_000_000
    (ended,) = Here().run([batch(["misbehaving:eats_memory"])], alone=False)
    assert "memory limit" in ended.result.reason
    assert resource.getrlimit(resource.RLIMIT_AS) == before


PEAKS = """
import numpy as np
from slamduel.bench.process.memory import Peak
for megabytes in (80, 24, 48):
    peak = Peak()
    held = np.ones(megabytes << 17)
    del held
    print(peak.mb())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no other kernel forgets a peak")
def test_a_peak_is_that_of_the_latest() -> None:
    """In a process of its own: what other tests have left behind may be freed meanwhile."""
    said = subprocess.run([sys.executable, "-c", PEAKS], capture_output=True, text=True, check=True).stdout
    assert [float(line) for line in said.split()] == pytest.approx([80, 24, 48], abs=4)
