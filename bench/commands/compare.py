"""`bench compare OLD NEW`: lists regressions and gains between two runs, for people, pull requests and CI."""

import argparse
import json
from pathlib import Path

from rich.console import Console

from ...core.files import write_whole
from ..plan.values import positive
from ..report.comparison import compare, document, table
from ..verdict.changes import regressed, rest, summary
from ..words.console import wide_enough


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = "Exit status: 0 without a regression, 1 with one, 2 where the runs cannot be compared."
    add = parser.add_argument
    add("old", type=Path, metavar="OLD", help="the folder that an earlier bench run left")
    add("new", type=Path, metavar="NEW", help="that of a later one")
    add("--out", type=Path, metavar="FILE.md", help="write it as Markdown, for a pull request")
    add("--json", action="store_true", help="print it as JSON and nothing else")
    add(
        "--least",
        type=positive,
        metavar="PERCENT",
        help="changes that are smaller do not count (default 5 for accuracy and consistency, 50 for CPU time and the "
        "median step, 100 for the 99th percentile of a step, 10 for memory)",
    )
    add("--any-machine", action="store_true", help="compare times from different machines, too")
    add("--any-log", action="store_true", help="compare by seed where the logs are not the same")
    add("--quiet", action="store_true", help="print nothing; the exit status is the result")


def main(namespace: argparse.Namespace) -> int:
    """Compares; 1 where something has become worse, 0 where nothing has."""
    least = None if namespace.least is None else namespace.least / 100
    compared = compare(
        namespace.old, namespace.new, least=least, any_machine=namespace.any_machine, any_log=namespace.any_log
    )
    found, told = compared.found, list(compared.changes)
    if namespace.out is not None:
        namespace.out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(namespace.out, compared.markdown())
    if namespace.json:
        print(json.dumps(document(found, told, least), indent=2))
    elif not namespace.quiet:
        console = wide_enough(Console(emoji=False, highlight=False, markup=False))
        grid = table(told)
        if grid is not None:
            console.print(grid)
        for name, before, after in found.differences:
            console.print(f"{name}: {before} before, {after} now", soft_wrap=True)
        for note in found.notes:
            console.print(note, soft_wrap=True)
        console.print(rest(told), soft_wrap=True)
        console.print(summary(told), style="bold red" if regressed(told) else "bold", soft_wrap=True)
    return int(regressed(told))
