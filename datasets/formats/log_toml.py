"""Reads and writes log.toml, the metadata of a log's folder: name, prior, kind of ground truth, notes.

When written by slamduel, it also has the row counts of the other files and the digests of factors and ground truth, to
detect truncated or damaged files.
"""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, ParamSpec, TypeVar

import numpy as np
import tomli_w

from ...core.errors import InputError
from ...core.factors import STARTS, Log, Map, Prior, Systematic
from ...core.gyro import Bias
from ...core.mounting import NONE, Mounting
from ...core.scan import Scan, attempted
from ...core.toml.table import LARGEST, TomlTable

T = TypeVar("T")
P = ParamSpec("P")

FILES = (
    "odometry.csv", "sightings.csv", "loops.csv", "ranges.csv", "bearings.csv", "fixes.csv", "gyro.csv",
    "signatures.csv", "truth.tum", "landmarks.csv", "relations.csv",
)  # fmt: skip

BIAS = ("bias", "bias_sd")  # rad/s, of the table gyro

NOWHERE = Prior(np.zeros(3), np.eye(3))  # replaces an unreadable prior

LARGEST_FLOAT = sys.float_info.max


class Contents(NamedTuple):
    """Contents of the files beside a log.toml at the time of writing; each may be unknown."""

    rows: Mapping[str, int] = {}  # of FILES
    factors: str | None = None  # Log.digest
    truth: str | None = None  # the digest of the ground truth


class Words(NamedTuple):
    """The content of a log.toml."""

    file: TomlTable
    name: str
    prior: Prior
    truth_kind: Literal["truth", "reference", "relations"] | None
    notes: Mapping[str, Any]
    contents: Contents
    sensor: Mounting


def check_words(log: Log) -> None:
    """Raises InputError if the name or the notes of `log` cannot be stored in a log.toml."""
    name: Any = log.name
    if not isinstance(name, str) or not _encodable(name):
        raise InputError(f"log {name!r:.100}: found this name, expected a string that UTF-8 can encode.")
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
    """Writes the metadata of `log`; notes that are None are left out."""
    prior: dict[str, Any] = {"pose": log.prior.pose.tolist(), "cov": log.prior.cov.tolist()}
    if log.prior.map is not None:
        ids, xy, cov = log.prior.map
        prior["map"] = {"ids": ids.tolist(), "xy": xy.tolist()} | ({} if cov is None else {"cov": cov.tolist()})
    prior |= {} if log.prior.start == "known" else {"start": log.prior.start}
    constant = log.prior.systematic
    stated = {name: sd for name, sd in constant._asdict().items() if name != "wheel_scale" or sd}
    known = {} if constant == Systematic() else {"systematic": stated}
    known |= {} if log.gyro is None else {"gyro": dict(zip(BIAS, log.gyro.prior, strict=True))}
    truth = {} if truth_kind is None else {"truth": {"kind": truth_kind}}
    digests = {key: digest for key in ("factors", "truth") if (digest := getattr(contents, key)) is not None}
    # First the files' contents: if the end of this file is lost, that can be told from a shorter log.
    contained = {"contents": {**digests, "rows": dict(contents.rows)}}
    words = {"name": log.name, **contained, "prior": prior, **known, **truth, "notes": _notes(log)}
    path.write_text(tomli_w.dumps(words), encoding="utf-8", newline="\n")


def scan_words(path: Path) -> Scan[Words]:
    """Scans the metadata in `path`; a fault names the line and the key, what was found and what was expected."""
    file = TomlTable.read(path)
    yield from file.unknown(("name", "prior", "systematic", "gyro", "truth", "contents", "notes", "sensor"))
    name = yield from _tried(_name, file)
    notes = yield from _tried(file.table, "notes")
    prior = yield from attempted(_scan_prior(file))
    prior = (prior or NOWHERE)._replace(systematic=(yield from attempted(_scan_systematic(file))) or Systematic())
    prior = prior._replace(gyro=(yield from attempted(_scan_gyro(file))))
    kind = yield from _tried(_truth_kind, file)
    contents = yield from attempted(_scan_contents(file))
    sensor = yield from attempted(_scan_sensor(file))
    found = {} if notes is None else notes.entries
    return Words(file, name or "", prior, kind, found, contents or Contents(), sensor or NONE)


