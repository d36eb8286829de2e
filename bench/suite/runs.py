"""Runs a suite: each of its runs by `bench run`, into a folder of its own. What has a result is not run again."""

from collections.abc import Callable
from pathlib import Path

from ...core.errors import Absent
from ..report.section import Recorded
from ..run.benchmark import benchmark
from ..run.progress import Screen
from ..workers.executor import Executor
from .file import Suite, SuiteRun
from .site_folder import begin, end


def run_suite(
    suite: Suite,
    site: Path,
    executor: Executor,
    screen: Callable[[SuiteRun], Screen],
    ended: Callable[[SuiteRun, Recorded | None, str], None],
    *,
    retry: bool = False,
) -> Path:
    """Runs what has no result yet; returns the folder of this version's runs.

    `ended` is called after each run with its record, or with None and why it was skipped: a published log that is not
    on this machine.
    """
    folder, skipped = begin(site, suite), dict[str, str]()
    for run in suite.runs:
        place = folder / run.name
        try:
            with screen(run) as watcher:
                command = [*run.words, "--out", str(place)]
                _, record = benchmark(run.given, place, executor, command, watcher, retry=retry, lasting=True)
        except Absent as error:
            skipped[run.name] = str(error)
            end(folder, skipped)
            ended(run, None, str(error))
            continue
        ended(run, record, "")
    end(folder, skipped)
    return folder
