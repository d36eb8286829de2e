"""`bench ablate`: runs a study, from its question to its answer."""

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from ...core.errors import InputError
from ..engine.engine import Tally, run
from ..engine.request import RunRequest
from ..plan.values import count
from ..record.schema import FILE
from ..record.store import Store
from ..study import file as study_file
from ..study.only import choice
from ..study.progress import StudyScreen
from ..study.study import Study, about, refuse_another
from ..words.console import plain, screen_console, tell
from ..words.numerals import counted
from ..workers.executor import Executor
from . import executors


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        "Without STUDY: lists the packaged studies. The same command continues a study that was stopped;\n"
        "what has a result is not run again while log, backend, options and code stay the same.\n"
        "Exit status 0: every claim holds, or nothing is claimed; 1: a claim does not hold, or cells failed.\n\n"
        f"A study file:\n\n{study_file.FORMAT}"
    )
    add = parser.add_argument
    add("study", metavar="STUDY", nargs="?", help="a study file, or the name of a packaged one")
    add("--out", type=Path, metavar="FOLDER", help="where results go (default results/NAME)")
    add("--full", action="store_true", help="the study's full size instead of the quick one")
    add("--dry-run", action="store_true", help="print how many cells there are, and how long they take")
    add("--only", action="append", default=[], metavar="NAME=VALUE", help="run only the cells with that parameter")
    add("--limit", type=count, metavar="N", help="run at most N cells now")
    add("--retry", action="store_true", help="run failed cells again")
    executors.arguments(parser, jobs="local: processes (default one a core); slurm: jobs (default 4)")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Runs the study; 0 where every claim holds, 1 where one does not or cells failed."""
    console = screen_console(quiet=namespace.quiet)
    if namespace.study is None:
        _list(console)
        return 0
    study = study_file.read(namespace.study, full=namespace.full)
    out = namespace.out or Path("results") / study.name
    request = RunRequest(choice(study, namespace.only), namespace.limit, namespace.retry)
    if namespace.dry_run:
        _estimate(console, study, out, request, namespace)
        return 0
    again = [Path(sys.argv[0]).name, *sys.argv[1:]]
    with (
        executors.resumable(),
        StudyScreen(console) as screen,
        contextlib.closing(_executor(namespace, study, screen.say)) as executor,
    ):
        tally = run(study, out, executor, request, about(study, out, again), screen)
    return _conclude(console, study, out, tally, partly=bool(namespace.only or namespace.limit))


def _executor(namespace: argparse.Namespace, study: Study, say: Callable[[str], None]) -> Executor:
    exclusive = any(cell.timed for cell in study.cells)
    return executors.executor(namespace, namespace.jobs, os.cpu_count() or 1, exclusive=exclusive, say=say)


def _list(console: Console) -> None:
    for name in study_file.packaged():
        study, full = (study_file.read(name, full=size) for size in (False, True))
        cells = f"{counted(len(study.cells), 'cell')}, {len(full.cells):,} with --full"
        console.print(f"[bold]{study.name}[/]: {study.question} ({cells})", highlight=False, soft_wrap=True)
    tell(
        console,
        "",
        "bench ablate NAME runs one in its quick size, in one to three minutes on two cores; --dry-run estimates it.",
        f"Copy and change them: {study_file.PACKAGED}",
    )


def _estimate(console: Console, study: Study, out: Path, request: RunRequest, namespace: argparse.Namespace) -> None:
    from ..study.estimate import estimate

    with contextlib.ExitStack() as stack:
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: is no folder, expected one, or the name of a new one.")
        store = stack.enter_context(Store(out)) if (out / FILE).is_file() else None
        if store is not None:
            refuse_another(study, out, store.about())
        executor = stack.enter_context(contextlib.closing(_executor(namespace, study, console.print)))
        found = estimate(study, store, executor, request)
        head, *rows = found.table()
        table = Table(*head, box=box.SIMPLE_HEAD)
        for column in table.columns[2:]:
            column.justify = "right"
        for row in rows:
            table.add_row(*map(plain, row))
        console.print(table)
        tell(console, *found.sentences())


def _conclude(console: Console, study: Study, out: Path, tally: Tally, *, partly: bool) -> int:
    from ..study_report.evidence import evidence
    from ..study_report.report import write

    found = evidence(out)
    said: list[Any] = [study.question or study.title, found.conclusion.sentence]
    said += [f"  {answer.sentence}" for answer in found.answers]
    said += [found.conclusion.tests] * bool(found.conclusion.tests)
    said += _left(tally, partly=partly)
    with Store(out) as store:
        said += [f"remark: {name}: {remark}." for name, odd in store.remarks().items() for remark in odd]
    report = write(out)
    tell(console, *said, f"report: {report}")
    return int(any(answer.verdict != "holds" for answer in found.answers) or tally.failed > 0)


def _left(tally: Tally, *, partly: bool) -> Sequence[str]:
    """Says what failed and what has not run; `partly`: some of it was not requested."""
    said = [f"{counted(tally.failed, 'cell')} failed; --retry runs them again."] * bool(tally.failed)
    waiting = tally.cells - tally.done
    goes_on = "without --only and --limit all of them are run" if partly else "the same command continues"
    return [*said, *[f"{counted(waiting, 'cell')} of {tally.cells} wait; {goes_on}."] * bool(waiting)]
