"""`bench list`: every backend and dataset by name, with the options that go in its brackets."""

import argparse

from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from ..backends import registry as backends
from ..datasets import registry as datasets
from .spec import describe


def arguments(parser: argparse.ArgumentParser) -> None:
    """None to add."""
    del parser


def main(namespace: argparse.Namespace) -> int:
    """Print the lists; a plug-in that cannot be imported is listed with the reason."""
    del namespace
    console = Console(highlight=False, markup=False)
    console.print("backends", style="bold")
    for name in [*backends.BUILTIN, *backends.plugins()]:
        try:
            builder = backends.find(name)
        except backends.Missing as error:
            _entry(console, name, str(error), None)
        else:
            _entry(console, name, builder.summary, builder.options)
    console.print("\ndatasets", style="bold")
    for name in datasets.BUILTIN:
        source = datasets.find(name)
        _entry(console, name, source.summary, source.options)
    return 0


def _entry(console: Console, name: str, summary: str, options: type | None) -> None:
    console.print(f"  {name}", style="bold cyan")
    console.print(Padding(summary, (0, 0, 0, 4)))
    described = describe(options) if options is not None else []
    if described:
        listed = Table.grid(padding=(0, 2))
        for option, default, help_text in described:
            listed.add_row(f"{option}={default}", help_text)
        console.print(Padding(listed, (0, 0, 0, 6)))
