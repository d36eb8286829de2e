"""The results of a site: of each suite its newest runs, their standings, and what is kept of its versions."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from .file import packaged
from .history import Summary, summaries
from .over_versions import OverVersions, over_versions
from .site_folder import SuiteFolder, suites
from .standing import Standing, named_apart, standings
from .submission import Submission

DEFAULT = Path("results/suite")  # where a site is unless --out says otherwise


class SuiteResults(NamedTuple):
    """A suite with its newest runs and its history."""

    folder: SuiteFolder
    command: str  # that runs it
    found: Sequence[Standing]
    kept: Sequence[Summary]  # of its versions, the oldest first
    history: OverVersions | None  # where two versions are kept

    @property
    def name(self) -> str:
        """The suite's name."""
        return self.folder.suite.name


def results(site: Path, entered: Sequence[Submission]) -> list[SuiteResults]:
    """Reads a site, packaged suites first, with the results that were entered. InputError where it has no suite."""
    there = suites(site)
    if not any(one.runs or one.skipped for one in there.values()):
        raise InputError(f"{site}: holds no run of a suite; bench suite NAME --out {site} makes one.")
    order = [*[name for name in packaged() if name in there], *sorted(set(there) - set(packaged()))]
    return [_results(there[name], entered, summaries(site, name), where(site)) for name in order]


def _results(folder: SuiteFolder, entered: Sequence[Submission], kept: Sequence[Summary], place: str) -> SuiteResults:
    found = named_apart([one for name, run in folder.runs.items() for one in standings(name, run, entered)])
    history = over_versions(kept) if len(kept) > 1 else None
    return SuiteResults(folder, command(folder.suite.name) + place, found, kept, history)


def command(suite: str) -> str:
    """The command that runs a suite, into the usual place."""
    return f"bench suite {shlex.quote(suite)}"


def where(site: Path) -> str:
    """The option that names the site; "" for the usual place."""
    return "" if site == DEFAULT else f" --out {shlex.quote(str(site))}"
