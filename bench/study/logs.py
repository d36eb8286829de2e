"""What a study knows of its logs: their digests, and which copy of each all its cells run on."""

from collections.abc import Iterator
from pathlib import Path

from ...datasets import archive
from ...frontend.factors import Dataset
from ..record.study_store import Known, StudyStore
from ..workers.batch import Finished, KeptLog, LogFacts, facts_of
from .key import from_files, log_key, log_seed, made_once
from .log_files import LogFiles
from .study import StudyCell


class StudyLogs:
    """The logs of a study in its store and its folder, by their keys."""

    def __init__(self, store: StudyStore, *, arrays: bool) -> None:
        """`arrays`: those of the truths are kept, too."""
        self.known = store.logs(arrays=arrays)
        self.unmade = store.logs_unmade()
        self.kept: dict[str, KeptLog] = {}  # at hand for whoever is to run on them
        self.lost: dict[str, Finished] = {}  # that should be, but were looked at in vain
        self._made = store.logs_made()
        self._store, self._arrays = store, arrays
        self._files = LogFiles(store.folder)
        self._files.tidy()

    def is_doubtful(self, cell: StudyCell) -> bool:
        """Whether the cell's log lies in files, which may have changed, or is known by other code alone."""
        return from_files(cell.cell) or (log_key(cell.cell) not in self.known and _name(cell) in self._made)

    def is_at_hand(self, cell: StudyCell) -> bool:
        """Whether the cell's log is kept, or need not be, or was looked at in vain."""
        key, dataset = log_key(cell.cell), cell.cell.dataset.name
        log = self.known.get(key)
        if key in self.kept or key in self.lost or not made_once(cell.cell):
            return True
        if log is None or self._files.read(dataset, log) is None:
            return False
        self.kept[key] = self._files.entry(dataset, log)
        return True

    def looked(self, cell: StudyCell, finished: Finished) -> str:
        """Take in what came of a look at the cell's log; what a user should know of it, if anything."""
        if finished.log is None:
            if made_once(cell.cell):
                self.lost[log_key(cell.cell)] = finished
        elif made_once(cell.cell):
            return self._keep(cell, finished.log.archive)
        else:
            self.know(cell, finished.log)
        return ""

    def know(self, cell: StudyCell, log: LogFacts) -> None:
        """That this is the cell's log, which was made."""
        known, key = Known(*log[:3]), log_key(cell.cell)
        if self.known.get(key) != known:
            self._store.put_log(key, _name(cell), known, log.truth if self._arrays else {})
            self.known[key] = known
            self.unmade.discard(key)

    def know_unmade(self, cell: StudyCell) -> None:
        """That the cell's log could not be made."""
        key = log_key(cell.cell)
        self._store.put_unmade(key, _name(cell))
        self.unmade.add(key)

    def _keep(self, cell: StudyCell, content: bytes) -> str:
        """Keep a log that was made just now, or stay with one of before where they differ by rounding alone."""
        key, dataset, made = log_key(cell.cell), cell.cell.dataset.name, archive.unpacked(content)
        log = facts_of(self._files.like(dataset, made, self._comparable(cell, made)) or made)
        before, known = self.known.get(key), Known(*log[:3])
        if self._files.read(dataset, known) is None:
            self._files.keep(dataset, known, content)
        is_lost = before not in (None, known) and self._files.read(dataset, before) is None
        self.know(cell, log)
        self.kept[key] = self._files.entry(dataset, known)
        return _told(cell, self._files.entry(dataset, before).path) if before is not None and is_lost else ""

    def _comparable(self, cell: StudyCell, made: Dataset) -> Iterator[Known]:
        """Logs of before that the one made now may be but for rounding, the cell's own first.

        A source that is the same everywhere makes another log only of other files or by other code: of its logs, only
        the references are comparable.
        """
        own = self.known.get(log_key(cell.cell))
        if own is not None and not cell.cell.dataset.source.portable:
            yield own
        same = [known for known in self._made.get(_name(cell), ()) if known.digest == made.log.digest]
        yield from sorted(same, key=lambda known: known != own)


def _told(cell: StudyCell, path: Path) -> str:
    """What to say of a log that was kept at `path` and could not be made the same once more."""
    seed = f", seed {cell.cell.seed}" if cell.cell.dataset.source.seeded else ""
    return (
        f"{cell.cell.dataset.label}{seed}: the study's copy, {path}, is gone or damaged, and the log made in its place "
        "is another one: what had run on it runs again."
    )


def _name(cell: StudyCell) -> tuple[str, str, int]:
    return cell.cell.dataset.name, cell.cell.dataset.given, log_seed(cell.cell)
