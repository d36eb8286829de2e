"""Writes the tables of backends.md and datasets.md, and the format in studies.md: `make docs-tables`.

Each file keeps its text; what stands between the lines BEGIN and END is replaced. standing.md and its pictures are
written whole, from the tables beside it, which `bench suite --standing` writes from runs.
"""

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from slamduel.backends import registry as backends
from slamduel.bench.plan.many import LIST
from slamduel.bench.plan.spec import describe
from slamduel.bench.study.file import FORMAT
from slamduel.bench.suite.page import files
from slamduel.datasets import registry as datasets
from slamduel.datasets.redrawn import Drawn

FOLDER = Path(__file__).parent
BEGIN, END = "<!-- begin: written by make docs-tables -->", "<!-- end -->"

BAR = "\\|"
"""A bar within a cell."""

DRAWN = "one; drawn, one per seed"
"""Logs of a dataset with the option draw."""

SHARED = 5
"""An option that so many have is described once."""

Option = tuple[str, str, str]
"""Name, default and help."""


class Entry(NamedTuple):
    """A backend or a dataset."""

    name: str
    cells: tuple[str, ...]  # of its row in the first table
    options: list[Option]


def pages() -> dict[Path, str]:
    """The files as they should be."""
    written = {
        "backends.md": _tables(("backend", "implementation", "summary"), list(_backends())),
        "datasets.md": _tables(("dataset", "logs", "summary"), list(_datasets())),
        "studies.md": ["", FORMAT.strip("\n")],
    }
    parts = {FOLDER / name: _page(FOLDER / name, "\n".join(lines)) for name, lines in written.items()}
    return parts | files(FOLDER / "standing.md")


def _page(path: Path, text: str) -> str:
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    return f"{before}{BEGIN}\n{text}\n{END}{rest.partition(END)[2]}"


def _backends() -> Iterator[Entry]:
    for name in backends.BUILTIN:
        builder = backends.find(name)
        made_by = backends.implementation(name, builder.options())
        yield Entry(name, (made_by, builder.summary), describe(builder.options))


def _datasets() -> Iterator[Entry]:
    for name in datasets.BUILTIN:
        source = datasets.find(name)
        yield Entry(name, (_logs(name, source), source.summary), describe(source.options))


def _logs(name: str, source: datasets.Source) -> str:
    """The number of logs that a dataset has, as the table says it."""
    if source.seeded:
        return "one per seed"
    if issubclass(source.options, Drawn):
        return DRAWN
    with patch.dict(os.environ, SLAMDUEL_CACHE=os.devnull):  # all that there are, whatever was fetched
        many = len(source.many(source.options()))
    return "several" if name == LIST else str(many) if many else "one"


def _tables(headings: tuple[str, ...], entries: list[Entry]) -> Iterator[str]:
    yield from _table(headings, [(f"`{entry.name}`", *entry.cells) for entry in entries])
    having = Counter(option for entry in entries for option in entry.options)
    shared = [option for option, count in having.items() if count >= SHARED]
    groups = dict[tuple[str, ...], list[Option]]()
    for option in shared:
        groups.setdefault(tuple(entry.name for entry in entries if option in entry.options), []).append(option)
    for names, options in groups.items():
        yield f"\nOptions of {', '.join(f'`{name}`' for name in names)}:\n"
        yield from _options(options)
    for entry in entries:
        own = [option for option in entry.options if option not in shared]
        if own:
            yield f"\n{'Further options' if len(own) < len(entry.options) else 'Options'} of `{entry.name}`:\n"
            yield from _options(own)


def _options(options: list[Option]) -> Iterator[str]:
    yield from _table(
        ("option", "default", "meaning"), [(f"`{n}`", value and f"`{value}`", text) for n, value, text in options]
    )


def _table(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    for cells in (headings, ("---",) * len(headings), *rows):
        yield f"| {' | '.join(cell.replace('|', BAR) for cell in cells)} |"


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
