"""What is done about workers that go wrong, on a made-up cluster: each of its workers does as a function says."""

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("distributed", reason="Dask is not installed")

from distributed import KilledWorker

from slamduel.bench.measure.cell import Job, Result
from slamduel.bench.workers import dask_run, dask_workers
from slamduel.bench.workers.batch import Batch, Finished, LogFacts
from slamduel.bench.workers.dask_cluster import Seen
from slamduel.bench.workers.dask_run import Run
from slamduel.bench.workers.dask_workers import Crew
from slamduel.frontend.errors import InputError

FACTS = LogFacts("digest", "", "", {})


class Future:
    def __init__(self, outcome: Any) -> None:
        self.outcome, self.released = outcome, False

    def result(self, timeout: float) -> bytes:
        if isinstance(self.outcome, BaseException):
            raise self.outcome
        return pickle.dumps(self.outcome)

    def release(self) -> None:
        self.released = True


class MadeUp:
    """A cluster: `does(worker, batch)` is an answer, an exception, or None for never."""

    address = "tcp://made-up:8786"

    def __init__(self, names: Sequence[str], does: Callable[[str, Batch], Any], threads: int = 1) -> None:
        self.seen = {name: Seen(name, name, threads, False, 0.0, 0, True) for name in names}
        self.does, self.given, self.kept = does, list[tuple[str, Batch]](), list[Callable[[], None]]()
        self.stopped: set[str] = set()
        self.open: set[Future] = set()
        self.most = 0

    def workers(self) -> list[Seen]:
        for name, seen in self.seen.items():
            if name not in self.stopped:
                self.seen[name] = seen._replace(last_seen=seen.last_seen + 1)
        return list(self.seen.values())

    def submit(self, call: Any, argument: Batch, worker: str, *, timed: bool, done: Callable[[Any], None]) -> Future:
        self.given.append((worker, argument))
        future = Future(self.does(worker, argument))
        self.open = {one for one in self.open if not one.released} | {future}
        self.most = max(self.most, len(self.open))
        if future.outcome is not None:
            done(future)
        else:
            future.outcome = answer(argument)
            self.kept.append(lambda: done(future))
        return future


def answer(batch: Batch, facts: LogFacts | None = FACTS, reason: str = "") -> list[Finished]:
    result = Result("done" if facts else "error", reason)
    return [Finished(batch, index, facts, result, 0.0, False, "") for index, _ in batch.jobs]


