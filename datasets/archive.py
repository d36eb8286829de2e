"""Stores a prepared log in one .npz file, for workers, the cache and studies.

The arrays are restored bit for bit and read-only. The ground truth has members of its own, which `load_log` does not
read. Notes are stored as JSON: plain strings, numbers, lists and mappings.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from ..core.beside import KINDS, columns_of, names, restored
from ..core.errors import InputError
from ..core.factors import TABLES, Dataset, Log, Map, Prior, Systematic, Truth
from ..core.files import replaced
from ..core.relations import as_rows, from_rows

_LOG = tuple(
    field.name for field in fields(Log) if field.name not in ("name", "prior", "notes", "lines", *TABLES, *KINDS)
)
"""The columns that every log has."""

_OF_TRUTH = ("assigned", "moving", "relations", "false_loops", "assigned_partial")
"""Columns that a truth may lack."""

Members = Mapping[str, Any]
Words = Mapping[str, Any]
T = TypeVar("T")


def save(path: Path, dataset: Dataset) -> None:
    """Writes `dataset` to `path` atomically. OSError if that fails."""
    with replaced(path) as part, part.open("wb") as file:
        _pack(file, dataset)


def packed(dataset: Dataset) -> bytes:
    """The content of the file that `save` writes; deterministic."""
    content = BytesIO()
    _pack(content, dataset)
    return content.getvalue()


def _pack(file: IO[bytes], dataset: Dataset) -> None:
    """Writes the content to `file`, column by column."""
    log, truth = dataset
    members = {name: getattr(log, name) for name in _LOG}
    members |= {"prior.pose": log.prior.pose, "prior.cov": log.prior.cov} | _map_members("prior.map", log.prior.map)
    for name in TABLES:
        members |= {} if (table := getattr(log, name)) is None else table.columns
    if truth is not None:
        members |= {"truth.t": truth.t, "truth.poses": truth.poses} | _map_members("truth.map", truth.map)
        for name in _OF_TRUTH:
            if (column := getattr(truth, name)) is not None:
                members[f"truth.{name}"] = as_rows(column) if name == "relations" else column
    for kind in KINDS:
        if (beside := getattr(log, kind)) is not None:
            members |= {f"{kind}.{name}": column for name, column in columns_of(kind, beside).items()}
    about = None if truth is None else {"kind": truth.kind, "places": truth.places, "words": truth.words}
    words = {"name": log.name, "notes": dict(log.notes), "truth": about, "members": [*members]}
    words |= {} if log.prior.start == "known" else {"start": log.prior.start}
    words |= {} if log.prior.systematic == Systematic() else {"systematic": log.prior.systematic}
    members["words"] = np.frombuffer(json.dumps(words).encode(), np.uint8)
    np.savez(file, allow_pickle=False, **members)


def unpacked(content: bytes) -> Dataset:
    """Restores the log and ground truth that `packed` wrote; any exception at all where the content is damaged."""
    return _taken(BytesIO(content), _both)


def load(path: Path) -> Dataset:
    """Loads the log and ground truth that `save` wrote; InputError if the file is missing or damaged."""
    return _read(path, _both)


def load_log(path: Path) -> Log:
    """Loads the factors that `save` wrote, without the ground truth; InputError if the file is missing or damaged."""
    return _read(path, _log)


def _read(path: Path, take: Callable[[Members, Words], T]) -> T:
    try:
        with path.open("rb") as file:
            return _taken(file, take)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; expected a prepared log.") from None
    except Exception as error:  # a damaged zip file raises almost any exception
        raise InputError(f"{path}: not a prepared log, or damaged ({error!r}).") from error


def _taken(file: IO[bytes], take: Callable[[Members, Words], T]) -> T:
    with np.load(file, allow_pickle=False) as members:
        words = json.loads(members["words"].tobytes())
        if set(members.files) != {*words["members"], "words"}:
            raise ValueError("an optional member is missing")
        return take(members, words)


def _both(members: Members, words: Words) -> Dataset:
    log = _log(members, words)
    there = [kind for kind in KINDS if f"{kind}.step" in members]
    beside = {kind: {name: _frozen(members[f"{kind}.{name}"]) for name in names(kind)} for kind in there}
    log = replace(log, **{kind: restored(kind, columns) for kind, columns in beside.items()})
    return Dataset(log, _truth(members, words))


def _log(members: Members, words: Words) -> Log:
    given = _map(members, "prior.map")
    prior = Prior(
        _frozen(members["prior.pose"]),
        _frozen(members["prior.cov"]),
        given,
        words.get("start", "known"),
        systematic=Systematic(*words.get("systematic", ())),
    )
    tables: dict[str, Any] = {
        name: kind(*(_frozen(members[f"{name}.{column.name}"]) for column in fields(kind)))
        for name, kind in TABLES.items()
        if f"{name}.{fields(kind)[0].name}" in members
    }
    return Log(words["name"], prior, **{name: _frozen(members[name]) for name in _LOG}, notes=words["notes"], **tables)


def _truth(members: Members, words: Words) -> Truth | None:
    if words["truth"] is None:
        return None
    columns = {name: _frozen(members[f"truth.{name}"]) for name in _OF_TRUTH if f"truth.{name}" in members}
    columns |= {"relations": from_rows(columns["relations"])} if "relations" in columns else {}
    t, poses, known = _frozen(members["truth.t"]), _frozen(members["truth.poses"]), _map(members, "truth.map")
    return Truth(t, poses, known, **words["truth"], **columns)


def _map_members(name: str, known: Map | None) -> dict[str, Any]:
    if known is None:
        return {}
    members = {f"{name}.ids": known.ids, f"{name}.xy": known.xy}
    return members if known.cov is None else members | {f"{name}.cov": known.cov}


def _map(members: Members, name: str) -> Map | None:
    if f"{name}.ids" not in members:
        return None
    cov = _frozen(members[f"{name}.cov"]) if f"{name}.cov" in members else None
    return Map(_frozen(members[f"{name}.ids"]), _frozen(members[f"{name}.xy"]), cov)


def _frozen(column: np.ndarray[Any, Any]) -> Any:
    column.flags.writeable = False
    return column
