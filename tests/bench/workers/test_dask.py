import re
import shutil
import signal
import socket
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed", reason="Dask is not installed")

import older_machine
import slamduel
from dask_processes import WITHOUT, Processes
from places import LAYERS
from slamduel.bench.engine.engine import Tally, run
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.measure.cell import Job
from slamduel.bench.measure.repeats import ROUNDS
from slamduel.bench.plan import spec
from slamduel.bench.plan.plan import Plan
from slamduel.bench.run.runner import run as run_plan
from slamduel.bench.study.file import made
from slamduel.bench.study.study import about
from slamduel.bench.verdict.costs import compare_costs
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.columns import MACHINE
from slamduel.bench.workers import dask_cluster
from slamduel.bench.workers.batch import Batch, Finished
from slamduel.bench.workers.dask_cluster import Cluster
from slamduel.bench.workers.dask_executor import Dask
from slamduel.bench.workers.executor import Here
from slamduel.core.errors import InputError
from slamduel.datasets.formats.gtsam_text import shipped
from small_run import Silent, rows
from small_study import silent

pytestmark = pytest.mark.slow

DID = "|".join(column.name for column in MACHINE)
TIMED = re.compile(rf".*(_us|_us_\w+|_s|_mb|_ns)|real_time|late_share|(growth|slope|last_over)_\w+|over_\d+ms|{DID}")
"""The columns and arrays that say how long something took, how much memory, or what the machine did meanwhile."""


def batches(seeds: int, backends: str = "ekf,dead-reckoning", timeout_s: float = 60) -> list[Batch]:
    """Small cells: these backends on each of so many logs."""
    (dataset,) = spec.dataset_variants("matlab-report")
    variants = spec.backend_variants(backends)
    jobs = [
        [(k * len(variants) + i, Job(v.label, v.name, v.options, k, 4000)) for i, v in enumerate(variants)]
        for k in range(seeds)
    ]
    return [Batch(dataset.name, dataset.options, k, tuple(jobs[k]), timeout_s, True) for k in range(seeds)]


def untimed(found: Sequence[Finished]) -> dict[int | None, tuple[Any, ...]]:
    """What must be the same wherever a cell ran, by its place."""
    assert len({one.index for one in found}) == len(found), "a cell ended twice"
    return {
        one.index: (
            one.log[:3] if one.log else None,
            one.result.status,
            one.result.reason,
            {name: repr(value) for name, value in one.result.row.items() if not TIMED.fullmatch(name)},
            {name: repr(value) for name, value in one.result.arrays.items() if not TIMED.fullmatch(name)},
            {name: value.tobytes() for name, value in one.result.arrays.items() if name in ("online", "map_xy")},
        )
        for one in found
    }


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Generator[Processes]:
    started = Processes(tmp_path_factory.mktemp("dask"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def workers(processes: Processes) -> list[Any]:
    return [processes.worker() for _ in range(3)]


@pytest.fixture
def executor(processes: Processes) -> Generator[tuple[Dask, list[str]]]:
    said: list[str] = []
    made = Dask(str(processes.file), patience_s=60, say=said.append)
    yield made, said
    made.close()


def test_one_worker_killed_and_one_hung_change_nothing(
    processes: Processes, workers: list[Any], executor: tuple[Dask, list[str]]
) -> None:
    dask, said = executor
    wanted = batches(16)
    processes.until(lambda: dask.slots == 3)
    found: list[Finished] = []
    for finished in dask.run(wanted, alone=False):
        found.append(finished)
        if len(found) == 3:
            workers[0].kill()
        elif len(found) == 9:
            workers[1].send_signal(signal.SIGSTOP)
        elif len(found) == 30:  # it is late: it has been given up
            workers[1].send_signal(signal.SIGCONT)
    assert untimed(found) == untimed(list(Here().run(wanted, alone=False)))
    assert not any(finished.alone for finished in found)
    assert not said


def test_what_a_backend_does_to_its_process_does_not_reach_the_worker(
    workers: list[Any], executor: tuple[Dask, list[str]]
) -> None:
    dask, said = executor
    wanted = batches(2, "misbehaving:kills_itself,ekf,misbehaving:sleeps_for_ever", timeout_s=20)
    ended = {one.index: one.result for one in dask.run(wanted, alone=False)}
    assert [ended[k].status for k in range(6)] == ["error", "done", "timeout"] * 2
    assert "SIGKILL" in ended[0].reason
    assert workers[2].poll() is None
    assert not said


def test_a_cell_that_kills_its_workers_again_and_again_is_to_blame_and_no_other(tmp_path: Path) -> None:
    with closing(Processes(tmp_path)) as there, closing(Dask(there.address)) as dask:
        there.worker("--nanny")
        wanted = [*batches(1, "misbehaving:kills_its_runner,ekf"), *batches(3, "ekf")[2:]]
        found = list(dask.run(wanted, alone=False))
    assert len(found) == 3
    ended = {one.index: one.result for one in found}
    assert [ended[k].status for k in range(3)] == ["error", "done", "done"]
    assert ended[0].reason.startswith("Dask workers died or failed each time it ran, at last: tcp://")


def test_workers_with_other_code_or_none_are_named_and_not_used(tmp_path: Path) -> None:
    package = Path(slamduel.__file__).parent
    for layer in LAYERS:
        shutil.copytree(package / layer, tmp_path / "slamduel" / layer)
    shutil.copy(package / "__init__.py", tmp_path / "slamduel")
    with (tmp_path / "slamduel" / "backends" / "gaussian" / "ekf.py").open("a") as code:
        code.write("# another version\n")
    said: list[str] = []
    with closing(Processes(tmp_path)) as there, closing(Dask(there.address, say=said.append)) as dask:
        there.worker(before=WITHOUT)
        there.worker(path=tmp_path)
        there.until(lambda: len(dask.cluster.workers()) == 2)
        with pytest.raises(InputError, match=r"none of its 2 workers can be used.*same command"):
            list(dask.run(batches(4), alone=False))
    assert any("module slamduel.backends.gaussian.ekf is not the same" in sentence for sentence in said), said
    assert any("cannot run slamduel: ModuleNotFoundError" in sentence for sentence in said), said


MIXED = """
[[cells]]
dataset = [
    "aruco-room[markers=8,seconds=2,frame_rate=2]", "linear[steps=40]", "circle[steps=40,landmarks=20]", "VICTORIA"
]
backend = ["dead-reckoning", "ekf", "ukf"]
seeds = 2
"""
"""Rendered, simulated and read logs; of the last the truth is unknown."""


def test_machines_with_other_processors_finish_one_study(tmp_path: Path) -> None:
    victoria = tmp_path / "victoria.txt"
    victoria.write_text("\n".join(shipped("victoria_park.txt").read_text().splitlines()[:400]) + "\n")
    study = made("study.toml", MIXED.replace("VICTORIA", f"gtsam[path={victoria},noise=cov]"), full=False)
    said, found, out = list[str](), list[Finished](), tmp_path / "out"

    class Listening(Dask):
        def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
            for finished in super().run(batches, alone=alone):
                found.append(finished)
                yield finished

    with closing(Processes(tmp_path)) as there, closing(Listening(there.address, say=said.append)) as dask:
        there.worker()
        there.worker(environment=older_machine.environment("nehalem"))
        there.until(lambda: dask.slots == 2)
        wanted = RunRequest(lambda _: True, None, False)
        assert run(study, out, dask, wanted, about(study, out, []), silent()) == Tally(21, 21, 0)
    assert not said
    logs: dict[Any, set[tuple[str, str]]] = {}
    for finished in found:
        logs.setdefault(finished.batch.log[:3], set()).add(finished.log.digests)
    assert len(logs) == 7
    assert {len(digests) for digests in logs.values()} == {1}, logs


def test_a_worker_is_no_scheduler(processes: Processes, workers: list[Any], executor: tuple[Dask, list[str]]) -> None:
    processes.until(lambda: bool(executor[0].cluster.workers()))
    with pytest.raises(InputError, match="found a Dask Worker there"):
        Cluster(next(iter(executor[0].cluster.workers())))


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("nonsense", "missing port number"),
        ("http://login:8787/status", "unknown address scheme 'http'"),
        ("absent.json", "No such file or directory"),
    ],
)
def test_what_is_no_address(address: str, words: str) -> None:
    with pytest.raises(InputError, match=f"--scheduler {address}: .*{words}.*; expected tcp://HOST:PORT"):
        Cluster(address)


