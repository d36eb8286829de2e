"""`bench report FOLDER`: the files and the report of a run's folder, or a study's, made again from its record."""

import argparse
import os
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from ...frontend.errors import InputError
from ..record.reader import Store
from ..record.run_files import CELLS
from ..record.study_schema import FILE as STUDY

FORMS = ("pdf", "png")
WRITTEN = (CELLS, "metrics.csv", "cost.csv", "run.json", "report.html", "report.md")
EARLIER = "earlier"
"""The folder, in a run's, of files that a damaged record could not have made again."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Of a folder that is damaged it gives what can be read, and names what was left out; nothing in it is lost: "
        f"files that would come out poorer than they were are kept in {EARLIER}/."
    )
    parser.add_argument("folder", type=Path, help="the folder that bench run or bench ablate left")
    parser.add_argument(
        "--figures", type=_forms, default=(), metavar="FORMS", help="every figure in these forms, too: pdf, png or both"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def _forms(text: str) -> tuple[str, ...]:
    forms = tuple(form.strip().lower() for form in text.split(","))
    unknown = next((form for form in forms if form not in FORMS), None)
    if unknown is not None:
        raise argparse.ArgumentTypeError(f"found {unknown!r}, expected {' or '.join(FORMS)}")
    return forms


def main(namespace: argparse.Namespace) -> int:
    """Write the files anew; 0."""
    folder: Path = namespace.folder
    if (folder / STUDY).is_file():
        from ..study_report.report import write

        _check_writable(folder)
        page = write(folder, namespace.figures)
        if not namespace.quiet:
            Console(highlight=False, markup=False, soft_wrap=True).print(f"report: {page}")
        return 0
    from ..record.files import export
    from ..report.report import write_report

    with Store(folder) as store:
        _check_writable(folder)
        before = {name: (folder / name).read_bytes() for name in WRITTEN if (folder / name).is_file()}
        try:
            if store.recorded:
                export(store)
            write_report(store, figures=namespace.figures)
        finally:
            kept = _kept(store, before)
        said = store.left_out
    if not namespace.quiet:
        console = Console(highlight=False, markup=False, soft_wrap=True)
        for sentence in said:
            console.print(f"left out: {sentence}")
        if kept:
            console.print(f"{', '.join(kept)}: as they were before, in {folder / EARLIER}")
        console.print(f"report: {folder / 'report.html'}")
    return 0


def _check_writable(folder: Path) -> None:
    if not os.access(folder, os.W_OK):
        raise InputError(f"{folder}: cannot be written to, expected a folder that can, or a copy of it.")


def _kept(store: Store, before: Mapping[str, bytes]) -> list[str]:
    """Put by what a damaged record, or none, has made other files of; and a table that somebody has edited."""
    kept: list[str] = []
    for name, content in before.items():
        now = (store.folder / name).read_bytes()
        lost = store.damaged or (name == CELLS and not set(content.splitlines()) <= set(now.splitlines()))
        place = store.folder / EARLIER / name
        if now != content and lost and not place.exists():
            place.parent.mkdir(exist_ok=True)
            place.write_bytes(content)
            kept.append(name)
    return kept