def batches(number: int, jobs: int = 1) -> list[Batch]:
    job = Job("ekf", "ekf", None, 0, 1000)
    return [
        Batch("circle", None, k, tuple((k * jobs + i, job) for i in range(jobs)), 0.1, False) for k in range(number)
    ]


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def run(said: list[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Iterator[Finished]]:
    monkeypatch.setattr(dask_run, "CENSUS_S", 0.01)

    def begin(cluster: Any, batches: Sequence[Batch], *, alone: bool = False) -> Iterator[Finished]:
        return Run(cluster, Crew(0.2), batches, alone, 0.3, said.append).finished(lambda batch: batch)  # pyright: ignore[reportArgumentType, reportReturnType]

    return begin


def ended(found: Sequence[Finished]) -> dict[int | None, str]:
    assert len({one.index for one in found}) == len(found), "a cell ended twice"
    return {one.index: one.result.status for one in found}


def test_a_cell_is_blamed_when_it_alone_has_killed_several_workers(run: Any) -> None:
    def does(worker: str, batch: Batch) -> Any:
        last: Any = SimpleNamespace(address=worker)
        return KilledWorker("x", last, 0) if any(index == 3 for index, _ in batch.jobs) else answer(batch)

    cluster = MadeUp("abcdef", does)
    found = list(run(cluster, batches(3, jobs=5)))
    assert ended(found) == {k: "error" if k == 3 else "done" for k in range(15)}
    (reason,) = [one.result.reason for one in found if one.index == 3]
    assert reason.startswith("3 Dask workers failed while it ran, the last one so: worker ")
    killed = [worker for worker, batch in cluster.given if any(index == 3 for index, _ in batch.jobs)]
    assert len(killed) == 5
    assert len(set(killed[:2])) == 2
    assert len(set(killed[2:])) == 3


def test_a_worker_that_goes_takes_nothing_with_it(run: Any) -> None:
    def does(worker: str, batch: Batch) -> Any:
        if worker == "a":
            cluster.seen.pop("a", None)
            return None
        return answer(batch)

    cluster = MadeUp("ab", does)
    assert ended(list(run(cluster, batches(10)))) == dict.fromkeys(range(10), "done")


def test_what_comes_late_from_a_silent_worker_is_not_looked_at(run: Any, said: list[str]) -> None:
    def does(worker: str, batch: Batch) -> Any:
        if worker == "a" and not cluster.kept:
            cluster.stopped.add("a")
            return None
        if said and cluster.stopped:
            cluster.kept[0]()
            cluster.stopped.clear()
        return answer(batch)

    cluster = MadeUp("ab", does)
    found: list[Finished] = []
    for one in run(cluster, batches(60)):
        found.append(one)
        time.sleep(0.01)
    assert ended(found) == dict.fromkeys(range(60), "done")
    assert said == ["Worker a on a has fallen silent: others do what it had."]
    assert "a" in {worker for worker, _ in cluster.given[-10:]}, "it is not asked again"


def test_a_worker_that_is_long_overdue_is_asked_no_more(
    run: Any, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_workers, "START_S", 0)
    cluster = MadeUp("ab", lambda worker, batch: None if worker == "a" else answer(batch))
    assert ended(list(run(cluster, batches(10)))) == dict.fromkeys(range(10), "done")
    assert said == ["Worker a on a is not used: has not ended a batch long after the limits of its cells."]


def test_a_worker_that_lacks_what_others_have_is_named(run: Any, said: list[str]) -> None:
    def does(worker: str, batch: Batch) -> Any:
        return answer(batch, None, "the log could not be made: no such file") if worker == "a" else answer(batch)

    assert ended(list(run(MadeUp("abc", does), batches(10)))) == dict.fromkeys(range(10), "done")
    assert said == ["Worker a on a is not used: lacks what others have: the log could not be made: no such file."]


def test_a_log_that_nobody_can_make_has_failed(run: Any, said: list[str]) -> None:
    found = list(run(MadeUp("ab", lambda worker, batch: answer(batch, None, "no such file")), batches(4)))
    assert ended(found) == dict.fromkeys(range(4), "error")
    assert not said


def test_a_worker_that_makes_another_log_is_named(run: Any, said: list[str]) -> None:
    def does(worker: str, batch: Batch) -> Any:
        return answer(batch, FACTS if worker == "a" else FACTS._replace(digest="another"))

    split = [replace(batch, seed=0) for batch in batches(9)]
    found = list(run(MadeUp("ab", does), split))
    assert ended(found) == dict.fromkeys(range(9), "done")
    assert all(one.log == FACTS for one in found)
    assert said == ["Worker b on b is not used: makes another log of circle than other workers do."]


def test_where_no_worker_is_fit_that_is_an_error(run: Any, said: list[str]) -> None:
    with pytest.raises(InputError, match=r"none of its 2 workers can be used: a .*numpy is 1.0.*; b .*same command"):
        list(run(MadeUp("ab", lambda worker, batch: ["numpy is 1.0, expected 2.0"]), batches(3)))
    assert len(said) == 2


def test_without_workers_it_waits_and_then_says_how_to_go_on(
    run: Any, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_run, "REMARK_S", 0.1)
    with pytest.raises(InputError, match=r"no worker to run on for 0 s.*the same command goes on with the study"):
        list(run(MadeUp("", lambda worker, batch: answer(batch)), batches(1)))
    assert len(said) == 1
    assert "dask worker tcp://made-up:8786" in said[0]


def test_a_worker_has_one_batch_more_than_threads_at_most(run: Any) -> None:
    cluster = MadeUp("ab", lambda worker, batch: answer(batch), threads=2)
    assert len(list(run(cluster, batches(500)))) == 500
    assert cluster.most == 6


def test_timed_cells_run_one_at_a_time_where_nothing_else_does(run: Any) -> None:
    cluster = MadeUp("abcd", lambda worker, batch: answer(batch), threads=3)
    for name, change in {
        "a": {"timed": True},
        "b": {"timed": True, "host": "shared"},
        "c": {"host": "shared", "executing": 1},
    }.items():
        cluster.seen[name] = cluster.seen[name]._replace(**change)
    assert len(list(run(cluster, batches(20), alone=True))) == 20
    assert {worker for worker, _ in cluster.given} == {"a"}
    assert cluster.most == 1


def test_two_workers_of_a_machine_with_the_resource_are_refused(run: Any) -> None:
    cluster = MadeUp("ab", lambda worker, batch: answer(batch))
    cluster.seen = {name: seen._replace(host="one", timed=True) for name, seen in cluster.seen.items()}
    with pytest.raises(InputError, match="workers a and b of one machine, one, both have the resource MACHINE"):
        list(run(cluster, batches(1), alone=True))


def test_the_resource_is_asked_for_where_nobody_has_it(run: Any) -> None:
    with pytest.raises(InputError, match=r'dask worker tcp://made-up:8786 --nthreads 1 --resources "MACHINE=1"'):
        list(run(MadeUp("a", lambda worker, batch: answer(batch)), batches(1), alone=True))
