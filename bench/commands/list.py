"""`bench list`: lists every backend and dataset by name, with the options that go in its brackets."""

import argparse
import json
from collections.abc import Iterator
from typing import NamedTuple

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ...backends import registry as backends
from ...datasets import registry as datasets
from ..plan.spec import describe
from ..words.console import wide_enough
from ..words.reason import reason


class Entry(NamedTuple):
    """A backend or a dataset."""

    name: str
    summary: str  # of a plug-in that cannot be imported, why
    options: list[dict[str, str]]  # name, default and help of each
    implementation: str | None = None  # whose program a backend is, with default options; of a dataset None
    lacking: str | None = None  # which program of a backend is not installed, and how to install it


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's argument."""
    parser.add_argument(
        "--json",
        action="store_true",
        help="as JSON: {backends: [...], datasets: [...]}, each {name, summary, options: [{name, default, help}]}; "
        "a backend has an implementation, too, and lacking, where its program is not installed",
    )


def main(namespace: argparse.Namespace) -> int:
    """Prints the lists; a plug-in that cannot be imported is listed with the reason."""
    kinds = {"backends": list(_backends()), "datasets": list(_datasets())}
    if namespace.json:
        words = {
            kind: [{name: value for name, value in entry._asdict().items() if value is not None} for entry in entries]
            for kind, entries in kinds.items()
        }
        print(json.dumps(words, indent=2))
        return 0
    console = wide_enough(Console(emoji=False, highlight=False, markup=False))
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
            builder = backends.find_first(name)
        except backends.Missing as error:
            yield Entry(name, reason(str(error)), [], "")
        else:
            made_by = backends.implementation(name, builder.options())
            options = _options(builder.options)
            yield Entry(name, reason(builder.summary), options, reason(made_by), reason(builder.lacks()) or None)


def _datasets() -> Iterator[Entry]:
    for name in datasets.BUILTIN:
        source = datasets.find(name)
        yield Entry(name, source.summary, _options(source.options))


def _options(cls: type) -> list[dict[str, str]]:
    return [{"name": name, "default": default, "help": text} for name, default, text in describe(cls)]


def _print(console: Console, entry: Entry) -> None:
    made_by = f" ({entry.implementation})" if entry.implementation else ""
    console.print(Text.assemble("  ", (entry.name, "bold cyan"), made_by))
    console.print(Padding(entry.summary, (0, 0, 0, 4)))
    if entry.lacking:
        console.print(Padding(Text(entry.lacking, style="yellow"), (0, 0, 0, 4)))
    if entry.options:
        listed = Table.grid(padding=(0, 2))
        for option in entry.options:
            listed.add_row(f"{option['name']}={option['default']}", option["help"])
        console.print(Padding(listed, (0, 0, 0, 6)))
