"""Logs that are made once and kept with a study: one for all its cells, whatever becomes of files and processes."""

import pickle
import re
import shutil
import sqlite3
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from slamduel.bench.engine import logs as study_logs
from slamduel.bench.engine.engine import Tally, run
from slamduel.bench.engine.key import log_key
from slamduel.bench.engine.log_files import FOLDER, LogFiles, same
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.measure.cell import Result
from slamduel.bench.plan import reference
from slamduel.bench.record import store as stores
from slamduel.bench.record.database import writable
from slamduel.bench.record.store import Known, Store
from slamduel.bench.study.estimate import estimate
from slamduel.bench.study.file import made
from slamduel.bench.study.study import about
from slamduel.bench.study_report.evidence import evidence
from slamduel.bench.workers import dask_task
from slamduel.bench.workers.batch import Batch, Finished, facts_of, unmade
from slamduel.bench.workers.executor import Here
from slamduel.bench.workers.local_executor import Local
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Truth
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published.catalogue import place
from slamduel.datasets.worlds import linear as worlds
from slamduel.datasets.worlds.linear import Options, linear
from small_log import small_dataset
from small_study import silent

STUDY = """
[[cells]]
dataset = "linear[steps=8]"
backend = ["ekf", "ukf", "dead-reckoning"]
seeds = 2
"""
FASTSLAM = STUDY.replace('"ukf"', '"fastslam"')
ROOM = """
[[cells]]
dataset = "aruco-room[markers=8,seconds=1,frame_rate=2]"
backend = ["dead-reckoning", "ekf", "ukf"]
seeds = 2
"""
EVERYTHING = RunRequest(lambda _: True, None, False)


class Workshop:
    """A source that is not portable: how often it has made a log, and by how much that is off on its processor."""

    def __init__(self) -> None:
        self.makings, self.off, self.drift = 0, 0.0, 0.0

    def make(self, options: Any, rng: np.random.Generator) -> Dataset:
        self.makings += 1
        self.off += self.drift
        log, truth = linear(options, rng)
        return Dataset(replace(log, z=log.z + self.off), truth)


@pytest.fixture
def workshop(monkeypatch: pytest.MonkeyPatch) -> Workshop:
    """In place of the dataset `linear`."""
    opened = Workshop()
    monkeypatch.setattr(worlds, "source", replace(worlds.source, make=opened.make, portable=False))
    return opened


class Several(Here):
    """A worker a batch, none of which knows what another has made."""

    slots = 4

    def __init__(self, lost: bool = False) -> None:
        self.lost, self.ran = lost, 0

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        for batch in batches:
            self.ran += len(batch.jobs)
            if self.lost:
                yield from unmade(batch, Result("error", "the log could not be made: it rains"), 0.1)
            else:
                yield from super().run([batch], alone=alone)


class Asked(NamedTuple):
    """What came of a study."""

    ran: int  # cells
    tally: Tally
    said: list[str]


def go(folder: Path, text: str = STUDY, wanted: RunRequest = EVERYTHING, *, lost: bool = False) -> Asked:
    """Go on with the study."""
    executor, watcher = Several(lost), silent()
    study = made("study.toml", text, full=False)
    tally = run(study, folder, executor, wanted, about(study, folder, []), watcher)
    return Asked(executor.ran, tally, [call.args[0] for call in watcher.say.call_args_list])  # type: ignore[attr-defined]


def in_room(text: str, folder: Path, pool: Local) -> Tally:
    """Go on with the study in processes."""
    study = made("study.toml", text, full=False)
    return run(study, folder, pool, EVERYTHING, about(study, folder, []), silent())


def digests(folder: Path) -> set[str]:
    """Of the logs that the study's results are on."""
    with Store(folder) as store:
        return set(store.table([]).columns["digest"].tolist())


def kept(folder: Path) -> list[Path]:
    return sorted((folder / FOLDER).iterdir())


