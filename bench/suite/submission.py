"""Results of somebody else, entered into a site: a copy of their run's folder, with what its verification found."""

import hashlib
import json
import re
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.files import write_whole
from ..record.schema import FILE
from ..record.store import Store
from ..verify.verification import Verification

FOLDER = "submitted"


@dataclass(frozen=True)
class Submission:
    """An entered results folder."""

    folder: Path
    name: str
    entered: float  # s since 1970
    sentence: str  # of its verification
    again: tuple[str, ...]  # backends of which a cell was run again, by a verification that still holds
    findings: tuple[tuple[str, str, str], ...]  # subject, verdict and sentence of each
    run: Mapping[str, Any]  # the content of its run.json

    def whose(self, backend: str) -> str:
        """Says whose backend it is: its distribution and version, else its module."""
        said = self.run.get("distributions", {}).get(backend)
        if said:
            return str(said)
        name = backend.partition("[")[0]
        return f"module {name.partition(':')[0]}" if ":" in name else "slamduel's own, with these options"

    def mark(self, backend: str) -> str:
        """The backend's mark in tables."""
        return "verified" if backend in self.again else "not verified"


def enter(site: Path, verification: Verification) -> Path:
    """Copies a verified folder into the site, replacing one of that name; returns the copy.

    InputError where it cannot be copied, or where the folder is in the site already.
    """
    source = verification.folder
    name = re.sub(r"[^\w.-]+", "-", source.resolve().name).strip("-.") or "results"
    place = site / FOLDER / name
    if site.resolve() in source.resolve().parents:
        raise InputError(f"{source}: is in the site {site} already, expected a folder from elsewhere.")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{name}.", dir=place.parent) as beside:
            new = Path(beside, "new")
            shutil.copytree(source, new)
            if place.exists():
                place.rename(Path(beside, "old"))
            new.rename(place)
        words = {
            "entered": time.time(),
            "sentence": verification.sentence,
            "again": sorted(set(verification.again)),
            "findings": [list(finding) for finding in verification.findings],
            "sha256": digest(place),
        }
        write_whole(place.with_name(f"{name}.json"), json.dumps(words, indent=1) + "\n")
    except OSError as error:
        raise InputError(f"{error.filename or place}: cannot be written: {error.strerror}.") from None
    return place


def submissions(site: Path) -> list[Submission]:
    """Reads all that was entered, by name; one that has changed since it was verified is not verified any more."""
    return [_read(path) for path in sorted((site / FOLDER).glob("*.json"))]


def _read(path: Path) -> Submission:
    place = path.with_suffix("")
    try:
        words: Any = json.loads(path.read_text(encoding="utf-8"))
        entered, sentence, again = float(words["entered"]), str(words["sentence"]), tuple(map(str, words["again"]))
        findings = tuple((str(subject), str(verdict), str(said)) for subject, verdict, said in words["findings"])
        sha256 = str(words["sha256"])
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: is not what bench suite --add wrote; add the results again.") from None
    with Store(place) as store:
        run = store.run()
    if digest(place) != sha256:
        again, sentence = (), "Not verified: the folder has changed since it was entered."
    return Submission(place, place.name, entered, sentence, again, findings, run)


def digest(place: Path) -> str:
    """The sha256 of a folder's record, from which everything in the site is computed."""
    return hashlib.sha256((place / FILE).read_bytes()).hexdigest()
