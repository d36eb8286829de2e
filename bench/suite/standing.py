"""The standing on one dataset: the lines of a suite's run and of submissions on the same logs, and the verdict."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..record.schema import Row, label
from ..record.sketch import ROUNDING, distance, from_words
from ..record.store import Store
from ..verdict.pairing import one_machine
from ..verdict.summary import Line, lines
from ..verdict.verdict import Verdict, verdict
from ..words.columns import COLUMNS
from ..words.numerals import counted
from .submission import Submission

COSTS = tuple(name for name, column in COLUMNS.items() if column.kind.is_time or name == "peak_mb")


@dataclass(frozen=True)
class Standing:
    """One dataset of a suite."""

    run: str  # the name of its run
    folder: Path  # of the run
    facts: Mapping[str, Any]  # run.json's content
    dataset: str  # label
    slug: str  # the label as it is in paths, and the anchor in the run's report
    lines: Sequence[Line]
    verdict: Verdict
    submitted: Mapping[str, Submission]  # by backend label
    elsewhere: frozenset[str]  # submitted ones that were timed on another machine: their costs are not compared
    notes: Sequence[str]  # what of submissions is left out, and remarks on the logs

    @property
    def name(self) -> str:
        """The dataset's display name."""
        return self.lines[0].name


def standings(run: str, folder: Path, entered: Sequence[Submission]) -> list[Standing]:
    """Reads the standings of a run's datasets, in its order, with the lines that were entered."""
    with Store(folder) as store:
        facts, rows, remarks = store.run(), list(store.cells()), store.remarks()
    by_dataset: dict[str, list[Row]] = {}
    for row in rows:
        by_dataset.setdefault(label(row.columns["dataset"], row.columns["dataset_options"]), []).append(row)
    found: list[Standing] = []
    for dataset in facts["folders"]:
        mine = by_dataset.get(dataset, [])
        if not mine:  # a backend, or a dataset without a cell that has ended
            continue
        others, submitted, elsewhere, notes = _entered(dataset, mine, facts, entered)
        programs = dict(facts.get("implementations", {}))
        for backend, one in submitted.items():
            programs[backend] = one.run.get("implementations", {}).get(backend, "")
        whole = lines([*mine, *others], programs)
        said = [*notes, *remarks.get(dataset, ())]
        slug = facts["folders"][dataset]
        found.append(
            Standing(run, folder, facts, dataset, slug, whole, verdict(whole), submitted, frozenset(elsewhere), said)
        )
    return found


def _entered(
    dataset: str, mine: Sequence[Row], facts: Mapping[str, Any], entered: Iterable[Submission]
) -> tuple[list[Row], dict[str, Submission], set[str], list[str]]:
    """The submitted rows on these logs, whose they are, which were timed elsewhere, and what is left out."""
    own = {row.columns["seed"]: row.columns for row in mine}
    taken = {_backend(row) for row in mine}
    rows, notes, whose, elsewhere = list[Row](), list[str](), dict[str, Submission](), set[str]()
    for submission in entered:
        with Store(submission.folder) as store:
            theirs = [row for row in store.cells() if label(*row.key[:2]) == dataset and _backend(row) not in taken]
        if not theirs:
            continue
        here = one_machine(facts, submission.run)
        kept: list[Row] = []
        for row in theirs:
            seed = row.columns["seed"]
            if seed in own and _same_log(f"{dataset}, seed {seed}", row, own[seed], facts, submission.run):
                columns = dict(row.columns) | {"digest": own[seed]["digest"]}
                columns |= {} if here else dict.fromkeys(COSTS) | {"timing_alone": 1}
                kept.append(Row(columns, row.traceback, row.log, row.result))
        if len(kept) < len(theirs):
            cells = counted(len(theirs) - len(kept), "cell")
            notes.append(f"{submission.name}: {cells} on other logs than this suite's are left out.")
        logs = {columns["digest"] for columns in own.values()}
        notes += [f"{submission.name}: {said}" for said in _lacking(kept, logs)]
        whose |= {_backend(row): submission for row in kept}
        elsewhere |= set() if here else {_backend(row) for row in kept}
        rows += kept
        taken |= {_backend(row) for row in theirs}
    return rows, whose, elsewhere, notes


def _lacking(rows: Sequence[Row], logs: Collection[str]) -> Iterator[str]:
    """Says which backends did not run on all logs, by digest: whoever chooses the logs chooses the result."""
    for backend in dict.fromkeys(map(_backend, rows)):
        ran = {row.columns["digest"] for row in rows if _backend(row) == backend}
        if len(ran) < len(logs):
            yield f"{backend} ran on {len(ran)} of {counted(len(logs), 'log')} of this suite."


def _backend(row: Row) -> str:
    return label(row.columns["backend"], row.columns["options"])


def _same_log(name: str, row: Row, own: Mapping[str, Any], facts: Mapping[str, Any], theirs: Mapping[str, Any]) -> bool:
    """True if both ran on one log, to the last bit or but for rounding, and are judged by one truth."""
    if row.columns["truth_kind"] != own["truth_kind"]:
        return False
    truths = [run.get("truths", {}).get(name) for run in (facts, theirs)]
    if truths[0] != truths[1]:
        return False
    if row.columns["digest"] == own["digest"]:
        return True
    one, other = (from_words(run.get("sketches", {}).get(name)) for run in (facts, theirs))
    return one is not None and other is not None and distance(one, other) <= ROUNDING


def named_apart(found: Sequence[Standing]) -> list[Standing]:
    """Gives standings of several runs names that tell them apart: labels, where two have one display name."""
    names = [one.name for one in found]
    return [
        one
        if names.count(one.name) == 1
        else replace(one, lines=[line._replace(name=one.dataset) for line in one.lines])
        for one in found
    ]
