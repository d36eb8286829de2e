"""Pairs two runs: common cells and logs, and differences in how the runs were made."""

from collections.abc import Container, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from ..record.schema import Row
from ..record.sketch import ROUNDING, distance, from_words
from ..record.store import Store
from ..words.numerals import counted, listed
from .summary import Line, lines

MACHINE = ("processor", "cores", "memory_gb")
NOT_COMPARED = ("packages", "backend", "dataset", "seeds", "logs", "map_digest")  # may differ
MEMORY = 0.02  # share by which the memory that a machine's kernel reports may differ

BETWEEN_PROCESSORS = 1e-6
"""Share by which a result may differ between processors and still be the same. Last bits depend on instructions; the
path of a stable filter differs by 1e-12 or so in the end, that of a stopped iteration by more."""


class Side(NamedTuple):
    """One of the two runs."""

    folder: Path
    run: Mapping[str, Any]
    lines: Mapping[tuple[str, str], Line]  # by dataset and backend


class Pair(NamedTuple):
    """A backend on a dataset in both runs: cells of the same seed and, but for rounding, the same log."""

    dataset: str
    backend: str
    cells: Sequence[tuple[Row, Row]]  # old and new
    measured: Sequence[tuple[Row, Row]]  # those measured from the same truth
    timed: bool  # the times of both may be compared
    random: bool  # the backend is random, or may be
    by_log: bool  # both had the same logs, to the last bit


class PairedRuns(NamedTuple):
    """Two runs, paired."""

    old: Side
    new: Side
    pairs: Sequence[Pair]
    added: Sequence[tuple[str, str]]  # datasets and backends that only the new run has
    gone: Sequence[tuple[str, str]]
    differences: Sequence[tuple[str, str, str]]  # what, in the old run, in the new one
    notes: Sequence[str]  # sentences on what was left out, or needs caution
    rounding: float  # share by which results may differ and be the same; 0 between runs of one processor


def side(folder: Path) -> Side:
    """Reads a run's folder; InputError where it is none."""
    with Store(folder) as store:
        found = {(line.dataset, line.backend): line for line in lines(store.cells())}
        return Side(folder, store.run(), found)


def paired_runs(old: Side, new: Side, *, any_machine: bool = False, any_log: bool = False) -> PairedRuns:
    """Pairs the two runs' cells; InputError where they have none in common."""
    notes: list[str] = []
    common = [key for key in new.lines if key in old.lines]
    if not common:
        raise InputError(f"{new.folder}: has no backend on any dataset in common with {old.folder}, expected one.")
    timed = any_machine or _timed(old, new, notes)
    others, truths = _other_logs(old, new, common), _other_truths(old, new, common)
    close = {log: apart for log in others if (apart := _apart(old, new, log)) <= ROUNDING}
    others = [log for log in others if log not in close]
    pairs = [_pair(old, new, key, timed, any_machine, any_log, close) for key in common]
    rounding = BETWEEN_PROCESSORS if close or not one_processor(old.run, new.run) else 0.0
    if close:
        notes.append(
            f"{_listed(list(close))}: the logs of the two runs differ by no more than rounding and are compared. All "
            "differences of two such logs, each in units of its own standard deviation, have a root sum of squares of "
            f"at most {max(close.values()):.1g}; up to {ROUNDING:g} counts as rounding."
        )
    if not one_processor(old.run, new.run):
        notes.append(
            "The runs were made on different processors, whose arithmetic differs in last bits: results within one "
            "part in a million of each other count as the same."
        )
    elif close:
        notes.append("On such logs, results within one part in a million of each other count as the same.")
    if others and any_log:
        notes.append(f"{_listed(others)}: not the same log in both runs, compared by seed as --any-log says.")
    elif others:
        notes.append(f"{_listed(others)}: not the same log in both runs, and left out; --any-log compares by seed.")
    if truths:
        notes.append(f"{_listed(truths)}: the truth has changed, so accuracy and consistency are left out.")
    notes += _not_run(pairs, old, new)
    for pair in () if any_machine else pairs:
        if any(a.columns["timing_alone"] != b.columns["timing_alone"] for a, b in pair.cells):
            notes.append(f"{pair.backend} on {pair.dataset}: timed side by side with other cells in one run alone.")
    if not any(pair.cells for pair in pairs):
        raise InputError(f"{new.folder}: no cell ran on the same log as in {old.folder}; --any-log compares by seed.")
    added = [key for key in new.lines if key not in old.lines]
    removed = [key for key in old.lines if key not in new.lines]
    return PairedRuns(old, new, pairs, added, removed, _differences(old.run, new.run), notes, rounding)


def _timed(old: Side, new: Side, notes: list[str]) -> bool:
    """True if both ran on the same machine; a note says if not."""
    machines = [{name: one.run["environment"].get(name) for name in MACHINE} for one in (old, new)]
    if one_machine(old.run, new.run):
        return True
    said = [
        f"{_text(m['processor'])}{_instructions(one)}, {_text(m['cores'])} cores, {_text(m['memory_gb'])} GB"
        for one, m in zip((old, new), machines, strict=True)
    ]
    notes.append(
        f"The runs were made on different machines ({said[0]}; {said[1]}), so times and memory are left out; "
        "--any-machine compares them anyway."
    )
    return False


