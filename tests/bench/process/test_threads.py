"""Cells are measured with one thread of linear algebra, whatever the process has, which it has again afterwards."""

import dataclasses
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Belief, Builder, Map, NoOptions, Pose, Prior, Step
from slamduel.bench.measure import cell
from slamduel.bench.measure.cell import Job
from slamduel.bench.measure.drive import drive, timed_again

SEVERAL = 3


def libraries() -> dict[str, int]:
    """The number of threads of every library that is loaded, by its file."""
    return {library["filepath"]: library["num_threads"] for library in threadpool_info()}


def threads() -> set[int]:
    """The numbers of threads of all libraries that are loaded."""
    return {*libraries().values()}


class Counts:
    """Stands still, and records the threads that it may use."""

    seen: list[set[int]] = []  # noqa: RUF012 - of all that were made

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        del options, rng
        self.pose = prior.pose

    def step(self, step: Step) -> Pose:
        del step
        self.seen.append(threads())
        return self.pose

    def belief(self) -> Belief:
        self.seen.append(threads())
        return Belief(self.pose)

    def map(self) -> Map:
        return Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> None:
        self.seen.append(threads())


class Fails(Counts):
    def finish(self) -> None:
        super().finish()
        raise ValueError("asked for")


@pytest.fixture(params=[Counts, Fails])
def job(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Job:
    monkeypatch.setattr(registry, "find", lambda _: Builder(request.param))
    monkeypatch.setattr(Counts, "seen", [])
    return Job("counts", "counts", NoOptions(), 0, 8000)


@pytest.mark.parametrize("again", [False, True])
def test_a_cell_in_this_process_has_one_thread_and_then_those_from_before(job: Job, again: bool) -> None:
    log, truth = random_log(np.random.default_rng(1), 25, 6)
    with threadpool_limits(limits=SEVERAL):
        before = libraries()
        assert {*before.values()} == {SEVERAL}
        result = cell.run_on(dataclasses.replace(job, again=again), lambda: log, lambda: truth)
        assert {name: libraries()[name] for name in before} == before  # scoring may have loaded another one
    assert result.status in ("done", "error")
    assert Counts.seen
    assert set(map(frozenset, Counts.seen)) == {frozenset({1})}


@pytest.mark.parametrize("times", [drive, timed_again])
def test_whoever_drives_a_backend_has_its_steps_on_one_thread(
    times: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Counts, "seen", [])
    log, _ = random_log(np.random.default_rng(1), 25, 6)
    with threadpool_limits(limits=SEVERAL):
        times(Builder(Counts), NoOptions(), log, lambda: np.random.default_rng(0))
        assert threads() == {SEVERAL}
    assert Counts.seen[-1] == {1}
    assert Counts.seen.count({1}) >= 25  # and in the warm-up, which is not timed, whatever there was


LATE = """
import numpy as np
from threadpoolctl import threadpool_info
from slamduel.backends.api import Belief, Builder, Map, NoOptions
from slamduel.bench.measure.drive import timed_again
from random_logs import random_log

seen = []

class Late:
    def __init__(self, prior, options, rng):
        self.pose = prior.pose

    def step(self, step):
        import scipy.linalg  # which has a library of its own

        seen.append({one["filepath"]: one["num_threads"] for one in threadpool_info()})
        return self.pose

    def belief(self):
        return Belief(self.pose)

    def map(self):
        return Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self):
        return None

log, _ = random_log(np.random.default_rng(1), 25, 6)
before = len(threadpool_info())
timed_again(Builder(Late), NoOptions(), log, lambda: np.random.default_rng(0))
print(before, len(seen[-1]), set(seen[-1].values()), {one["num_threads"] for one in threadpool_info()})
"""


def test_a_library_that_the_backend_loads_is_held_to_one_thread_too() -> None:
    own = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    own |= {"OPENBLAS_NUM_THREADS": "2", "PYTHONPATH": os.pathsep.join(sys.path)}
    told = subprocess.run([sys.executable, "-c", LATE], env=own, capture_output=True, text=True, check=True).stdout
    before, loaded, *threads_then = told.split(maxsplit=2)
    if before == loaded:
        pytest.skip("scipy and numpy share one library here, or it was loaded before")
    assert threads_then == ["{1} {2}\n"]
