"""`bench run`: several backends on several logs, into a folder with a report."""

import argparse
import shlex
import sys
import time
from pathlib import Path
from typing import Any

from ..frontend.errors import InputError, Interrupted
from .plan import Plan
from .report import write_report
from .runner import recorded_plan, run
from .store import Store
from .summary import lines
from .terminal import Screen, screen_console, tables

DEFAULTS: dict[str, Any] = {
    "backend": "dead-reckoning,ekf,fastslam,isam2",
    "dataset": "aruco-room,victoria-park",
    "seeds": 3,
    "timeout_s": 1800.0,
    "memory_mb": 8000,
    "map": None,
    "map_fixed": False,
    "oracle": False,
}
"""What a run is when nothing is said."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Options go in brackets: --backend 'ekf,fastslam[particles=1000]' --dataset 'aruco-room[markers=12]'. A "
        "dataset may be the path of a log's folder, a backend may be my_package.my_module:build. With --out alone, a "
        "run that was stopped goes on where it was. bench list tells all names and options."
    )
    d = DEFAULTS
    parser.add_argument(
        "--backend", action="append", metavar="NAMES", help=f"backends, separated by commas (default {d['backend']})"
    )
    parser.add_argument(
        "--dataset", action="append", metavar="NAMES", help=f"datasets, separated by commas (default {d['dataset']})"
    )
    parser.add_argument("--seeds", type=_count, metavar="N", help=f"logs, or tries, of each (default {d['seeds']})")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where results go (default results/DATE-TIME)")
    parser.add_argument(
        "--jobs", type=_count, default=1, metavar="N", help="cells at once; more than 1 marks all timings (default 1)"
    )
    parser.add_argument(
        "--timeout", dest="timeout_s", type=_positive, metavar="S", help=f"limit a cell (default {d['timeout_s']:g} s)"
    )
    parser.add_argument(
        "--memory", dest="memory_mb", type=_count, metavar="MB", help=f"limit a cell (default {d['memory_mb']} MB)"
    )
    parser.add_argument(
        "--map",
        metavar="RESULT",
        help="localise on the map that an earlier run left: the folder of one of its cells, results/x/NAME/0/ekf, "
        "or 'results/x/NAME/*/ekf' for a map a seed, or results/x where it has no other map; or a file with "
        "id,x,y[,cxx,cxy,cyy]. The log's start must be known in the frame of the map; what it lacks is added as new",
    )
    parser.add_argument(
        "--map-fixed", action="store_true", default=None, help="hold that map fixed, leaving its covariance aside"
    )
    parser.add_argument(
        "--oracle",
        action="store_true",
        default=None,
        help="tell the truth to backends that have a use for it, such as ekf[jacobians=ideal]; their rows are marked",
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Run; 0 where every cell is done or skipped, 1 where one is not."""
    out = namespace.out or Path("results") / time.strftime("%Y%m%d-%H%M%S")
    given = {name: getattr(namespace, name) for name in DEFAULTS if getattr(namespace, name) is not None}
    given |= {name: ",".join(given[name]) for name in ("backend", "dataset") if name in given}
    plan = recorded_plan(out)
    if plan is None:
        plan = Plan.from_words(DEFAULTS | given)
    else:
        _refuse_another(plan, given, out)
    console = screen_console(quiet=namespace.quiet)
    with Screen(console, quiet=namespace.quiet) as screen:
        try:
            run(plan, out, namespace.jobs, [Path(sys.argv[0]).name, *sys.argv[1:]], screen)
        except KeyboardInterrupt:
            raise Interrupted(f"bench run --out {shlex.quote(str(out))} goes on where this stopped") from None
    with Store(out) as store:
        write_report(store)
        found = lines(store.cells())
    console.print(*tables(found, console.width))
    if plan.remarks():
        console.print(plan.remarks(), highlight=False, markup=False, soft_wrap=True)
    console.print(f"report: {out / 'report.html'}", highlight=False, soft_wrap=True)
    return 0 if all(row.columns["status"] in ("done", "skipped") for line in found for row in line.rows) else 1


def _refuse_another(plan: Plan, given: dict[str, Any], out: Path) -> None:
    """InputError where `out` holds a run of another plan than the one asked for."""
    recorded = plan.words()
    asked = Plan.from_words(recorded | {"map_digest": None} | given).words()
    for name, value in asked.items():
        if value != recorded[name]:
            raise InputError(
                f"--out {out}: holds a run with {name} {recorded[name]}, found {name} {value}; expected the same, or "
                "nothing but --out to go on with it, or another folder."
            )


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"found {text}, expected a whole number, at least 1")
    return int(text)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"found {text}, expected a number above 0")
    return value
