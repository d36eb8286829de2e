"""`bench run`: runs backends on logs, into a folder with a report."""

import argparse
import contextlib
import json
import sys
import textwrap
from pathlib import Path

from ...core.factors import STARTS
from ..measure.repeats import MOST_CELLS, ROUNDS, SMALL_S
from ..plan.values import count, positive
from ..run.benchmark import DEFAULTS, asked, benchmark, folder_for
from ..run.document import SCHEMA, document
from ..run.progress import Screen
from ..run.terminal import complain, conclude, status, verdicts
from ..words.console import screen_console, tell
from . import executors


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    about = (
        "Options go in brackets: --backend 'ekf,fastslam[particles=1000]' --dataset 'aruco-room[markers=12]'. A "
        "dataset may be the path of a log's folder, a backend may be my_package.my_module:build. With --out alone, a "
        "run that was stopped is continued; without any option, five backends run on two datasets. bench list prints "
        "all names and options."
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = f"{textwrap.fill(about, 79)}\n\nThe document that --json prints:\n{textwrap.indent(SCHEMA, '  ')}"
    d = DEFAULTS
    add = parser.add_argument
    add("--backend", action="append", metavar="NAMES", help=f"backends, separated by commas (default {d['backend']})")
    add(
        "--dataset",
        action="append",
        metavar="NAMES",
        help=f"datasets, separated by commas; log[path='drives/*'] or a TOML file: many logs, one verdict "
        f"(default {d['dataset']})",
    )
    add(
        "--seeds",
        type=count,
        metavar="N",
        help=f"logs per dataset; where the log is fixed, runs of a backend that draws at random (default {d['seeds']})",
    )
    add(
        "--repeats",
        type=count,
        metavar="N",
        help=f"time every cell in N rounds, each time in a process of its own, for intervals of costs (default "
        f"{ROUNDS} for backends whose cells on a dataset take up to {SMALL_S:g} s of CPU and are {MOST_CELLS} at most, "
        "else 1: costs measured once are not compared); a larger N with --out adds rounds to a run",
    )
    add("--out", type=Path, metavar="FOLDER", help="where results go (default results/DATE-TIME)")
    executors.arguments(parser, jobs="cells at once; more than 1 marks what is timed once (default 1; slurm: 4 jobs)")
    add("--retry", action="store_true", help="run failed cells again")
    add(
        "--timeout",
        dest="timeout_s",
        type=positive,
        metavar="S",
        help=f"time limit per cell (default {d['timeout_s']:g} s)",
    )
    add(
        "--memory",
        dest="memory_mb",
        type=count,
        metavar="MB",
        help=f"memory limit per cell, on Linux only (default {d['memory_mb']} MB)",
    )
    add(
        "--map",
        metavar="RESULT",
        help="localise on the map that an earlier run left: the folder of one of its cells, results/x/NAME/0/ekf, "
        "or 'results/x/NAME/*/ekf' for one map per seed, or results/x where it has no other map; or a file with "
        "id,x,y[,cxx,cxy,cyy]. The log's start must be known in the frame of the map; what it lacks is added as new",
    )
    add("--map-fixed", action="store_true", default=None, help="hold that map fixed, ignoring its covariance")
    add(
        "--start",
        choices=STARTS,
        help="unknown: the robot may be anywhere on the map that --map gives, and is found by its sightings; errors "
        "are those from there on (default known)",
    )
    add(
        "--oracle",
        action="store_true",
        default=None,
        help="give the ground truth to backends that ask for it, such as ekf[jacobians=ideal]; their rows are marked",
    )
    add("--strict", action="store_true", help="refuse a log with a remark, before anything runs")
    add("--json", action="store_true", help="print the results as a JSON document, and progress to standard error")
    add("--quiet", action="store_true", help="print nothing but errors, and with --json the document")


def main(namespace: argparse.Namespace) -> int:
    """Runs; 0 where something is done and every other cell is skipped, 1 where one failed or all were skipped."""
    given = {name: getattr(namespace, name) for name in DEFAULTS if getattr(namespace, name) is not None}
    given |= {name: ",".join(given[name]) for name in ("backend", "dataset") if name in given}
    console = screen_console(quiet=namespace.quiet, aside=namespace.json)
    command = [Path(sys.argv[0]).name, *sys.argv[1:]]
    with folder_for(namespace.out) as out, Screen(console) as screen:
        chosen = executors.executor(namespace, namespace.jobs, 1, exclusive=namespace.jobs is None, say=screen.say)
        with contextlib.closing(chosen) as executor:
            how = {"retry": namespace.retry, "strict": namespace.strict}
            plan, record = benchmark(asked(given, namespace.out), out, executor, command, screen, **how)
    found, remarks = record.lines, record.remarks
    ended, report = status(found), out / "report.html"
    if namespace.json:
        words = document(str(out), str(report), ended, found, verdicts(found), plan.remarks(), remarks)
        print(json.dumps(words, indent=2, allow_nan=False))
        return ended
    if not namespace.quiet:
        conclude(console, found, remarks)
    elif ended:
        complain(found)
    if plan.remarks():
        tell(console, plan.remarks())
    tell(console, f"report: {report}")
    return ended
