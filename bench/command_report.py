"""`bench report FOLDER`: the files and the report of a run's folder, made again from its record."""

import argparse
from pathlib import Path

from rich.console import Console

from .export import export
from .report import write_report
from .store import Store


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("folder", type=Path, help="the folder that bench run left")


def main(namespace: argparse.Namespace) -> int:
    """Write the files anew; 0."""
    with Store(namespace.folder) as store:
        export(store)
        write_report(store)
    Console(highlight=False, markup=False, soft_wrap=True).print(f"report: {namespace.folder / 'report.html'}")
    return 0
