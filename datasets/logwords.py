"""log.toml, the part of a log's folder that is words: its name, its prior, the kind of its truth and its notes."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import tomli_w

from ..frontend.errors import InputError
from ..frontend.factors import Log, Map, Prior
from ..frontend.se2 import Array
from ..frontend.table import text


class Words(NamedTuple):
    """What a log.toml says."""

    name: str
    prior: Prior
    truth_kind: Literal["truth", "reference"] | None
    notes: Mapping[str, Any]


def write_words(path: Path, log: Log, truth_kind: str | None) -> None:
    """Write the words of `log`; notes that are None are left out."""
    prior: dict[str, Any] = {"pose": log.prior.pose.tolist(), "cov": log.prior.cov.tolist()}
    if log.prior.map is not None:
        ids, xy, cov = log.prior.map
        prior["map"] = {"ids": ids.tolist(), "xy": xy.tolist()} | ({} if cov is None else {"cov": cov.tolist()})
    truth = {} if truth_kind is None else {"truth": {"kind": truth_kind}}
    notes = {key: note for key, note in log.notes.items() if note is not None}
    words = {"name": log.name, "prior": prior, **truth, "notes": notes}
    path.write_text(tomli_w.dumps(words), encoding="utf-8", newline="\n")


def read_words(path: Path) -> Words:
    """The words in `path`; InputError names the key, what was found and what was expected."""
    try:
        words = tomllib.loads(text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid TOML: {error}.") from error
    _only(path, "the file", words, ("name", "prior", "truth", "notes"))
    name = words.get("name")
    if not isinstance(name, str):
        raise InputError(f"{path}: name is {name!r}, expected a text in quotes.")
    prior = _section(path, "prior", words.get("prior"), ("pose", "cov", "map"))
    kind = _section(path, "truth", words.get("truth", {}), ("kind",)).get("kind")
    if kind not in (None, "truth", "reference"):
        raise InputError(f"{path}: truth.kind is {kind!r}, expected 'truth' or 'reference'.")
    notes = _section(path, "notes", words.get("notes", {}), None)
    pose = _numbers(path, "prior.pose", prior.get("pose"), 3)
    return Words(name, Prior(pose, _numbers(path, "prior.cov", prior.get("cov"), 3, 3), _map(path, prior)), kind, notes)


def _map(path: Path, prior: Mapping[str, Any]) -> Map | None:
    if "map" not in prior:
        return None
    known = _section(path, "prior.map", prior["map"], ("ids", "xy", "cov"))
    ids = known.get("ids")
    if not isinstance(ids, list) or not all(type(one) is int and abs(one) < 2**63 for one in ids):
        raise InputError(f"{path}: prior.map.ids is {ids!r}, expected a list of whole numbers.")
    n = len(ids)
    cov = _numbers(path, "prior.map.cov", known["cov"], 2 * n, 2 * n) if "cov" in known else None
    return Map(np.array(ids, np.int64), _numbers(path, "prior.map.xy", known.get("xy"), n, 2), cov)


def _section(path: Path, name: str, found: Any, keys: tuple[str, ...] | None) -> dict[str, Any]:
    """`found` as a table that has none but `keys`, if these are given."""
    if not isinstance(found, dict):
        raise InputError(f"{path}: {name} is {found!r}, expected a table [{name}].")
    if keys is not None:
        _only(path, name, found, keys)
    return found


def _only(path: Path, name: str, found: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    for key in found:
        if key not in keys:
            raise InputError(f"{path}: {name} has {key!r}, expected none but {', '.join(keys)}.")


def _numbers(path: Path, name: str, found: Any, *shape: int) -> Array:
    """`found` as an array of that shape."""
    try:
        numbers = np.array(found, float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full((), np.nan)
    if numbers.size == 0 == np.prod(shape):
        return np.zeros(shape)
    if numbers.shape != shape:
        raise InputError(f"{path}: {name} is {found!r}, expected {' x '.join(map(str, shape))} numbers.")
    return numbers
