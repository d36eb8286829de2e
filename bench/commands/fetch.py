"""`bench fetch NAME`: downloads a published log into the user's cache and checks it; without a name, lists them."""

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ...core.errors import InputError
from ...datasets.published import installed
from ...datasets.published.catalogue import PUBLISHED, place
from ...datasets.published.fetch import fetch, take
from ..words.console import ProgressBar
from ..words.numerals import listed

MEGA = 1e6


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="published logs; without any, they are listed")
    add(
        "--from", dest="source", type=Path, metavar="PATH", help="install an archive, folder or file downloaded by hand"
    )
    add("--url", help="download from this address instead of the publisher's (http, https or ftp)")
    add("--check", action="store_true", help="hash again what is here; without a name, all of it")
    add("--again", action="store_true", help="download even if it is here already; the old copy stays until then")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Handles every name, whatever becomes of the others; 2 where one failed."""
    console = Console(quiet=namespace.quiet, emoji=False, highlight=False, markup=False, soft_wrap=True)
    _refuse(namespace)
    names = list(dict.fromkeys(namespace.names))
    if namespace.check:
        return _check(names, console)
    if not names:
        console.print(_listed())
        console.print("bench fetch NAME downloads one; bench fetch NAME --from PATH takes one downloaded by hand.")
        return 0
    failed = False
    for name in names:
        try:
            if namespace.source is not None:
                arrival = take(name, namespace.source)
            else:
                with ProgressBar(Console(quiet=namespace.quiet, stderr=True, emoji=False), "", of_bytes=True) as bar:

                    def watch(url: str, at: int, total: int | None, bar: ProgressBar = bar) -> None:
                        bar.update(description=url.rstrip("/").rpartition("/")[2][-40:], completed=at, total=total)

                    arrival = fetch(name, watch, url=namespace.url, again=namespace.again)
        except InputError as error:
            print(f"bench: {error}", file=sys.stderr)
            failed = True
        else:
            _told(name, arrival, console)
    return 2 if failed else 0


def _refuse(namespace: argparse.Namespace) -> None:
    """Raises InputError for unknown names and options that do not go together."""
    for name in namespace.names:
        if name not in PUBLISHED:
            raise InputError(f"bench fetch {name}: there is no such published log; there are {', '.join(PUBLISHED)}.")
    given = [f"--{word}" for word, value in (("from", namespace.source), ("url", namespace.url)) if value is not None]
    if given and len(set(namespace.names)) != 1:
        raise InputError(f"{given[0]} is for one published log; found {len(set(namespace.names))} names.")
    given += [f"--{word}" for word in ("check", "again") if getattr(namespace, word)]
    if len(given) > 1 and given != ["--url", "--again"]:
        raise InputError(f"{' and '.join(given)} do not go together.")


def _told(name: str, arrival: installed.Arrival | None, console: Console) -> None:
    log = PUBLISHED[name]
    console.print(f"{name}: {'here already' if arrival is None else 'fetched'}, {_megabytes(name)} in {place(name)}")
    if arrival is None:
        return
    if all(log.files.values()):
        console.print("  every file has the sha256 of the published one.")
    else:
        console.print(f"  the publisher's sha256 is not known here; found and recorded in {installed.SUMS}:")
        for file, digest in arrival.files.items():
            console.print(f"  {digest}  {file}")
    if without := installed.lacking(name):
        console.print(f"  without {listed(without, 3)}: what it has is read.")
    if arrival.archive is not None and log.archive is not None:
        same = "is the one" if arrival.archive == log.archive else f"is not the one ({log.archive})"
        console.print(f"  the archive's sha256, {arrival.archive}, {same} that others report.")
    console.print(f"  {log.citation}\n  licence: {log.licence}")


def _check(names: list[str], console: Console) -> int:
    """Hashes again what is here of `names`, or everything; returns the exit status."""
    if not names:
        names = [name for name in PUBLISHED if place(name).exists()]
        if not names:
            console.print("no published log is here.")
    status = 0
    for name in names:
        if not place(name).exists():
            print(f"bench: {name} is not on this machine: bench fetch {name} gets it.", file=sys.stderr)
            status = 2
        elif found := installed.faults(name):
            for fault in found:
                print(f"bench: {fault}", file=sys.stderr)
            print(f"bench: bench fetch {name} --again downloads {name} again.", file=sys.stderr)
            status = 2
        else:
            known = "as published" if all(PUBLISHED[name].files.values()) else "as it first arrived"
            console.print(f"{name}: {known}, {_megabytes(name)} in {place(name)}")
    return status


def _listed() -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in ("name", "here", "log"):
        table.add_column(column, no_wrap=column != "log")
    for name, log in PUBLISHED.items():
        here = _megabytes(name) if installed.here(name) else "incomplete" if place(name).exists() else "-"
        table.add_row(name, here, log.title)
    return table


def _megabytes(name: str) -> str:
    return f"{installed.size(name) / MEGA:.1f} MB"