def one_machine(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """True if both runs were made on machines whose times can be compared."""
    machines = [{name: run["environment"].get(name) for name in MACHINE} for run in (old, new)]
    return _same_machine(*machines) and one_processor(old, new)


def _instructions(one: Side) -> str:
    """Lists the instruction sets: in virtual machines many processors share a name."""
    known = one.run["environment"].get("instructions")
    return f" ({known})" if known else ""


def _same_machine(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    if None in old.values() or old["processor"] != new["processor"] or old["cores"] != new["cores"]:
        return False
    try:
        return abs(old["memory_gb"] - new["memory_gb"]) <= MEMORY * old["memory_gb"]
    except TypeError:
        return False


def one_processor(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """True if both ran on processors of one name and, where both runs record them, the same instructions."""
    here, there = old["environment"], new["environment"]
    known = [name for name in ("processor", "instructions") if name in here and name in there]
    return all(here[name] == there[name] for name in known)


def _apart(old: Side, new: Side, log: str) -> float:
    """The distance of a log between the two runs, in standard deviations; infinite where unknown."""
    sketches = [from_words(one.run.get("sketches", {}).get(log)) for one in (old, new)]
    here, there = sketches
    return inf if here is None or there is None else distance(here, there)


def _pair(
    old: Side, new: Side, key: tuple[str, str], timed: bool, any_machine: bool, any_log: bool, close: Container[str]
) -> Pair:
    before = {row.columns["seed"]: row for row in old.lines[key].rows}
    cells = [(before[row.columns["seed"]], row) for row in new.lines[key].rows if row.columns["seed"] in before]
    equal = [(a, b) for a, b in cells if a.columns["digest"] == b.columns["digest"]]
    alike = [(a, b) for a, b in cells if (a, b) in equal or _name(key, b) in close]
    chosen = cells if any_log else alike
    other = _other_truths(old, new, [key])
    alone = {(a.columns["timing_alone"], b.columns["timing_alone"]) for a, b in chosen}
    random: Any = new.run.get("random")
    return Pair(
        dataset=key[0],
        backend=key[1],
        cells=chosen,
        measured=[(a, b) for a, b in chosen if _name(key, b) not in other],
        timed=timed and (any_machine or all(a == b for a, b in alone)),
        random=random is None or key[1] in random,
        by_log=len(chosen) == len(equal),
    )


def _name(key: tuple[str, str], row: Row) -> str:
    return f"{key[0]}, seed {row.columns['seed']}"


def _other_logs(old: Side, new: Side, common: Sequence[tuple[str, str]]) -> list[str]:
    """Lists the logs of the same name and seed that differ."""
    found: dict[str, None] = {}
    for key in common:
        before = {row.columns["seed"]: row.columns["digest"] for row in old.lines[key].rows}
        for row in new.lines[key].rows:
            if before.get(row.columns["seed"], row.columns["digest"]) != row.columns["digest"]:
                found[_name(key, row)] = None
    return list(found)


def _other_truths(old: Side, new: Side, common: Sequence[tuple[str, str]]) -> list[str]:
    """Lists the logs whose truth differs, or is a reference in one of the runs alone."""
    before: Mapping[str, Any] = old.run.get("truths", {})
    after: Mapping[str, Any] = new.run.get("truths", {})
    found = {log: None for log in after if log in before and before[log] != after[log]}
    for key in common:
        kinds = {row.columns["seed"]: row.columns["truth_kind"] for row in old.lines[key].rows}
        for row in new.lines[key].rows:
            kind = row.columns["truth_kind"]
            if kinds.get(row.columns["seed"], kind) != kind:
                found[_name(key, row)] = None
    return list(found)


def _not_run(pairs: Sequence[Pair], old: Side, new: Side) -> list[str]:
    said: list[str] = []
    for pair in pairs:
        key = pair.dataset, pair.backend
        seeds = [{row.columns["seed"] for row in one.lines[key].rows} for one in (old, new)]
        for missing, word in ((seeds[0] - seeds[1], "old"), (seeds[1] - seeds[0], "new")):
            if missing:
                said.append(
                    f"{pair.backend} on {pair.dataset}: {counted(len(missing), 'seed')} only in the {word} run."
                )
    return said


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    known = [
        {**run["environment"], **run["environment"]["packages"], **run.get("plan", {}), "workers": run["workers"]}
        for run in (old, new)
    ]
    names = [name for name in {**known[0], **known[1]} if name not in NOT_COMPARED]
    values = [(name, _text(known[0].get(name)), _text(known[1].get(name))) for name in names]
    return [(name, before, after) for name, before, after in values if before != after]


def _text(value: Any) -> str:
    return "none" if value is None else str(value)


def _listed(names: Sequence[str]) -> str:
    return listed(names, 4)