def test_a_log_is_made_once_whoever_runs_on_it(tmp_path: Path, workshop: Workshop) -> None:
    workshop.drift = 1e-12
    assert go(tmp_path) == Asked(6, Tally(6, 6, 0), [])
    assert workshop.makings == len(digests(tmp_path)) == len(kept(tmp_path)) == 2
    assert go(tmp_path).ran == 0
    assert go(tmp_path, FASTSLAM) == Asked(2, Tally(6, 6, 0), [])
    assert workshop.makings == len(digests(tmp_path)) == len(kept(tmp_path)) == 2


def test_only_what_is_to_be_run_is_made(tmp_path: Path, workshop: Workshop) -> None:
    assert go(tmp_path, wanted=RunRequest(lambda cell: cell.cell.seed == 1, None, False)).ran == 3
    assert workshop.makings == 1
    assert go(tmp_path, wanted=RunRequest(lambda _: True, 1, False)).ran == 1
    assert workshop.makings == 2


@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "another"])
def test_a_lost_copy_is_made_anew_once_it_is_needed(tmp_path: Path, workshop: Workshop, damage: str) -> None:
    go(tmp_path)
    before, files = digests(tmp_path), kept(tmp_path)
    contents = [file.read_bytes() for file in files]
    for file, other in zip(files, reversed(contents), strict=True):
        file.write_bytes({"gone": b"", "empty": b"", "cut": other[:-9], "another": other}[damage])
        if damage == "gone":
            file.unlink()
    assert go(tmp_path).ran == 0
    assert workshop.makings == 2
    assert go(tmp_path, FASTSLAM) == Asked(2, Tally(6, 6, 0), [])
    assert workshop.makings == 4
    assert digests(tmp_path) == before
    assert [file.read_bytes() for file in files] == contents


def test_where_it_is_another_one_by_then_that_is_said_and_all_runs_on_that(tmp_path: Path, workshop: Workshop) -> None:
    go(tmp_path)
    before, workshop.off = digests(tmp_path), 1e-12
    for file in kept(tmp_path):
        file.unlink()
    assert go(tmp_path).ran == 0
    ran, tally, said = go(tmp_path, FASTSLAM)
    assert (ran, tally) == (6, Tally(6, 6, 0))
    assert len(digests(tmp_path) - before) == 2
    assert [sentence[:24] for sentence in said] == ["linear[steps=8], seed 0:", "linear[steps=8], seed 1:"]
    assert all(sentence.endswith("differs: its results are computed again.") for sentence in said)
    assert go(tmp_path).ran == 2  # of ukf, on the new ones


def test_a_log_that_cannot_be_made_fails_its_cells_with_the_reason(tmp_path: Path, workshop: Workshop) -> None:
    assert go(tmp_path, lost=True) == Asked(0, Tally(6, 6, 6), [])
    with Store(tmp_path) as store:
        assert set(store.table([]).columns["reason"].tolist()) == {"the log could not be made: it rains"}
    assert go(tmp_path).ran == 0
    assert workshop.makings == 0
    assert go(tmp_path, wanted=RunRequest(lambda _: True, None, True)) == Asked(6, Tally(6, 6, 0), [])
    assert workshop.makings == 2


def test_a_published_log_that_is_not_here_is_skipped_until_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    text = """
[[cells]]
dataset = ["freiburg", "linear[steps=8]"]
backend = "dead-reckoning"

[[claim]]
says = "It is near"
measure = "ate_m"
of = { dataset = "freiburg" }
below = 1.0
"""
    folder = tmp_path / "out"
    assert go(folder, text, lost=True).tally == Tally(2, 2, 2)
    for again in (True, False):
        assert go(folder, text, RunRequest(lambda _: True, None, again)).tally == Tally(2, 2, 0)
        found = evidence(folder)
        assert dict(found.standing.counts) == {"done": 1, "skipped": 1}
        assert [group.reason for group in found.standing.told] == [
            "freiburg is not on this machine: bench fetch freiburg gets it, freiburg[path=FOLDER] names a copy."
        ]
        assert found.answers[0].sentence.startswith("Not decided: It is near: no cell has ate_m;")
        assert "1 of 1 cell was skipped: freiburg is not on this machine" in found.answers[0].sentence
    here = place("freiburg")
    here.mkdir(parents=True)
    (here / "world.dat").write_text("".join(f"{k} {k} {k % 2}\n" for k in range(1, 10)))
    seen = "SENSOR 1 1.4142135623730951 0.7853981633974483\n"
    (here / "sensor_data.dat").write_text("".join(f"ODOMETRY 0.0 0.1 0.0\n{seen}" for _ in range(5)))
    assert go(folder, text).tally.failed == 0
    assert dict(evidence(folder).standing.counts) == {"done": 2}


