"""Makes the logs of a results folder again and compares them with those that its cells ran on.

A simulated or published log has the same digest on every machine. Rendered logs, and those of the laser front end,
differ by rounding between processors: of such a log the copy in the folder is compared, by the distance of two sketches
in units of the log's own noise.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from ...core.factors import Dataset
from ...datasets import archive
from ..engine.log_files import LogFiles, same
from ..plan.variant import OneLog
from ..record.sketch import ROUNDING, distance, sketch
from ..record.store import Known
from ..words.numerals import counted, listed
from ..workers.batch import Batch, Finished, KeptLog, facts_of
from ..workers.executor import Executor
from .folder import HOLDS, NAMED, OPEN, Finding, ResultsFolder, faults


@dataclass(frozen=True)
class TrustedLog:
    """A log that is the one made here, to the last bit or but for rounding."""

    dataset: Dataset
    kept: KeptLog | None  # the copy in the folder that cells are run on again


def check_logs(
    found: ResultsFolder, executor: Executor, timeout_s: float, made: Callable[[str], None]
) -> tuple[list[Finding], Mapping[str, TrustedLog]]:
    """Checks each log; returns the findings, and by the name of the log those that cells may be scored on.

    `made` is called with the name of each that has been made.
    """
    wanted: dict[str, tuple[OneLog, Known]] = {}
    unmade: dict[str, list[str]] = {}
    wrong: dict[str, str] = {}
    for cell in found.cells:
        name = cell.log_label
        if cell.known is None:
            continue  # it could not be made there either
        if cell.row.columns["digest"] != cell.known.digest:
            wrong.setdefault(name, f"the digest of {cell} is not that of its log in the record")
        if given_map := found.run.get("map"):
            unmade.setdefault(f"the run is on a given map, {given_map}", []).append(name)
        elif cell.log is None:
            unmade.setdefault(cell.unknown.rstrip("."), []).append(name)
        else:
            wanted[name] = cell.log, cell.known
    trusted, rounded = dict[str, TrustedLog](), list[str]()
    for name, ended in _made(wanted, executor, timeout_s):
        log, known = wanted[name]
        made(name)
        if ended.log is None:
            unmade.setdefault(ended.result.reason.rstrip("."), []).append(name)
            continue
        dataset = archive.unpacked(ended.log.archive)
        verdict, one = _judged(found, log, known, dataset)
        if one is None:
            wrong[name] = verdict
        elif name not in wrong:
            trusted[name] = one
            rounded += [name] * (verdict == "rounding")
    said = faults("logs", [f"{name}: {why}." for name, why in wrong.items()])
    if exact := len(trusted) - len(rounded):
        said.append(Finding("logs", HOLDS, f"{counted(exact, 'log')} made again here: the same digests."))
    if rounded:
        names = listed(rounded, NAMED)
        said.append(Finding("logs", HOLDS, f"The same but for rounding, as on another processor: {names}."))
    for why, names in unmade.items():
        said.append(Finding("logs", OPEN, f"{listed(list(dict.fromkeys(names)), NAMED)}: not made again, {why}."))
    return said, trusted


def _made(
    wanted: Mapping[str, tuple[OneLog, Known]], executor: Executor, timeout_s: float
) -> Iterator[tuple[str, Finished]]:
    """Makes each log once, whatever number of names it has; yields each name as its log is there."""
    names: dict[object, list[str]] = {}
    batches: dict[object, Batch] = {}
    for name, (log, _) in wanted.items():
        batch = Batch(log.dataset.name, log.dataset.options, log.seed, (), timeout_s, keep=True, whole=True)
        batches[batch.log] = batch
        names.setdefault(batch.log, []).append(name)
    with contextlib.closing(executor.run(list(batches.values()), alone=False)) as ended:
        for finished in ended:
            yield from ((name, finished) for name in names[finished.batch.log])


def _judged(found: ResultsFolder, log: OneLog, known: Known, made: Dataset) -> tuple[str, TrustedLog | None]:
    """Compares a log with the one made here: "" or "rounding" and what to trust, or what is wrong and None."""
    files, name = LogFiles(found.folder), log.dataset.name
    kept = files.read(name, known)
    entry = None if kept is None else files.entry(name, known)
    facts = facts_of(made)
    if facts.digests == (known.digest, known.truth_digest):
        return "", TrustedLog(made, entry)
    if facts.truth_kind != known.truth_kind:
        return f"its truth is of the kind {known.truth_kind!r}, made here {facts.truth_kind!r}", None
    truth = f"its truth has the digest {known.truth_digest[:12]}, made here {facts.truth_digest[:12]}"
    if facts.digest == known.digest:  # a batch optimum differs by rounding, a truth does not
        return ("rounding", TrustedLog(kept, entry)) if kept is not None and same(kept, made) else (truth, None)
    if log.dataset.source.portable:
        return f"its digest is {known.digest[:12]}, made here {facts.digest[:12]}", None
    if kept is None:
        return "its digest is not that of the log made here, and the folder has no copy of it in logs/", None
    apart = distance(sketch(kept.log), sketch(made.log))
    if apart > ROUNDING:
        return f"it is {apart:.2g} standard deviations from the log made here, expected {ROUNDING:g} at most", None
    if facts.truth_kind == "truth" and facts.truth_digest != known.truth_digest:
        return truth, None
    judged_by = kept.truth if facts.truth_kind == "reference" else made.truth
    return "rounding", TrustedLog(Dataset(kept.log, judged_by), entry)
