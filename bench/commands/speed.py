"""`bench speed`: times backends' steps in turns, at several sizes of the map, and where a step of iSAM2 goes.

With `--association` it times steps with and without ids, with `--frontend` the front ends for markers, laser scans and
depth cameras. Each study prints tables, and writes them as CSV on request.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from ...core.errors import InputError
from ..front_ends import study as frontend
from ..plan.values import check_file, seed
from ..speed import association, backends
from ..words.console import screen_console, tell


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("--association", action="store_true", help="a step without ids beside one with them, by joint compatibility")
    add(
        "--frontend",
        action="store_true",
        help="the front ends for markers, laser scans and depth cameras, not the backends",
    )
    add("--seed", type=seed, default=0, metavar="N", help="of everything that is drawn at random (0)")
    add("--quick", action="store_true", help="a quick look: little of everything, no reliable figures")
    add("--csv", type=Path, metavar="FILE", help="also write the figures")
    add("--out", type=Path, metavar="FOLDER", help="also write the figures there, and pictures of front ends")
    add("--quiet", action="store_true", help="print nothing but errors")
    backends.arguments(parser.add_argument_group("backends"))
    frontend.arguments(parser.add_argument_group("--frontend"))


def main(namespace: argparse.Namespace) -> int:
    """Measures and prints; 0, whatever was found."""
    studies = {"association": association, "frontend": frontend, "": backends}
    named = [name for name in studies if name and getattr(namespace, name)]
    if len(named) > 1:
        raise InputError(f"--{' --'.join(named)}: expected one of them, they are studies of their own")
    name = named[0] if named else ""
    chosen = studies.pop(name)
    others = {option for other in studies.values() for option in other.OPTIONS}
    _check(namespace, name, sorted(others.difference(chosen.OPTIONS)))
    console = screen_console(quiet=namespace.quiet)
    for path in chosen.study(namespace, console):
        tell(console, f"wrote: {path}")
    return 0


TIMED = {
    "": "without --association or --frontend backends are timed",
    "association": "--association times steps with and without ids",
    "frontend": "--frontend is the study of front ends",
}


def _check(namespace: argparse.Namespace, study: str, foreign: Sequence[str]) -> None:
    """Raises InputError for another study's options, and for invalid values."""
    for name in foreign:
        if getattr(namespace, name) not in (None, False):
            raise InputError(f"--{name}: {TIMED[study]}, which has no such option")
    check_file("--csv", namespace.csv)
    if namespace.out is not None and namespace.out.exists() and not namespace.out.is_dir():
        raise InputError(f"--out {namespace.out}: found a file, expected a folder or nothing")
    if namespace.out is not None:  # before an hour's measurements, not after
        try:
            namespace.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--out {namespace.out}: {error.strerror}; expected a folder that can be made") from None
