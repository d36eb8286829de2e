"""Checks a results folder from its files to a sample of its cells, and says what holds, fails or was not checked."""

import secrets
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from ..record.schema import FILE
from ..words.numerals import counted, listed
from ..workers.executor import Executor
from .again import check_cells
from .files import check_files
from .folder import FAILS, Finding, read
from .logs import check_logs
from .scores import check_scores

LARGEST_SEED = 10**6  # of one that is drawn here: short enough to be typed


class Verification(NamedTuple):
    """The result of all checks."""

    folder: Path
    findings: tuple[Finding, ...]
    backends: tuple[str, ...] = ()  # that have a cell that is done
    again: tuple[str, ...] = ()  # the backend of each cell that was run again

    @property
    def failed(self) -> bool:
        """True where any check failed."""
        return any(finding.verdict == FAILS for finding in self.findings)

    @property
    def sentence(self) -> str:
        """Concludes in a sentence: verified where nothing failed and a cell of each backend was run again."""
        if self.failed:
            return f"Not verified: {counted(sum(one.verdict == FAILS for one in self.findings), 'fault')} found."
        said, left = "nothing that was checked is wrong", [name for name in self.backends if name not in self.again]
        if self.again and not left:
            return f"Verified: {said}, and {counted(len(self.again), 'cell')} run again gave the same."
        return f"Partly verified: {said}, but no cell of {listed(left, 4)} was run again."


def verify(
    folder: Path,
    executor: Executor,
    *,
    sample: int | None = None,
    seed: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Verification:
    """Checks the folder that a run left; InputError where it is none.

    `sample` cells are run again, SAMPLE and one of each backend where None; `seed` draws them, one that nobody can know
    before where None.
    """
    if not any((folder / name).is_file() for name in (FILE, "run.json", "cells.csv")):
        found = "holds no results" if folder.is_dir() else "is no folder"
        raise InputError(f"{folder}: {found}; expected the folder that bench run left.")
    drawn_with = secrets.randbelow(LARGEST_SEED) if seed is None else seed
    findings = check_files(folder)
    try:
        found = read(folder)
    except InputError:
        if any(finding.verdict == FAILS for finding in findings):
            return Verification(folder, tuple(findings))  # which say so
        raise
    if not found.cells:
        raise InputError(f"{folder}: no cell has ended in this run, expected some to check.")
    timeout_s = float(found.run.get("timeout_s", 1800.0))
    about_logs, trusted = check_logs(found, executor, timeout_s, lambda name: say(f"made {name}"))
    findings += [*about_logs, *check_scores(found, trusted)]
    about_cells, again = check_cells(found, trusted, sample, drawn_with, executor, lambda name: say(f"ran {name}"))
    return Verification(folder, (*findings, *about_cells), tuple(found.backends), tuple(again))