def test_other_code_makes_it_anew(tmp_path: Path, workshop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    def edit(word: str) -> None:
        monkeypatch.setattr(study_logs, "log_key", lambda cell, given: f"{word} {log_key(cell, given)}")

    go(tmp_path)
    edit("new")
    assert go(tmp_path) == Asked(0, Tally(6, 6, 0), [])
    assert (workshop.makings, len(kept(tmp_path))) == (4, 2)
    edit("newer")
    workshop.off = 1e-12
    assert go(tmp_path) == Asked(6, Tally(6, 6, 0), [])
    assert len(kept(tmp_path)) == 4


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], str]:
    """A study of a log without truth in files, whose reference is off by so much; its text."""
    log, _ = linear(Options(steps=8), np.random.default_rng(0))
    log_folder.write(tmp_path / "log", log, None)

    def study(off: float) -> str:
        poses = np.zeros((len(log), 3)) + off
        path = Truth(log.t, poses, None, None, "reference", "reference")
        monkeypatch.setattr(reference, "known", lambda log, truth: path)
        return f'cells = [{{dataset = "{tmp_path}/log", backend = ["ekf", "ukf"]}}]\n'

    return study


def test_a_reference_of_other_last_bits_is_not_taken(tmp_path: Path, recorded: Callable[[float], str]) -> None:
    folder = tmp_path / "out"
    assert go(folder, recorded(0.0)).ran == 2
    assert go(folder, recorded(1e-9)).ran == 0
    assert go(folder, recorded(1e-9).replace('"ukf"', '"fastslam"')).ran == 1
    assert len(kept(folder)) == 1
    assert go(folder, recorded(1e-3)) == Asked(2, Tally(2, 2, 0), [])
    assert len(kept(folder)) == 2


def test_two_makings_differ_by_rounding_or_by_more() -> None:
    log, truth = small_dataset()
    reference = truth._replace(kind="reference")
    assert same(Dataset(log, truth), small_dataset())
    assert same(Dataset(log, None), Dataset(replace(log, z=log.z + 1e-12), None))
    assert not same(Dataset(log, None), Dataset(replace(log, z=log.z + 1e-3), None))
    assert not same(Dataset(log, None), Dataset(log.identified(), None))
    assert not same(Dataset(log, truth), Dataset(log, truth._replace(poses=truth.poses + 1e-12)))
    assert same(Dataset(log, reference), Dataset(log, reference._replace(poses=reference.poses + 1e-12)))
    assert not same(Dataset(log, reference), Dataset(log, reference._replace(poses=reference.poses + 1e-3)))
    assert not same(Dataset(log, reference), Dataset(log, reference._replace(t=reference.t + 1.0)))
    assert not same(Dataset(log, reference), Dataset(log, truth))
    assert not same(Dataset(log, reference), Dataset(log, None))


def test_rendered_logs_reach_processes_of_this_machine(tmp_path: Path) -> None:
    pool = Local(2)
    try:
        assert in_room(ROOM, tmp_path, pool) == Tally(6, 6, 0)
        assert len(kept(tmp_path)) == len(digests(tmp_path)) == 2
        for file in kept(tmp_path):
            file.unlink()
        room = ROOM.replace('"ukf"', '"invariant-ekf"')
        assert in_room(room, tmp_path, pool) == Tally(6, 6, 0)
        assert len(kept(tmp_path)) == len(digests(tmp_path)) == 2
    finally:
        pool.close()


def test_a_copy_that_is_not_what_it_should_be_is_not_run_on(tmp_path: Path) -> None:
    dataset, logs = small_dataset(), LogFiles(tmp_path)
    known = Known(*facts_of(dataset)[:3])
    logs.keep("linear", known, archive.packed(small_dataset(seed=2)))
    assert logs.read("linear", known) is None
    one = Batch("linear", Options(), 0, (), 60.0, False, logs.entry("linear", known))
    (ended,) = Here().run([one], alone=False)
    assert ended.log is None
    assert re.fullmatch(r"the log could not be made: .*\.npz: holds another log or truth: .*", ended.result.reason)


