"""How long a study will take, told before it runs: from what is known of its cells, or from trying some."""

from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pytest

from slamduel.bench.engine.engine import run
from slamduel.bench.engine.request import RunRequest
from slamduel.bench.measure.cell import Result
from slamduel.bench.record.store import Store
from slamduel.bench.study.estimate import StudyEstimate, estimate
from slamduel.bench.study.study import Study, about
from slamduel.bench.words.numerals import lasting
from slamduel.bench.workers.batch import Batch, Finished, LogFacts
from small_study import silent
from study_text import HEAD, study


class Stopwatch:
    """An executor for which a cell takes as many seconds as its backend's first letter says."""

    name, slots, times = "stopwatch", 2, True

    def __init__(self, result: Result | None = None) -> None:
        self.asked: list[str] = []
        self._result = result or Result("done", "")

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        for batch in batches:
            for index, job in batch.jobs:
                self.asked.append(job.backend)
                log = LogFacts(f"{batch.seed}", "", "", {})
                took = {"e": 2.0, "d": 0.25, "f": 8.0}[job.name[0]]
                yield Finished(batch, index, log, self._result, took, alone, "")

    def close(self) -> None:
        pass


def estimated(found: Study, executor: Stopwatch, store: Store | None = None, **wanted: Any) -> StudyEstimate:
    asked = RunRequest(wanted.get("chosen", lambda cell: True), wanted.get("limit"), False)
    return estimate(found, store, executor, asked, wanted.get("budget_s", 20.0))


def test_an_estimate_is_the_sum_over_the_cells_divided_by_the_slots() -> None:
    executor = Stopwatch()
    found = estimated(study(HEAD), executor)
    shares = {share.backend: (share.cells, share.todo, share.seconds) for share in found.shares}
    assert shares == {"ekf": (6, 6, 12.0), "dead-reckoning": (6, 6, 1.5), "fastslam": (12, 12, 96.0)}
    assert found.wall_s == (12 + 1.5 + 96) / 2
    assert (found.cells, found.todo, found.alone, found.timed_now) == (24, 24, 0, 8)
    # Two pairs, each a short one and so twice: the first time much is loading.
    assert executor.asked.count("dead-reckoning") == 4
    assert found.sentences()[0] == "24 cells, 0 done, 24 to be run now."
    assert found.sentences()[1].startswith("About 55 s, 2 at a time, by 8 cells timed now")
    assert found.table()[3] == ("bailey", "fastslam", "12", "0", "12", "96 s")


def test_cells_that_run_alone_are_not_divided() -> None:
    found = estimated(study("timed = true\n" + HEAD), Stopwatch())
    assert (found.alone, found.wall_s) == (24, 12 + 1.5 + 96)
    assert "24 of them alone on their machine" in found.sentences()[0]


def test_what_there_was_no_time_for_is_named() -> None:
    executor = Stopwatch()
    found = estimated(study(HEAD), executor, budget_s=0.0)
    assert not executor.asked
    *unknown, again = found.sentences()[1:]
    assert again.startswith("There was no time to try more; a second --dry-run tries more")
    assert unknown == [
        f"Not known: how long {n} of bailey with {name} will take."
        for n, name in ((6, "ekf"), (6, "dead-reckoning"), (12, "fastslam"))
    ]
    assert found.table()[1] == ("bailey", "ekf", "6", "0", "6", "")


def test_cells_that_do_not_end_well_are_counted_by_reason() -> None:
    found = estimated(study(HEAD), Stopwatch(Result("skipped", "bailey is not on this machine.")))
    assert found.sentences()[2:] == ["8 cells timed now did not end well: skipped, bailey is not on this machine."]
    slow = estimated(study(HEAD), Stopwatch(Result("timeout", "longer than 1 s.")))
    assert not slow.undone


def test_results_that_are_there_are_not_run_again_and_tell_how_long_the_others_take(tmp_path: Path) -> None:
    text = '[[cells]]\ndataset = "bailey"\nbackend = ["ekf", "fastslam"]\nseeds = 4\n'
    executor = Stopwatch()
    few = RunRequest(lambda cell: cell.cell.seed < 3, None, False)
    run(study(text), tmp_path, executor, few, about(study(text), tmp_path, []), silent())
    executor.asked.clear()
    with Store(tmp_path) as store:
        same = estimated(study(text), executor, store)
        other = estimated(study(text.replace('"ekf"', '"ekf[gate=0.5]"')), executor, store, limit=6)
    assert not executor.asked
    shares = [(share.cells, share.done, share.todo, share.seconds) for share in same.shares]
    assert shares == [(4, 3, 1, 2), (4, 3, 1, 8)]
    assert same.wall_s == 8  # the longest
    assert [(share.cells, share.done) for share in other.shares] == [(4, 0), (4, 3)]
    assert sum(share.seconds for share in other.shares) == 4 * 2 + 8
    assert "by cells done before" in same.sentences()[1]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "less than 1 s"), (90, "90 s"), (600, "10 minutes"), (36_000, "10 hours"), (864_000, "10 days")],
)
def test_times_as_one_says_them(seconds: float, words: str) -> None:
    assert lasting(seconds) == words
