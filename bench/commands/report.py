"""`bench report FOLDER`: writes the files and the report of a run or study again from its record."""

import argparse
import os
from pathlib import Path

from rich.console import Console

from ...core.errors import InputError
from ..record.store import Store
from ..words.console import announced, screen_console
from ..words.stages import Stages

FORMS = ("pdf", "png")
FILES, REPORT = "writing paths and tables", "drawing figures and writing the page"  # stages


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("folder", type=Path, help="the folder that bench run or bench ablate left")
    add(
        "--figures", type=_forms, default=(), metavar="FORMS", help="every figure in these forms, too: pdf, png or both"
    )
    add("--quiet", action="store_true", help="print nothing but errors")


def _forms(text: str) -> tuple[str, ...]:
    forms = tuple(form.strip().lower() for form in text.split(","))
    unknown = next((form for form in forms if form not in FORMS), None)
    if unknown is not None:
        raise argparse.ArgumentTypeError(f"found {unknown!r}, expected {' or '.join(FORMS)}")
    return forms


def main(namespace: argparse.Namespace) -> int:
    """Writes the files again; 0."""
    folder: Path = namespace.folder
    console = screen_console(quiet=namespace.quiet, aside=True)
    with Store(folder) as store:
        if not os.access(folder, os.W_OK):
            raise InputError(f"{folder}: cannot be written to, expected a folder that can, or a copy of it.")
        if store.about().get("kind") == "study":
            from ..study_report.report import write

            with announced("writing the report", console.print):
                write(folder, namespace.figures)
        else:
            from ..record.files import export
            from ..report.report import write_report

            with Stages(console, {FILES: 2.0, REPORT: 1.0}) as stages:
                stages.begin(FILES)
                export(store)
                stages.begin(REPORT)
                write_report(store, figures=namespace.figures)
    if not namespace.quiet:
        Console(emoji=False, highlight=False, markup=False, soft_wrap=True).print(f"report: {folder / 'report.html'}")
    return 0