def _name(file: TomlTable) -> str:
    file.given("name", "a text in quotes")
    return file.text("name", "")


def _truth_kind(file: TomlTable) -> Literal["truth", "reference", "relations"] | None:
    return file.table("truth").only(("kind",)).choice("kind", None, ("truth", "reference", "relations"))


def _scan_prior(file: TomlTable) -> Scan[Prior]:
    """The prior; `NOWHERE` in place of an invalid one."""
    given = file.table("prior")
    yield from given.unknown(("pose", "cov", "map", "start"))
    pose = yield from _tried(given.numbers, "pose", 3, most=LARGEST_FLOAT)
    cov = yield from _tried(given.numbers, "cov", 3, 3, most=LARGEST_FLOAT)
    known = (yield from _scan_map(given.table("map"))) if given.has("map") else None
    start = (yield from _tried(given.choice, "start", None, STARTS)) or "known"
    return NOWHERE if pose is None or cov is None else Prior(pose, cov, known, start)  # ty: ignore[invalid-argument-type]


def _scan_map(known: TomlTable) -> Scan[Map | None]:
    """Scans the map of the prior: None if its places are unreadable; InputError for invalid ids."""
    yield from known.unknown(("ids", "xy", "cov"))
    ids = known.given("ids", "a list of whole numbers")
    if not isinstance(ids, list) or not all(type(one) is int and abs(one) <= LARGEST for one in ids):
        raise known.fault("ids", "a list of whole numbers")
    n, most = len(ids), LARGEST_FLOAT
    cov = (yield from _tried(known.numbers, "cov", 2 * n, 2 * n, most=most)) if known.has("cov") else None
    xy = yield from _tried(known.numbers, "xy", n, 2, most=most)
    return None if xy is None else Map(np.array(ids, np.int64), xy, cov)


def _scan_sensor(file: TomlTable) -> Scan[Mounting]:
    """The place of the sensor of the sightings, and how late it is."""
    given = file.table("sensor")
    yield from given.unknown(Mounting._fields)
    values = dict[str, float]()
    for name in given.entries:
        if name in Mounting._fields:
            values[name] = (yield from _tried(given.number, name)) or 0.0
    if abs(values.get("yaw", 0.0)) > np.pi:
        yield given.fault("yaw", "radians from -pi to pi")
    return Mounting(**values)


def _scan_systematic(file: TomlTable) -> Scan[Systematic]:
    """The standard deviations of constant errors."""
    given = file.table("systematic")
    yield from given.unknown(Systematic._fields)
    sds = dict[str, float]()
    for name in Systematic._fields:
        if name == "each":
            continue
        sds[name] = (yield from _tried(given.number, name, 0.0, least=0.0)) or 0.0
    return Systematic(**sds, each=bool((yield from _tried(given.switch, "each", False))))


def _scan_gyro(file: TomlTable) -> Scan[Bias]:
    """The belief about a gyro's bias; zero where there is none."""
    given = file.table("gyro")
    yield from given.unknown(BIAS)
    mean = (yield from _tried(given.number, BIAS[0], 0.0)) or 0.0
    return Bias(mean, (yield from _tried(given.number, BIAS[1], 0.0, least=0.0)) or 0.0)


def _scan_contents(file: TomlTable) -> Scan[Contents]:
    """The contents of the other files, as far as they are given."""
    given = file.table("contents")
    yield from given.unknown(("factors", "truth", "rows"))
    rows, counts = given.table("rows"), dict[str, int]()
    yield from rows.unknown(FILES)
    for name in rows.entries:
        counts[name] = (yield from _tried(rows.whole, name, 0, 0)) or 0
    factors = yield from _tried(given.text, "factors", "")
    truth = yield from _tried(given.text, "truth", "")
    return Contents(counts, factors or None, truth or None)


def _tried(read: Callable[P, T], *args: P.args, **options: P.kwargs) -> Scan[T | None]:
    """Returns the result of `read`; None where it raises an error, which is a fault."""
    try:
        return read(*args, **options)
    except InputError as error:
        fault = error
    yield fault
    return None
