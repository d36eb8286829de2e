"""`bench suite`: runs named suites into one site, and checks and enters the results of others."""

import argparse
import contextlib
import sys
from pathlib import Path

from rich.console import Console

from ...core.errors import InputError
from ..plan.values import count, seed
from ..report.section import Recorded
from ..run.progress import Screen
from ..run.terminal import complain, conclude, status
from ..suite import file as suite_file
from ..suite.file import Suite, SuiteRun
from ..suite.history import keep, summarise
from ..suite.page import write_page
from ..suite.results import DEFAULT
from ..suite.runs import run_suite
from ..suite.site import write_site
from ..suite.site_folder import suites
from ..suite.submission import enter
from ..verify.again import SAMPLE
from ..verify.folder import FAILS, OPEN
from ..verify.verification import Verification, verify
from ..words.console import screen_console, tell
from ..words.numerals import counted
from . import executors


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        "Without NAME: lists the packaged suites. The same command continues a suite that was stopped; what has a\n"
        "result is not run again. A published log that is not on this machine is skipped, and the site says so.\n"
        "Exit status 0; 1: a cell failed, no run could be made, or a verification failed; 2: bad input.\n\n"
        f"A suite file:\n\n{suite_file.FORMAT}"
    )
    add = parser.add_argument
    add("suites", metavar="NAME", nargs="*", help="packaged suites, or files of suites")
    does = parser.add_mutually_exclusive_group()
    does.add_argument("--list", action="store_true", help="list the packaged suites with their runs")
    does.add_argument(
        "--verify",
        type=Path,
        metavar="RESULTS",
        help="check the folder of somebody's run: its files against each other, its logs against those made here, "
        "scores against its paths, and a sample of its cells, which are run again",
    )
    does.add_argument("--add", type=Path, metavar="RESULTS", help="verify such a folder, and enter it into the site")
    does.add_argument("--site", action="store_true", help="write the site again; nothing is run")
    does.add_argument(
        "--standing",
        type=Path,
        metavar="FILE.md",
        help="write the results of the site's suites as one page of Markdown, with FILE.csv and the folder FILE of "
        "pictures and tables beside it; nothing is run",
    )
    add("--out", type=Path, metavar="FOLDER", default=DEFAULT, help=f"the site's folder (default {DEFAULT})")
    add(
        "--sample",
        type=count,
        metavar="N",
        help=f"cells that are run again (default {SAMPLE}, and one of each backend)",
    )
    add("--seed", type=seed, metavar="N", help="of the sample: to draw the same cells again (default: a new one)")
    executors.arguments(parser, jobs="cells at once; more than 1 marks all timings (default 1; slurm: 4 jobs)")
    add("--retry", action="store_true", help="run failed cells again")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Runs suites, or does what else was asked for; returns the exit status."""
    console = screen_console(quiet=namespace.quiet)
    _refuse(namespace)
    if namespace.verify is not None or namespace.add is not None:
        return _verify(namespace, console)
    if namespace.site:
        return _site(namespace.out, console)
    if namespace.standing is not None:
        write_page(namespace.out, namespace.standing)
        tell(console, f"page: {namespace.standing}")
        return 0
    if namespace.list or not namespace.suites:
        _list(console)
        return 0
    return _run([suite_file.read(name) for name in namespace.suites], namespace, console)


def _refuse(namespace: argparse.Namespace) -> None:
    """Raises InputError for options that do not go together."""
    asked = [f"--{name}" for name in ("list", "verify", "add", "site", "standing") if getattr(namespace, name)]
    if asked and namespace.suites:
        raise InputError(f"{asked[0]}: found {namespace.suites[0]} beside it, expected no name of a suite.")
    checks = namespace.verify is not None or namespace.add is not None
    for name in ("sample", "seed"):
        if getattr(namespace, name) is not None and not checks:
            raise InputError(f"--{name}: found neither --verify nor --add, which it belongs to.")
    if namespace.retry and not namespace.suites:
        raise InputError("--retry: found no suite, expected the name of one to run.")
    if namespace.out.exists() and not namespace.out.is_dir():
        raise InputError(f"--out {namespace.out}: is no folder, expected one, or the name of a new one.")


def _list(console: Console) -> None:
    for name in suite_file.packaged():
        suite = suite_file.read(name)
        console.print(f"[bold]{name}[/]: {suite.question}", highlight=False, soft_wrap=True)
        for run in suite.runs:
            tell(console, f"    {run.name:20}{run.datasets}")
    tell(
        console,
        "",
        f"bench suite NAME runs one into {DEFAULT}, whose index.html is the site.",
        f"Copy and change them: {suite_file.PACKAGED}",
    )


def _run(chosen: list[Suite], namespace: argparse.Namespace, console: Console) -> int:
    """Runs the suites one after another; 1 where a cell failed, or where no run of a suite could be made."""
    ended = 0
    for suite in chosen:
        statuses: list[int] = []
        skipped: list[str] = []

        def screen(run: SuiteRun, suite: Suite = suite) -> Screen:
            console.print(f"[bold]{suite.name}[/], {run.name}", highlight=False)
            return Screen(console)

        def concluded(
            run: SuiteRun,
            record: Recorded | None,
            why: str,
            statuses: list[int] = statuses,
            skipped: list[str] = skipped,
        ) -> None:
            if record is None:
                skipped.append(f"{run.name}: skipped. {why}")
                tell(console, skipped[-1])
                return
            statuses.append(status(record.lines))
            if not console.quiet:
                conclude(console, record.lines, record.remarks)
            elif statuses[-1]:
                complain(record.lines)

        with (
            executors.resumable(),
            contextlib.closing(
                executors.executor(namespace, namespace.jobs, 1, exclusive=namespace.jobs is None, say=console.print)
            ) as executor,
        ):
            run_suite(suite, namespace.out, executor, screen, concluded, retry=namespace.retry)
        summary = summarise(suites(namespace.out)[suite.name])
        if summary is not None:
            keep(namespace.out, summary)
        if console.quiet and not statuses:
            for sentence in skipped:
                print(f"bench: {sentence}", file=sys.stderr)
        ended |= int(not statuses or any(statuses))
    _site(namespace.out, console)
    return ended


def _site(site: Path, console: Console) -> int:
    page = write_site(site)
    tell(console, f"site: {page}")
    return 0


def _verify(namespace: argparse.Namespace, console: Console) -> int:
    """Checks a results folder and, with --add, enters it; 1 where anything is wrong with it."""
    folder: Path = namespace.verify or namespace.add

    def say(sentence: str) -> None:
        console.print(f"[dim]{sentence.replace('[', chr(92) + '[')}[/]", highlight=False, soft_wrap=True)

    with contextlib.closing(
        executors.executor(namespace, namespace.jobs, 1, exclusive=False, say=console.print)
    ) as executor:
        found = verify(folder, executor, sample=namespace.sample, seed=namespace.seed, say=say)
    _tell(found, console)
    if found.failed:
        return 1
    if namespace.add is not None:
        suites_there = suites(namespace.out)
        place = enter(namespace.out, found)
        tell(console, f"entered: {place}")
        if suites_there:
            _site(namespace.out, console)
        else:
            console.print("bench suite NAME runs the suite to enter it in, and writes the site.", highlight=False)
    return 0


def _tell(found: Verification, console: Console) -> None:
    styles = {FAILS: "bold red", OPEN: "yellow"}
    for finding in found.findings:
        style = styles.get(finding.verdict, "green")
        console.print(f"[{style}]{finding.verdict:<12}[/]", end="")
        tell(console, f"{finding.subject:<8}{finding.sentence}")
    open_ones = sum(finding.verdict == OPEN for finding in found.findings)
    more = f" {counted(open_ones, 'thing')} could not be checked." if open_ones and not found.failed else ""
    console.print(f"{found.sentence}{more}", style="bold", highlight=False, markup=False, soft_wrap=True)
