"""Suite files: TOML, read into a `Suite`; what is wrong with one is said with its line.

title      the headline (the file's name)
question   what the suite answers
note       what a reader of its tables needs to know
backend    of every [[run]] that has none of its own: a name as in bench run
           --backend, or a list of them
seeds      likewise, logs per dataset (10); a dataset of many logs has its own
timeout_s, memory_mb   limits of a cell (1800, 8000)

[[run]]    as many as needed; each is one bench run, in a folder of its own
name       of its folder: letters, digits, - and _
dataset    a name as in bench run --dataset, or a list of them
backend, seeds, timeout_s, memory_mb   of this run alone
"""

import contextlib
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.toml.packaged import read_named
from ...core.toml.table import TomlTable
from ..plan.spec import backend_variants, dataset_variants

FORMAT = (__doc__ or "").partition("\n\n")[2]  # the format, for `bench suite --help`
PACKAGED = Path(__file__).parent / "suites"  # the packaged suites, each NAME.toml

KEYS = ("title", "question", "note", "backend", "seeds", "timeout_s", "memory_mb", "run")
OF_RUN = ("name", "dataset", "backend", "seeds", "timeout_s", "memory_mb")

_NAME = re.compile(r"[A-Za-z0-9][\w-]{0,59}")


@dataclass(frozen=True)
class SuiteRun:
    """One run of a suite."""

    name: str  # of its folder
    given: Mapping[str, Any]  # as `bench run` takes it: backend, dataset, seeds and limits

    @property
    def datasets(self) -> str:
        """The options that name its logs, as one types them."""
        given = [(name, self.given[name]) for name in ("dataset", "seeds") if name in self.given]
        return " ".join(f"--{name} {shlex.quote(str(value))}" for name, value in given)

    @property
    def words(self) -> list[str]:
        """The command that makes it, without --out."""
        flags = {"timeout_s": "timeout", "memory_mb": "memory"}
        options = ((f"--{flags.get(name, name)}", f"{value}") for name, value in self.given.items())
        return ["bench", "run", *(word for option in options for word in option)]

    @property
    def command(self) -> str:
        """The command as one types it."""
        return shlex.join(self.words)


@dataclass(frozen=True)
class Suite:
    """A named list of runs."""

    name: str
    title: str
    question: str
    note: str
    runs: tuple[SuiteRun, ...]
    text: str  # of its file


def packaged() -> list[str]:
    """Lists the names of the packaged suites, from the quickest on."""
    order = ("quick", "simulated", "real", "camera", "laser", "speed")
    names = [path.stem for path in PACKAGED.glob("*.toml")]
    return sorted(names, key=lambda name: (order.index(name) if name in order else len(order), name))


def read(which: str) -> Suite:
    """Reads the packaged suite of that name, or the file at that path."""
    return made(*read_named(which, PACKAGED, packaged(), "suite"))


def made(path: Path, text: str, *, again: bool = False) -> Suite:
    """Parses a suite; InputError names the file, the line and the key of the first thing that is wrong.

    A text that was read before, `again`, may name what is not here any more.
    """
    words = TomlTable.parse(str(path), text).only(KEYS)
    name = path.name.removesuffix(".toml")
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{path}: the name of a suite's file has letters, digits, - and _ before .toml, found {name!r}."
        )
    entries = words.tables("run", "[[run]] with a name and a dataset")
    if not entries:
        raise words.lacks("run", "[[run]] with a name and a dataset")
    runs = tuple(_run(entry, words, again=again) for entry in entries)
    for k, run in enumerate(runs):
        if run.name in {other.name for other in runs[:k]}:
            raise entries[k].refused("name", f"{run.name} is the name of two runs, expected one each.")
    title, question, note = words.text("title", name), words.text("question", ""), words.text("note", "")
    return Suite(name, title, question, note, runs, text)


def _run(entry: TomlTable, suite: TomlTable, *, again: bool) -> SuiteRun:
    entry.only(OF_RUN)
    name = entry.text("name")
    if not _NAME.fullmatch(name):
        raise entry.fault("name", "letters, digits, - and _")
    backend = entry if entry.has("backend") else suite
    given: dict[str, Any] = {
        "backend": ",".join(backend.names("backend")),
        "dataset": ",".join(entry.names("dataset")),
        "seeds": entry.whole("seeds", suite.whole("seeds", 10, 1), 1),
    }
    if not again:
        backend_variants(given["backend"], backend.where("backend"))
    with contextlib.suppress(*[InputError] * again):
        found = dataset_variants(given["dataset"], entry.where("dataset"))
        if all(len(dataset.members) > 1 for dataset in found):
            del given["seeds"]  # each has logs of its own, and all of them are run
    for limit, read_limit in (("timeout_s", _seconds), ("memory_mb", _megabytes)):
        for table in (suite, entry):
            if table.has(limit):
                given[limit] = read_limit(table, limit)
    return SuiteRun(name, given)


def _seconds(table: TomlTable, key: str) -> float:
    return table.number(key, above=0)


def _megabytes(table: TomlTable, key: str) -> int:
    return table.whole(key, 0, 1, 10**9)
