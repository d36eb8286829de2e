"""Tracks the logs of a run or a study: their digests, and the one copy of each that all its cells run on."""

from collections.abc import Iterator
from pathlib import Path

from ...core.errors import InputError
from ...datasets import archive
from ..plan.variant import DatasetVariant, OneLog
from ..plan.work import PlannedCell, Work
from ..record.store import Known, Store
from ..workers.batch import Finished, KeptLog, LogFacts, facts_of
from .key import from_files, log_key, made_once
from .log_files import LogFiles

KINDS = {"truth": "ground truth", "relations": "true motions", "reference": "a batch optimum alone", "": "no truth"}
"""What the errors on a log are measured from, by its truth kind."""


class KnownLogs:
    """The logs in the record and in its folder, by their keys."""

    def __init__(self, store: Store, work: Work) -> None:
        self.known = store.logs(arrays=work.keep)
        self.unmade = store.logs_unmade()  # by key, the status of its cells
        self.kept: dict[str, KeptLog] = {}  # at hand for whoever is to run on them
        self.lost: dict[str, Finished] = {}  # that should be, but could not be made
        self._made = store.logs_made()
        self._store, self._work = store, work
        self._map = "" if work.map is None else work.map.digest
        self._files = LogFiles(store.folder)
        self._files.tidy()

    def key(self, cell: PlannedCell) -> str:
        """The key of the cell's log."""
        return log_key(cell.cell.log, self._map)

    def are_kept(self, cell: PlannedCell) -> bool:
        """True where all cells run on one copy of the cell's log: another worker might make a different one."""
        return self._work.logs_first or made_once(cell.cell.log)

    def is_doubtful(self, cell: PlannedCell) -> bool:
        """True where the log must be made first: from files, made by other code, or the work wants all logs first."""
        if from_files(cell.cell.log) or (self.key(cell) not in self.known and _name(cell) in self._made):
            return True
        return self._work.logs_first and not self.is_at_hand(cell)

    def is_at_hand(self, cell: PlannedCell) -> bool:
        """True where the cell's log is kept, need not be, or could not be made."""
        key, dataset = self.key(cell), cell.cell.log.dataset.name
        log = self.known.get(key)
        if key in self.kept or key in self.lost or not self.are_kept(cell):
            return True
        if log is None or self._files.read(dataset, log) is None:
            return False
        self.kept[key] = self._files.entry(dataset, log)
        return True

    def refuse_unlike(self) -> None:
        """Raises InputError where two logs of one dataset of many are the same, or are judged by different things."""
        for dataset in {cell.cell.dataset for cell in self._work.cells}:
            before: dict[str, OneLog] = {}
            kinds: dict[str, OneLog] = {}
            for log in map(dataset.log, range(len(dataset.members))):
                known = self.known.get(log_key(log, self._map))
                if known is None:
                    continue
                twin = before.setdefault(known.digest, log)
                if twin is not log:
                    raise InputError(
                        f"dataset {dataset.label}: {twin.name} and {log.name} are the same log, whose digest is "
                        f"{known.digest[:12]}; expected each log once."
                    )
                kinds.setdefault(known.truth_kind, log)
            if len(kinds) > 1 and not self._are_judged_by_maps(dataset):
                said = " and ".join(f"{one.name} has {KINDS[kind]}" for kind, one in [*kinds.items()][:2])
                raise InputError(
                    f"dataset {dataset.label}: found logs whose errors are not of one kind, {said}; expected the "
                    "same of all, or true places of landmarks in each: run them as datasets of their own."
                )

    def _are_judged_by_maps(self, dataset: DatasetVariant) -> bool:
        """True if all logs of a run's dataset have true places of landmarks, though the true path is unknown of some.

        A study's claims are of one column over all logs, so that it takes no such dataset.
        """
        if not self._work.logs_first:
            return False
        found = (
            (log, self.known.get(log_key(log, self._map))) for log in map(dataset.log, range(len(dataset.members)))
        )
        made = [self._files.read(log.dataset.name, known) for log, known in found if known is not None]
        truths = [None if one is None else one.truth for one in made]
        return all(
            truth is not None and truth.map is not None and truth.kind != "relations" and truth.places == "truth"
            for truth in truths
        )

    def looked(self, cell: PlannedCell, finished: Finished) -> str:
        """Takes in a log that was made, or could not be; returns a remark for the user, or ""."""
        if finished.log is None:
            if self.are_kept(cell):
                self.lost[self.key(cell)] = finished
            if self.unmade.get(self.key(cell)) != finished.result.status:
                self.unmade.pop(self.key(cell), None)  # for another reason than before: its cells end anew
        elif self.are_kept(cell):
            return self._keep(cell, finished.log)
        else:
            self.know(cell, finished.log)
        return ""

    def know(self, cell: PlannedCell, log: LogFacts) -> None:
        """Records the facts of the cell's log."""
        known, key = Known(*log[:3]), self.key(cell)
        if self.known.get(key) != known:
            truth = log.truth if self._work.keep else {}
            self._store.put_log(key, _name(cell), known, truth, log.sketch, log.remarks)
            self.known[key] = known
            self.unmade.pop(key, None)

    def know_unmade(self, cell: PlannedCell, status: str) -> None:
        """Records that the cell's log could not be made, and the status of its cells."""
        key = self.key(cell)
        self._store.put_unmade(key, _name(cell))
        self.unmade[key] = status

    def _keep(self, cell: PlannedCell, made_now: LogFacts) -> str:
        """Keeps a new log, or stays with an earlier one that differs by rounding alone."""
        key, dataset = self.key(cell), cell.cell.log.dataset.name
        earlier = list(self._comparable(cell, made_now.digest))  # mostly none: the log need not be unpacked here
        like = self._files.like(dataset, archive.unpacked(made_now.archive), earlier) if earlier else None
        log = made_now if like is None else facts_of(like)
        before, known = self.known.get(key), Known(*log[:3])
        self._refuse_another(cell, known)
        if self._files.read(dataset, known) is None:
            self._files.keep(dataset, known, made_now.archive)
        is_lost = before not in (None, known) and self._files.read(dataset, before) is None
        self.know(cell, log._replace(sketch=made_now.sketch, archive=b""))
        self.kept[key] = self._files.entry(dataset, known)._replace(mistaken=log.mistaken)
        return _told(cell, self._files.entry(dataset, before).path) if before is not None and is_lost else ""

    def _refuse_another(self, cell: PlannedCell, now: Known) -> None:
        """Raises InputError where a continued run's log, or its truth, has changed since the run was begun."""
        before = self._made.get(_name(cell), ())
        if not self._work.logs_first or not before or now in before:
            return
        was = before[-1]
        what, found, expected = "", now.digest[:12], was.digest[:12]
        if found == expected:
            what, (found, expected) = (
                "the truth of ",
                (log.truth_digest[:12] if log.truth_kind == "truth" else "no truth" for log in (now, was)),
            )
        raise InputError(
            f"--out {self._store.folder}: {what}{cell.cell.dataset.label}, seed {cell.cell.seed}, has changed since "
            f"this run was begun: its digest is {found}, expected {expected}; run into another folder."
        )

    def _comparable(self, cell: PlannedCell, digest: str) -> Iterator[Known]:
        """Yields earlier logs that the new one, of that digest, may equal but for rounding, the cell's own first.

        A portable source makes a different log only from other files or by other code: of its logs, only the references
        are comparable.
        """
        own = self.known.get(self.key(cell))
        if own is not None and not cell.cell.log.dataset.source.portable:
            yield own
        same = [known for known in self._made.get(_name(cell), ()) if known.digest == digest]
        yield from sorted(same, key=lambda known: known != own)


def _told(cell: PlannedCell, path: Path) -> str:
    """Makes the remark on a kept log that is lost and was not made the same again."""
    seed = f", seed {cell.cell.seed}" if cell.cell.dataset.numbered else ""
    return (
        f"{cell.cell.dataset.label}{seed}: the kept copy, {path}, is gone or damaged, and the log made in its place "
        "differs: its results are computed again."
    )


def _name(cell: PlannedCell) -> tuple[str, str, int]:
    log = cell.cell.log
    return log.dataset.name, log.dataset.given, log.seed
