"""`bench list`: every backend and dataset by name, with the options that go in its brackets."""

import argparse
import json
from collections.abc import Iterator
from typing import NamedTuple

from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from ...backends import registry as backends
from ...datasets import registry as datasets
from ..plan.spec import describe


class Entry(NamedTuple):
    """A backend or a dataset."""

    name: str
    summary: str  # of a plug-in that cannot be imported, why
    options: list[dict[str, str]]  # name, default and help of each


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's argument."""
    parser.add_argument(
        "--json",
        action="store_true",
        help="as JSON: {backends: [...], datasets: [...]}, each {name, summary, options: [{name, default, help}]}",
    )


def main(namespace: argparse.Namespace) -> int:
    """Print the lists; a plug-in that cannot be imported is listed with the reason."""
    kinds = {"backends": list(_backends()), "datasets": list(_datasets())}
    if namespace.json:
        words = {kind: [entry._asdict() for entry in entries] for kind, entries in kinds.items()}
        print(json.dumps(words, indent=2))
        return 0
    console = Console(highlight=False, markup=False)
    for kind, entries in kinds.items():
        console.print(kind, style="bold")
        for entry in entries:
            _print(console, entry)
        if kind == "backends":
            console.print()
    return 0


def _backends() -> Iterator[Entry]:
    for name in [*backends.BUILTIN, *backends.plugins()]:
        try:
            builder = backends.find(name)
        except backends.Missing as error:
            yield Entry(name, str(error), [])
        else:
            yield Entry(name, builder.summary, _options(builder.options))


def _datasets() -> Iterator[Entry]:
    for name in datasets.BUILTIN:
        source = datasets.find(name)
        yield Entry(name, source.summary, _options(source.options))


def _options(cls: type) -> list[dict[str, str]]:
    return [{"name": name, "default": default, "help": text} for name, default, text in describe(cls)]


def _print(console: Console, entry: Entry) -> None:
    console.print(f"  {entry.name}", style="bold cyan")
    console.print(Padding(entry.summary, (0, 0, 0, 4)))
    if entry.options:
        listed = Table.grid(padding=(0, 2))
        for option in entry.options:
            listed.add_row(f"{option['name']}={option['default']}", option["help"])
        console.print(Padding(listed, (0, 0, 0, 6)))
