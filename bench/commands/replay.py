"""`bench replay FOLDER`: shows a run step by step, backends side by side, as page, film or recording."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from ...core.errors import InputError
from ..plan.values import check_file
from ..record.store import Store
from ..words.console import announced, screen_console
from ..words.numerals import counted, listed
from ..words.stages import clock

if TYPE_CHECKING:
    from ..replay.replay import ReplayRequest

KINDS = (".html", ".gif", ".mp4", ".rrd")  # formats, by the ending of a replay's name


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("folder", type=Path, help="the folder that bench run left")
    add("--dataset", metavar="NAME", help="one of the run's (default: the first)")
    add("--backend", metavar="NAMES", help="some of the run's, separated by commas, in this order (default: all)")
    add("--seed", type=int, metavar="N", help="which log (default: the first that has a result)")
    add(
        "--frames", type=int, default=300, metavar="N", help="of a longer log, N steps are shown (default: %(default)s)"
    )
    add(
        "--out", type=Path, action="append", metavar="FILE",
        help="what to write: a page that needs no network (.html), a film (.gif, .mp4) or a recording for Rerun (.rrd, "
        "with slamduel[replay]); may be given several times (default: replay-DATASET-SEED.html in the folder)",
    )  # fmt: skip
    add("--quiet", action="store_true", help="nothing printed")


def main(namespace: argparse.Namespace) -> int:
    """Drives the backends through the log once more and writes the replay; 1 where a path is not the recorded one."""
    _check(namespace.out or [], namespace.frames)
    from ..replay.replay import choose, replay  # once the arguments are known to be right

    console = Console(emoji=False, highlight=False, markup=False, soft_wrap=True, quiet=namespace.quiet)
    with Store(namespace.folder) as store:
        request = choose(store, namespace.dataset, namespace.backend, namespace.seed)
        default = f"replay-{request.cells[0].dataset.slug}-{request.seed}.html"
        out: list[Path] = namespace.out or [namespace.folder / default]
        with announced(_work(request), screen_console(quiet=namespace.quiet, aside=True).print):
            shown = replay(store, request, namespace.frames, os.cpu_count() or 1)
    console.print(
        f"{shown.dataset}, seed {shown.seed}: {counted(len(shown.parts), 'backend')}, "
        f"{len(shown.frames):,} of {counted(len(shown.log.log), 'step')} shown"
    )
    for part in shown.parts:
        if part.remark:
            console.print(f"{part.label}: {part.remark}")
    if namespace.dataset is None and request.others:
        console.print(f"--dataset shows another: {listed(list(request.others))}")

    from ..replay.view import view

    seen = view(shown)
    for path in out:
        _writer(path)(path, seen)
        console.print(f"replay: {path}")
    return 0 if all(part.repeated for part in shown.parts) else 1


def _work(request: "ReplayRequest") -> str:
    """The work to be done, in words."""
    rows = [request.rows[cell.key].columns for cell in request.cells if cell.key in request.rows]
    spent = sum(row["cpu_s"] or 0.0 for row in rows)
    took = f", which took {clock(spent)} of CPU time in the run" if spent else ""
    return f"repeating {counted(len(request.cells), 'backend')}{took}"


def _check(out: Sequence[Path], frames: int) -> None:
    if frames < 2:
        raise InputError(f"--frames {frames}: expected a whole number, at least 2.")
    for path in out:
        check_file("--out", path, KINDS)
    if any(path.suffix.lower() == ".rrd" for path in out):
        from ..replay.rerun import require

        require()


def _writer(path: Path):
    match path.suffix.lower():
        case ".html":
            from ..replay.page import write_page as write
        case ".rrd":
            from ..replay.rerun import write_rrd as write
        case ".gif":
            from ..replay.film import write_gif as write
        case _:
            from ..replay.film import write_mp4 as write
    return write