def test_it_reaches_a_machine_that_has_no_such_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_task, "_ended", lambda batch, alone: Here().run([batch], alone=alone))
    dataset, files = small_dataset(), LogFiles(tmp_path)
    known = Known(*facts_of(dataset)[:3])
    files.keep("linear", known, archive.packed(dataset))
    one = Batch("linear", Options(), 0, (), 60.0, False, files.entry("linear", known))
    task = dask_task.order(one, {}, alone=False)
    files.entry("linear", known).path.unlink()
    (ended,) = pickle.loads(pickle.loads(task))
    assert ended.log.digests == (known.digest, known.truth_digest)
    assert len(pickle.dumps(ended)) < len(task) / 2
    with pytest.raises(InputError, match=r"npz: No such file or directory; expected the study's copy of a log"):
        dask_task.order(one, {}, alone=False)


UNWRITABLE = r"logs/linear-\w+.npz: cannot be written: [\w ]*\. "


def test_on_a_disk_that_is_full_at_once_nothing_is_kept(
    tmp_path: Path, workshop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(folder: Path) -> sqlite3.Connection:
        db = writable(folder)
        pages = db.execute("PRAGMA page_count").fetchone()[0]
        db.execute(f"PRAGMA max_page_count = {pages}")
        return db

    monkeypatch.setattr(stores, "writable", full)
    told = r"results\.sqlite: cannot be written to: database or disk is full\. No cell had been run: nothing is kept\.$"
    with pytest.raises(InputError, match=told):
        go(tmp_path, STUDY + "#" * 20_000)  # the record has the file's text
    assert list(tmp_path.iterdir()) == []


def test_a_plan_whose_first_log_cannot_be_written_is_safe(tmp_path: Path, workshop: Workshop) -> None:
    (tmp_path / FOLDER).write_text("")
    with pytest.raises(InputError, match=UNWRITABLE + r"What was written before is safe\.$"):
        go(tmp_path)
    with Store(tmp_path) as store:
        assert len(store.planned()) == 6


def test_what_was_written_before_a_log_that_cannot_be_is_safe(tmp_path: Path, workshop: Workshop) -> None:
    go(tmp_path)
    with Store(tmp_path) as store:
        before = store.statuses()
    shutil.rmtree(tmp_path / FOLDER)
    (tmp_path / FOLDER).write_text("")
    with pytest.raises(InputError, match=UNWRITABLE + r"What was written before is safe\.$"):
        go(tmp_path, STUDY.replace("seeds = 2", "seeds = 3"))
    with Store(tmp_path) as store:
        assert len(before) == 6
        assert store.statuses() == before


def test_a_folder_that_is_gone_meanwhile_is_not_called_safe(
    tmp_path: Path, workshop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    go(tmp_path / "out")
    keep = LogFiles.keep

    def gone(files: LogFiles, dataset: str, known: Known, content: bytes) -> None:
        shutil.rmtree(tmp_path / "out")
        keep(files, dataset, known, content)

    monkeypatch.setattr(LogFiles, "keep", gone)
    with pytest.raises(InputError, match=UNWRITABLE + r"There is no results\.sqlite: nothing is kept\.$"):
        go(tmp_path / "out", STUDY.replace("seeds = 2", "seeds = 3"))


def test_what_a_killed_writer_has_left_goes(tmp_path: Path, workshop: Workshop) -> None:
    go(tmp_path)
    part = tmp_path / FOLDER / ".linear.0123.part"
    part.write_bytes(b"half")
    go(tmp_path)
    assert not part.exists()


def test_an_estimate_runs_on_the_copies(tmp_path: Path, workshop: Workshop) -> None:
    go(tmp_path)
    with Store(tmp_path) as store:
        study = made("study.toml", FASTSLAM, full=False)
        found = estimate(study, store, Several(), EVERYTHING)
    assert (found.todo, found.timed_now > 0) == (2, True)
    assert workshop.makings == 2
