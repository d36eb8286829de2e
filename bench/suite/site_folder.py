"""The folder of a benchmark's site: where its runs, its history, its submissions and its pages are.

index.html, SUITE.html          the pages
data/                           every table as CSV
figures/                        every figure as SVG
SUITE/VERSION/RUN/              the folder of a run, as bench run leaves it; suite.toml and skipped.json beside it
history/SUITE/                  one JSON file per version, day and machine
submitted/NAME/                 the folder of somebody else's run; NAME.json beside it
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.files import write_whole
from ..record.machine import environment
from ..record.schema import FILE
from ..record.store import Store
from .file import Suite, made

SUITE, SKIPPED = "suite.toml", "skipped.json"


@dataclass(frozen=True)
class SuiteFolder:
    """The runs of one version of a suite."""

    folder: Path
    suite: Suite
    skipped: Mapping[str, str]  # why a run was not made, by its name

    @property
    def runs(self) -> dict[str, Path]:
        """The folders of the runs that were begun, by their names."""
        places = {run.name: self.folder / run.name for run in self.suite.runs}
        return {name: place for name, place in places.items() if (place / FILE).is_file()}


def version() -> str:
    """The version of slamduel that runs."""
    return str(environment()["packages"].get("slamduel") or "unknown")


def begin(site: Path, suite: Suite) -> Path:
    """Makes the folder of this version's runs of a suite; returns it. InputError where it cannot be made."""
    folder = site / suite.name / version()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / SUITE, suite.text)
    except OSError as error:
        raise InputError(f"--out {site}: {error.strerror}; expected a folder that can be written to.") from None
    return folder


def end(folder: Path, skipped: Mapping[str, str]) -> None:
    """Writes which runs were skipped, and why."""
    write_whole(folder / SKIPPED, json.dumps(skipped, indent=1) + "\n")


def suites(site: Path) -> dict[str, SuiteFolder]:
    """Reads the newest version of every suite that was run into the site, by its name."""
    found: dict[str, tuple[float, SuiteFolder]] = {}
    for path in sorted(site.glob(f"*/*/{SUITE}")):
        name = path.parent.parent.name
        suite = made(Path(f"{name}.toml"), path.read_text(encoding="utf-8"), again=True)
        one = SuiteFolder(path.parent, suite, _skipped(path.with_name(SKIPPED)))
        began = max((_began(place) for place in one.runs.values()), default=0.0)
        if name not in found or began >= found[name][0]:
            found[name] = began, one
    return {name: one for name, (_, one) in found.items()}


def _skipped(path: Path) -> dict[str, str]:
    if not path.is_file():
        return {}
    try:
        words: Any = json.loads(path.read_text(encoding="utf-8"))
        return {str(name): str(why) for name, why in words.items()}
    except (ValueError, AttributeError):
        raise InputError(f"{path}: is not what bench suite wrote, expected why runs were skipped, by name.") from None


def _began(place: Path) -> float:
    with Store(place) as store:
        return float(store.about().get("started", 0.0))