def test_a_file_without_an_address(tmp_path: Path) -> None:
    (tmp_path / "s.json").write_text("[]")
    with pytest.raises(InputError, match=r"s\.json: no Dask scheduler: the file holds no address; expected"):
        Cluster(str(tmp_path / "s.json"))


def test_nobody_or_somebody_else_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 1)
    with socket.socket() as free, socket.socket() as deaf:
        free.bind(("127.0.0.1", 0))
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        for somebody in (free, deaf):
            with pytest.raises(InputError, match="no Dask scheduler: no answer within 1 s"):
                Cluster(f"127.0.0.1:{somebody.getsockname()[1]}")


@pytest.mark.parametrize("by", [signal.SIGSTOP, signal.SIGKILL])
def test_the_scheduler_falls_silent_or_dies(
    processes: Processes, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], by: signal.Signals
) -> None:
    """Last of those that use it."""
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 2)
    processes.worker()
    dask = Dask(processes.address, say=lambda _: None)
    running = dask.run(batches(30), alone=False)
    next(running)
    processes.scheduler.send_signal(by)
    with pytest.raises(InputError, match=r"scheduler has ended.*are stored: the same command continues"):
        list(running)
    dask.close()
    processes.scheduler.send_signal(signal.SIGCONT)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("resources", [(), ("--resources", "MACHINE=1")])
def test_small_cells_of_a_run_are_timed_again_where_there_is_a_worker_for_timed_cells(
    tmp_path: Path, resources: tuple[str, ...]
) -> None:
    words = {"backend": "dead-reckoning,ekf", "dataset": "circle[steps=30]", "seeds": 3, "repeats": None}
    plan = Plan.from_words({**words, "timeout_s": 60.0, "memory_mb": 4000})
    (tmp_path / "dask").mkdir()
    with closing(Processes(tmp_path / "dask")) as there, closing(Dask(there.address)) as dask:
        there.worker(*resources)
        there.worker()
        there.until(lambda: dask.slots == 2)
        run_plan(plan, tmp_path / "run", dask, ["bench"], Silent())
    reckoning, ekf = lines(rows(tmp_path / "run").values())
    found = compare_costs(reckoning, ekf, "cpu_s")
    assert {row.columns["repeats"] for row in reckoning.rows} == {ROUNDS - 1 if resources else 1}
    assert reckoning.alone == ekf.alone == bool(resources)
    assert (None if found is None else (found.logs, found.rounds)) == ((3, ROUNDS - 1) if resources else None)
