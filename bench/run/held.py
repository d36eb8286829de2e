"""Writes the logs that Python holds into the folder of their run, where the run finds them by path."""

import contextlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.factors import Dataset, Log
from ...core.files import write_whole
from ...datasets import truth as truths
from ...datasets.formats import log_folder
from ..plan.many import LIST
from ..plan.spec import dataset_at, dataset_variants
from .benchmark import begun
from .runner import LOGS

ASKER = "slamduel.run"  # who refuses arguments, in messages
EXPECTED = "a name, a path, a Log or a Dataset(log, truth)"
LONGEST = 60  # letters of a log's name in its folder's: no file system takes more than 255 bytes
LISTED = "logs.toml"  # the file of the logs of one dataset
Named = str | Path | Log | Dataset  # on the command line or as a path, or a log in memory


class Held:
    """The logs of a run that Python holds, and their places in its folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._logs: dict[Path, Dataset] = {}
        self._list = ""  # the content of LISTED

    def word(self, dataset: Named) -> str:
        """The dataset's label. InputError where it cannot be used."""
        if isinstance(dataset, str):
            dataset_variants(dataset, ASKER)
            return dataset
        if isinstance(dataset, Path):
            return dataset_at(dataset, ASKER).label
        return dataset_at(self._place(dataset), ASKER, "log").label

    def together(self, logs: Any) -> str:
        """The label of one dataset of several logs, by cluster in a mapping; InputError where they cannot be used."""
        groups: dict[Any, Any] = {**logs} if isinstance(logs, Mapping) else {None: logs}
        for cluster, group in groups.items():
            if cluster is not None and not (isinstance(cluster, str) and cluster.strip()):
                raise InputError(f"{ASKER}: found the cluster {cluster!r} in logs, expected its name, a text.")
            if isinstance(group, str | Path | Log | Dataset) or not isinstance(group, Iterable):
                raise InputError(f"{ASKER}: logs has {group!r:.40}, expected a list: each {EXPECTED}.")
            for one in each(group, None, "logs"):
                entry = {"dataset": one} if isinstance(one, str) else {"path": self._listed(one)}
                words = entry | ({} if cluster is None else {"cluster": cluster})
                lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in words.items()]
                self._list += "".join(["[[logs]]\n", *lines, "\n"])
        if not self._list:
            raise InputError(f"{ASKER}: logs is empty, expected at least one.")
        place = self._folder / LOGS / LISTED
        if place.exists() and place.read_text(encoding="utf-8") != self._list:
            raise InputError(f"{place}: names other logs or clusters, expected the same, or another folder.")
        return f'{LIST}[path="{place}"]' if set(",[]") & set(str(place)) else f"{LIST}[path={place}]"

    def _listed(self, one: Path | Log | Dataset) -> str:
        """The path of a log as LISTED has it: from its own folder."""
        return os.path.abspath(one) if isinstance(one, Path) else self._place(one).name

    def _place(self, dataset: Log | Dataset) -> Path:
        """The place of a log in memory. InputError where it cannot be used."""
        log, truth = dataset if isinstance(dataset, Dataset) else (dataset, None)
        if not isinstance(log, Log):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from a user
            raise InputError(f"{ASKER}: the log of a dataset is {log!r}, expected a Log.")
        log_folder.check_writable(log, truth)
        place = self._folder / LOGS / (re.sub(r"[^\w.-]+", "-", log.name)[:LONGEST].strip("-.") or "log")
        if place in self._logs:
            both = f"{self._logs[place].log.name!r} and {log.name!r}"
            raise InputError(
                f"{ASKER}: found logs named {both}, which would both be kept in {place}; expected other names."
            )
        dataset_at(place, ASKER, "log")
        if place.exists() and not _same(log_folder.read(place), Dataset(log, truth)):
            raise InputError(
                f"{place}: holds another log named {log.name}, or another truth of it, expected the same, or another "
                "name or folder."
            )
        self._logs[place] = Dataset(log, truth)
        return place

    @contextlib.contextmanager
    def written(self) -> Generator[None]:
        """Writes the logs into their places; removes them again if no run was begun."""
        folder, listed = self._folder, self._folder / LOGS / LISTED
        missing = [path for path in (folder / LOGS, folder, *folder.parents) if not path.exists()]
        new = [place for place in self._logs if not place.exists()]
        lists = [listed] if self._list and not listed.exists() else []
        try:
            for place in new:
                log_folder.write(place, *self._logs[place])
            for place in lists:
                place.parent.mkdir(parents=True, exist_ok=True)
                write_whole(place, self._list)
            yield
        finally:
            if not begun(folder):
                for place in new:
                    shutil.rmtree(place, ignore_errors=True)
                for place in lists:
                    place.unlink(missing_ok=True)
                for path in missing if new or lists else ():
                    with contextlib.suppress(OSError):  # not empty: of another program
                        path.rmdir()


def each(dataset: Any, truth: Any, name: str = "dataset") -> list[Named]:
    """Lists the datasets of an argument, with the truth that belongs to a single Log; InputError for anything else."""
    several: list[Any] = [dataset]
    if isinstance(dataset, Iterable) and not isinstance(dataset, str | Log | Dataset):
        several = list(dataset)
    for found in several:
        if not isinstance(found, str | Path | Log | Dataset):
            raise InputError(f"{ASKER}: {name} is {found!r}, expected {EXPECTED}.")
    if not several:
        raise InputError(f"{ASKER}: {name} is empty, expected at least one.")
    if truth is None:
        return several
    if len(several) != 1 or not isinstance(several[0], Log):
        raise needless_truth()
    return [Dataset(several[0], truth)]


def needless_truth() -> InputError:
    """Makes the refusal of a truth without its log."""
    return InputError(f"{ASKER}: found a truth, expected one Log that it belongs to, or Dataset(log, truth).")


def _same(kept: Dataset, given: Dataset) -> bool:
    """True if `given` is the `kept` log: written and read, it has the same factors and the same truth."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        log_folder.write(Path(scratch) / LOGS, *given)
        again = log_folder.read(Path(scratch) / LOGS)
    told = [None if truth is None else truths.digest(truth) for truth in (kept.truth, again.truth)]
    return kept.log.digest == again.log.digest and told[0] == told[1]
