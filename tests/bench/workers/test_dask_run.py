"""Batches on a Dask cluster in this process, whose workers run made-up jobs: each does as a function says."""

import contextlib
import re
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

import pytest

pytest.importorskip("distributed", reason="Dask is not installed")

from dask import config
from distributed import Scheduler, SpecCluster, Worker, get_worker

from slamduel.bench.measure.cell import Job, Result
from slamduel.bench.workers import dask_executor, dask_requirements, dask_task
from slamduel.bench.workers.batch import Batch, Finished, LogFacts
from slamduel.bench.workers.dask_executor import Dask
from slamduel.core.errors import InputError

FACTS = LogFacts("digest", "", "", {})
TIMED: dict[str, Any] = {"resources": {"MACHINE": 1}}

Does = Callable[[str, Batch], Any]


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def on(said: list[str], monkeypatch: pytest.MonkeyPatch) -> Generator[Callable[..., Dask]]:
    """`on(does, a={}, b={})`: an executor on a cluster with workers of these names and options."""
    monkeypatch.setattr(dask_executor, "POLL_S", 0.05)
    with contextlib.ExitStack() as stack:
        stack.enter_context(config.set({"distributed.scheduler.allowed-failures": 0}))

        def begun(does: Does, **workers: dict[str, Any]) -> Dask:
            class Pool:
                def __init__(self, size: int) -> None:
                    assert size == 1

                def run(self, batches: Sequence[Batch], *, alone: bool) -> Iterator[Finished]:
                    yield from does(get_worker().name, batches[0])

            monkeypatch.setattr(dask_task, "Local", Pool)
            usual = {"host": "127.0.0.1", "dashboard": False, "dashboard_address": ":0"}
            spec = {
                name: {"cls": Worker, "options": {**usual, "nthreads": 1, **more}} for name, more in workers.items()
            }
            cluster: Any = stack.enter_context(
                SpecCluster(workers=spec, scheduler={"cls": Scheduler, "options": usual})
            )
            dask = Dask(cluster.scheduler_address, patience_s=0.5, say=said.append)
            stack.callback(dask.close)
            return dask

        yield begun


def answer(batch: Batch) -> list[Finished]:
    return [Finished(batch, index, FACTS, Result("done", ""), 0.0, False, "somewhere") for index, _ in batch.jobs]


def dies() -> None:
    """What the scheduler sees of a worker that is killed, in a task of that worker."""
    worker: Any = get_worker()
    task = worker.state.tasks[worker.get_current_task()]
    worker.loop.add_callback(worker.close, executor_wait=False, nanny=False)
    while task.state == "executing" and worker.status.name == "running":
        time.sleep(0.01)
    time.sleep(0.3)


def batches(number: int, jobs: int = 1) -> list[Batch]:
    job = Job("ekf", "ekf", None, 0, 1000)
    return [
        Batch("circle", None, k, tuple((k * jobs + i, job) for i in range(jobs)), 0.1, False) for k in range(number)
    ]


def ended(found: Sequence[Finished]) -> dict[int | None, str]:
    assert len({one.index for one in found}) == len(found), "a cell ended twice"
    return {one.index: one.result.status for one in found}


def raises() -> None:
    raise OSError("no space left")


@pytest.mark.parametrize(
    ("wrong", "names", "reason"),
    [
        (dies, "abcd", r"^Dask workers died or failed each time it ran, at last: tcp://"),
        (raises, "a", "OSError: no space"),
    ],
)
def test_a_cell_that_kills_its_workers_or_raises_is_to_blame_and_no_other(
    on: Any, wrong: Callable[[], None], names: str, reason: str
) -> None:
    def does(worker: str, batch: Batch) -> Any:
        if any(index == 3 for index, _ in batch.jobs):
            wrong()
        return answer(batch)

    found = list(on(does, **{name: {} for name in names}).run(batches(3, jobs=5), alone=False))
    assert ended(found) == {k: "error" if k == 3 else "done" for k in range(15)}
    (said,) = [one.result.reason for one in found if one.index == 3]
    assert re.search(reason, said)


def test_a_worker_that_dies_takes_nothing_with_it(on: Any) -> None:
    def does(worker: str, batch: Batch) -> Any:
        if worker == "a":
            dies()
        return answer(batch)

    with config.set({"distributed.scheduler.allowed-failures": 3}):
        dask = on(does, a={}, b={})
    assert ended(list(dask.run(batches(10), alone=False))) == dict.fromkeys(range(10), "done")


