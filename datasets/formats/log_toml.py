"""log.toml, the part of a log's folder that is words: its name, its prior, the kind of its truth and its notes.

And, where slamduel wrote it, what the other files contained: how many rows each, and the digests of the factors and of
the truth. It is how a file that has lost its end or had a bit turned is told from the one that was written.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import tomli_w

from ...frontend.errors import InputError
from ...frontend.factors import Log, Map, Prior
from ...frontend.scan import Scan
from ...frontend.se2 import Array
from ...frontend.table import text

FILES = ("odometry.csv", "sightings.csv", "loops.csv", "truth.tum", "landmarks.csv")


class Contents(NamedTuple):
    """What the files beside a log.toml contained when it was written; nothing of it need be known."""

    rows: Mapping[str, int] = {}  # of FILES
    factors: str | None = None  # Log.digest
    truth: str | None = None  # the digest of the truth


class Words(NamedTuple):
    """What a log.toml says."""

    name: str
    prior: Prior
    truth_kind: Literal["truth", "reference"] | None
    notes: Mapping[str, Any]
    contents: Contents


def check_words(log: Log) -> None:
    """InputError where the name or the notes of `log` are no words that a log.toml can hold."""
    name: Any = log.name
    if not isinstance(name, str) or not _encodable(name):
        raise InputError(f"log {_short(name)}: found this name, expected a text that UTF-8 can hold.")
    try:
        held = _encodable(tomli_w.dumps(_notes(log)))
    except (TypeError, ValueError, AttributeError, RecursionError):
        held = False
    if not held:
        raise InputError(f"log {name}: its notes cannot be written, expected texts, numbers, lists and tables.")


def _encodable(words: str) -> bool:
    try:
        words.encode()
    except UnicodeEncodeError:
        return False
    return True


def _notes(log: Log) -> dict[str, Any]:
    return {key: note for key, note in log.notes.items() if note is not None}


def write_words(path: Path, log: Log, truth_kind: str | None, contents: Contents) -> None:
    """Write the words of `log`; notes that are None are left out."""
    prior: dict[str, Any] = {"pose": log.prior.pose.tolist(), "cov": log.prior.cov.tolist()}
    if log.prior.map is not None:
        ids, xy, cov = log.prior.map
        prior["map"] = {"ids": ids.tolist(), "xy": xy.tolist()} | ({} if cov is None else {"cov": cov.tolist()})
    truth = {} if truth_kind is None else {"truth": {"kind": truth_kind}}
    digests = {key: digest for key in ("factors", "truth") if (digest := getattr(contents, key)) is not None}
    # What the files contained comes first: when the end of this one is lost, that is told from a shorter log.
    contained = {"contents": {**digests, "rows": dict(contents.rows)}}
    words = {"name": log.name, **contained, "prior": prior, **truth, "notes": _notes(log)}
    path.write_text(tomli_w.dumps(words), encoding="utf-8", newline="\n")


def scan_words(path: Path) -> Scan[Words]:
    """The words in `path`; a fault names the key, what was found and what was expected."""
    try:
        words = tomllib.loads(text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid TOML: {error}.") from error
    yield from _only(path, "the file", words, ("name", "prior", "truth", "contents", "notes"))
    name = words.get("name")
    if not isinstance(name, str):
        yield InputError(f"{path}: name is {name!r}, expected a text in quotes.")
    notes = yield from _section(path, "notes", words.get("notes", {}), None)
    prior = yield from _scan_prior(path, words.get("prior"))
    kind = (yield from _section(path, "truth", words.get("truth", {}), ("kind",))).get("kind")
    if kind not in (None, "truth", "reference"):
        yield InputError(f"{path}: truth.kind is {kind!r}, expected 'truth' or 'reference'.")
    contents = yield from _scan_contents(path, words.get("contents", {}))
    return Words(str(name), prior, kind, notes, contents)


def _scan_prior(path: Path, found: Any) -> Scan[Prior]:
    """The prior; in place of what is no good, anything that is."""
    nowhere = Prior(np.zeros(3), np.eye(3))
    given = yield from _section(path, "prior", found, ("pose", "cov", "map"))
    if not isinstance(found, dict):
        return nowhere
    pose = yield from _numbers(path, "prior.pose", given.get("pose"), 3)
    cov = yield from _numbers(path, "prior.cov", given.get("cov"), 3, 3)
    known = (yield from _scan_map(path, given["map"])) if "map" in given else None
    return Prior(nowhere.pose if pose is None else pose, nowhere.cov if cov is None else cov, known)


def _scan_map(path: Path, found: Any) -> Scan[Map | None]:
    """The map of the prior; None if it is no good."""
    known = yield from _section(path, "prior.map", found, ("ids", "xy", "cov"))
    ids = known.get("ids")
    if not isinstance(ids, list) or not all(type(one) is int and abs(one) < 2**63 for one in ids):
        yield InputError(f"{path}: prior.map.ids is {_short(ids)}, expected a list of whole numbers.")
        return None
    n = len(ids)
    cov = (yield from _numbers(path, "prior.map.cov", known["cov"], 2 * n, 2 * n)) if "cov" in known else None
    xy = yield from _numbers(path, "prior.map.xy", known.get("xy"), n, 2)
    return None if xy is None else Map(np.array(ids, np.int64), xy, cov)


def _scan_contents(path: Path, found: Any) -> Scan[Contents]:
    """What the other files contained, as far as it is told."""
    given = yield from _section(path, "contents", found, ("factors", "truth", "rows"))
    rows = yield from _section(path, "contents.rows", given.get("rows", {}), FILES)
    for file, count in rows.items():
        if type(count) is not int or count < 0:
            yield InputError(f"{path}: contents.rows has {_short(count)} for {file}, expected a number of rows.")
    for key in ("factors", "truth"):
        if not isinstance(given.get(key, ""), str):
            yield InputError(f"{path}: contents.{key} is {_short(given[key])}, expected a digest in quotes.")
    return Contents(rows, given.get("factors"), given.get("truth"))


def _section(path: Path, name: str, found: Any, keys: tuple[str, ...] | None) -> Scan[dict[str, Any]]:
    """`found` as a table that has none but `keys`, if these are given; an empty one if it is none."""
    if not isinstance(found, dict):
        yield InputError(f"{path}: {name} is {_short(found)}, expected a table [{name}].")
        return {}
    if keys is not None:
        yield from _only(path, name, found, keys)
    return found


def _only(path: Path, name: str, found: Mapping[str, Any], keys: tuple[str, ...]) -> Scan[None]:
    for key in found:
        if key not in keys:
            yield InputError(f"{path}: {name} has {_short(key)}, expected none but {', '.join(keys)}.")


def _numbers(path: Path, name: str, found: Any, *shape: int) -> Scan[Array | None]:
    """`found` as an array of that shape; None if it is none."""
    try:
        numbers = np.array(found, float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full((), np.nan)
    if numbers.size == 0 == np.prod(shape):
        return np.zeros(shape)
    if numbers.shape != shape:
        yield InputError(f"{path}: {name} is {_short(found)}, expected {' x '.join(map(str, shape))} numbers.")
        return None
    return numbers


def _short(found: Any) -> str:
    """What was found, on a line that one can read."""
    shown = repr(found)
    return shown if len(shown) <= 100 else f"{shown[:60]} ... {shown[-30:]}"