def test_a_worker_that_differs_is_named_and_not_used(on: Any, said: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def value(kind: str, name: str) -> str:
        with contextlib.suppress(ValueError):  # not on a worker
            return "1.0" if get_worker().name == "a" else "2.0"
        return "2.0"

    monkeypatch.setattr(dask_requirements, "_value", value)
    used = set[str]()

    def does(worker: str, batch: Batch) -> Any:
        used.add(worker)
        return answer(batch)

    dask = on(does, a={}, b={})
    for _ in range(2):
        assert ended(list(dask.run(batches(10), alone=False))) == dict.fromkeys(range(10), "done")
    assert used == {"b"}
    assert dask.slots == 1
    (sentence,) = said
    assert "on 127.0.0.1 is not used: " in sentence
    assert " is 1.0, expected 2.0; " in sentence
    with pytest.raises(InputError, match=r"none of its 1 workers can be used: tcp.* is 1.0.*same command"):
        list(on(does, a={}).run(batches(3), alone=False))


def test_where_all_workers_go_it_waits_and_then_says_how_to_go_on(
    on: Any, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_executor, "REMARK_S", 0.1)
    dask = on(lambda worker, batch: dies(), a={}, b={})
    with pytest.raises(InputError, match=r"no worker to run on for 0 s.*the same command continues the study"):
        list(dask.run(batches(4), alone=False))
    (sentence,) = said
    assert f"dask worker {dask.cluster.address}" in sentence


def test_few_batches_are_on_their_way_at_once(on: Any) -> None:
    dask, most = on(lambda worker, batch: answer(batch), a={"nthreads": 2}, b={"nthreads": 2}), 0
    for _ in dask.run(batches(100), alone=False):
        most = max(most, len(dask.cluster.client.futures))
    assert 0 < most < 50  # of 100; those released count until the client's own thread has seen it


def test_who_stops_listening_cancels_what_runs(on: Any) -> None:
    interrupted = list[str]()

    def does(worker: str, batch: Batch) -> Iterator[Finished]:
        try:
            for one in answer(batch):
                time.sleep(0.1 if batch.jobs[0][0] else 0)
                yield one
        except GeneratorExit:
            interrupted.append(worker)

    dask = on(does, a={})
    running = dask.run(batches(20, jobs=50), alone=False)
    next(running)
    running.close()
    end = time.monotonic() + 20
    while not interrupted:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert not dask.cluster.client.futures


def test_timed_cells_run_one_at_a_time_where_the_resource_is(on: Any) -> None:
    busy, most, used = list[str](), 0, set[str]()

    def does(worker: str, batch: Batch) -> Any:
        nonlocal most
        busy.append(worker)
        used.add(worker)
        most = max(most, busy.count(worker))
        time.sleep(0.02)
        busy.remove(worker)
        return answer(batch)

    dask = on(does, a={**TIMED, "nthreads": 3}, b={"nthreads": 3}, c={**TIMED, "nthreads": 3, "host": "127.0.0.2"})
    found = list(dask.run(batches(20), alone=True))
    assert ended(found) == dict.fromkeys(range(20), "done")
    assert all(one.alone for one in found)
    assert (used, most) == ({"a", "c"}, 1)


def test_two_workers_of_a_machine_with_the_resource_are_refused(on: Any) -> None:
    dask = on(lambda worker, batch: answer(batch), a=TIMED, b=TIMED)
    with pytest.raises(InputError, match=r"two workers of 127.0.0.1 have the resource MACHINE"):
        list(dask.run(batches(1), alone=True))


def test_the_resource_is_asked_for_where_nobody_has_it(on: Any) -> None:
    dask = on(lambda worker, batch: answer(batch), a={})
    with pytest.raises(InputError, match=r'dask worker tcp://.* --nthreads 1 --resources "MACHINE=1"'):
        list(dask.run(batches(1), alone=True))


@pytest.mark.parametrize(
    ("workers", "times"),
    [({"a": {}}, False), ({"a": TIMED, "b": {}}, True), ({"a": TIMED, "b": TIMED}, False)],
    ids=["none for timed cells", "one", "two on a machine"],
)
def test_times_are_comparable_where_each_machine_has_one_worker_for_them(
    on: Any, workers: dict[str, dict[str, Any]], times: bool
) -> None:
    assert on(lambda worker, batch: answer(batch), **workers).times is times
