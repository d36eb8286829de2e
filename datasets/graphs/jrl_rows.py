"""Reads the rows of a JSON Robot Log: its factors, its true values and its outliers, with their places for errors."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, SupportsIndex

import numpy as np

from ...core.csv_values import shortened
from ...core.errors import InputError
from ...core.se2 import Ints
from ...core.table import LARGEST, MOST, Table, text
from ..formats.symbols import BITS
from ..formats.tagged import LENGTHS

PRIOR, BETWEEN, SIGHTING, RANGES = "PriorFactorPose2", "BetweenFactorPose2", "BearingRangeFactor2D", "RangeFactor2D"
POSE, POINT = "Pose2", "Point2"

_MOST_A_STEP = 10**6  # measurements of an entry: where one stands is a number
_NINE = tuple(f"c{i}{j}" for i in "123" for j in "123")
_FOUR = ("c11", "c12", "c21", "c22")
COLUMNS = {
    PRIOR: ("id", "x", "y", "theta", *_NINE),
    BETWEEN: ("from", "to", "dx", "dy", "dtheta", *_NINE),
    SIGHTING: ("pose", "id", "bearing", "range", *_FOUR),
    RANGES: ("pose", "id", "range", "c11"),
    POSE: ("id", "x", "y", "theta"),
    POINT: ("id", "x", "y"),
}
_POINTS = (SIGHTING, RANGES, POINT)  # their id is a landmark's


class Placed(Table):
    """Rows of a JSON file, whose `lines` are places: the entry times _MOST_A_STEP, plus the measurement."""

    def fault(self, row: SupportsIndex, message: str) -> InputError:
        """The error `message` about `row`."""
        return InputError(f"{self.path}, {_said(int(self.lines[row]))}: {message}.")

    def take(self, rows: Ints) -> "Placed":
        """The given rows, in that order."""
        return Placed(self.path, self.columns, self.rows[rows], self.lines[rows])


class Values(Table):
    """Rows of a list of values."""

    def fault(self, row: SupportsIndex, message: str) -> InputError:
        """The error `message` about `row`."""
        return InputError(f"{self.path}, value {self.lines[row]} of the truth: {message}.")


class _Where(NamedTuple):
    """Something in the file, and how it is called."""

    path: Path
    words: str

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.path}, {self.words}: {message}.")


def read_content(path: Path) -> dict[str, Any]:
    """The JSON object in the file `path`; InputError for anything else."""
    try:
        content = json.loads(text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({' '.join(str(error).split()).rstrip('.')}).") from None
    if not isinstance(content, dict) or not isinstance(content.get("measurements"), dict):
        raise InputError(f"{path}: found no object of measurements, expected a JSON Robot Log.")
    return content


def robot_of(path: Path, content: Mapping[str, Any]) -> str:
    """The one robot that has measurements."""
    robots = [name for name, entries in content["measurements"].items() if entries]
    if len(robots) != 1:
        raise InputError(f"{path}: found measurements of {len(robots)} robots, expected those of one.")
    return robots[0]


def factors_of(path: Path, entries: Any, letters: dict[str, int]) -> dict[str, Placed]:
    """The rows of each kind of factor, in the order of the file."""
    rows = {kind: list[list[float]]() for kind in (PRIOR, BETWEEN, SIGHTING, RANGES)}
    lines = {kind: list[int]() for kind in rows}
    for place, where, factor in _measurements(path, entries):
        kind = factor.get("type")
        if kind not in rows:
            known = ", ".join(rows)
            raise where.fault(f"found a {shortened(str(kind))}{_why(str(kind))}, expected one of {known}")
        rows[kind].append(_factor(where, kind, factor, letters))
        lines[kind].append(place)
    found = dict[str, Placed]()
    for kind, numbers in rows.items():
        columns = COLUMNS[kind]
        table = Placed(path, columns, np.array(numbers).reshape(-1, len(columns)), np.array(lines[kind], np.int64))
        table.finite()
        table.bounded(-LARGEST, LARGEST, *(name for name in columns if name in LENGTHS))
        found[kind] = table
    return found


def _measurements(path: Path, entries: Any) -> Iterator[tuple[int, _Where, Mapping[str, Any]]]:
    """Every measurement with its place."""
    if not isinstance(entries, list):
        raise InputError(f"{path}: the measurements of a robot are no list, expected one of entries.")
    for number, entry in enumerate(entries):
        where = _Where(path, f"entry {number}")
        if not isinstance(entry, dict) or not isinstance(found := entry.get("measurements", []), list):
            raise where.fault("found no list of measurements, expected one")
        for k, factor in enumerate(found):
            place = number * _MOST_A_STEP + k
            where = _Where(path, _said(place))
            if not isinstance(factor, dict):
                raise where.fault("found no object, expected a measurement with a type")
            yield place, where, factor


def _said(place: int) -> str:
    return f"entry {place // _MOST_A_STEP}, measurement {place % _MOST_A_STEP}"


def _why(kind: str) -> str:
    if kind.endswith(("3", "3D")):
        return ", in space"
    if kind.startswith("RangeFactor"):
        return ", a range between poses or of a sensor elsewhere, which a log has no place for"
    return ", a prior of a landmark, which a log has no place for" if kind == "PriorFactorPoint2" else ""


def _factor(where: _Where, kind: str, factor: Mapping[str, Any], letters: dict[str, int]) -> list[float]:
    """The numbers of a factor."""
    if kind == PRIOR:
        ends = [_key(where, factor.get("key"), "poses", letters)]
        value, names = factor.get("prior"), ("x", "y", "theta")
    else:
        second = "landmarks" if kind in _POINTS else "poses"
        ends = [_key(where, factor.get("key1"), "poses", letters), _key(where, factor.get("key2"), second, letters)]
        value = factor.get("measurement")
        names = ("x", "y", "theta") if kind == BETWEEN else ("bearing", "range")
    if kind == RANGES:
        names, value = ("range",), {"range": value}
    if not isinstance(value, dict):
        raise where.fault("found no object of what was measured, expected one")
    size = len(names) ** 2
    cov = factor.get("covariance")
    if not isinstance(cov, list) or len(cov) != size:
        raise where.fault(f"found no covariance of {size} numbers, expected one")
    return [
        *ends,
        *(_number(where, name, value.get(name)) for name in names),
        *(_number(where, "a covariance's entry", one) for one in cov),
    ]


def _number(where: _Where, name: str, value: Any) -> float:
    """A number, also in the object that JRL has for a rotation or a scalar."""
    if isinstance(value, dict):
        value = value.get("theta", value.get("value"))
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise where.fault(f"{name} is {shortened(str(value))}, expected a number")
    try:
        return float(value)
    except OverflowError:
        raise where.fault(f"{name} is too large, expected a finite number") from None


def _key(where: _Where, key: Any, what: str, letters: dict[str, int]) -> float:
    """The number of a symbol; InputError for another letter than that of the others."""
    if isinstance(key, bool) or not isinstance(key, int) or not 0 <= key < 2**64 or key & (2**BITS - 1) > MOST:
        raise where.fault(f"found the key {shortened(str(key))}, expected a symbol of GTSAM")
    letter = key >> BITS
    if letters.setdefault(what, letter) != letter:
        raise where.fault(f"found the letter {chr(letter)!r} beside {chr(letters[what])!r}, expected one of all {what}")
    return float(key & (2**BITS - 1))


def truth_of(path: Path, content: Mapping[str, Any], robot: str, letters: dict[str, int]) -> dict[str, Values]:
    """The true poses and landmarks; those under other letters than the log's are left out."""
    rows, lines = {kind: list[list[float]]() for kind in (POSE, POINT)}, {kind: list[int]() for kind in (POSE, POINT)}
    for number, value in enumerate(_listed(path, _of_robot(content.get("groundtruth"), robot))):
        where = _Where(path, f"value {number} of the truth")
        kind = value.get("type") if isinstance(value, dict) else None
        if kind not in rows:
            raise where.fault(f"found a {shortened(str(kind))}, expected a {POSE} or a {POINT}")
        what, names = ("poses", ("x", "y", "theta")) if kind == POSE else ("landmarks", ("x", "y"))
        key = value.get("key")
        letter = key >> BITS if isinstance(key, int) else None
        if letters.get(what, letter) == letter:
            one = _key(where, key, what, letters)
            rows[kind].append([one, *(_number(where, name, value.get(name)) for name in names)])
            lines[kind].append(number)
    found = dict[str, Values]()
    for kind, numbers in rows.items():
        columns = COLUMNS[kind]
        table = Values(path, columns, np.array(numbers).reshape(-1, len(columns)), np.array(lines[kind], np.int64))
        table.finite()
        table.bounded(-LARGEST, LARGEST, "x", "y")
        _, first = np.unique(table.column("id"), return_index=True)
        for row in np.setdiff1d(np.arange(len(table.rows)), first):
            raise table.fault(row, "its key occurs twice, expected it once")
        found[kind] = table
    return found


def _listed(path: Path, values: Any) -> list[Any]:
    """The values of a robot, a list of objects, or as in the format's description an object with keys before them."""
    if values is None:
        return []
    if isinstance(values, dict):
        named: dict[str, Any] = values
        return [
            {**value, "key": int(key)} if key.isascii() and key.isdigit() and isinstance(value, dict) else value
            for key, value in named.items()
        ]
    if not isinstance(values, list):
        raise InputError(f"{path}: the truth is no list of values, expected one.")
    return values


def outliers_of(path: Path, content: Mapping[str, Any], robot: str) -> Ints | None:
    """The places of factors that are known to be outliers, None where the file says nothing of it."""
    named = _of_robot(content.get("outlier_factors"), robot)
    if named is None:
        return None
    if not isinstance(named, list) or not all(_is_pair(one) for one in named):
        raise InputError(f"{path}: outlier_factors are no pairs of an entry and a measurement, expected these.")
    return np.array([entry * _MOST_A_STEP + k for entry, k in named], np.int64)


def _is_pair(one: Any) -> bool:
    return isinstance(one, Sequence) and len(one) == 2 and all(type(k) is int and 0 <= k < _MOST_A_STEP for k in one)


def _of_robot(content: Any, robot: str) -> Any:
    """The part of an object that is a robot's; the content itself, where it is no object."""
    return content.get(robot) if isinstance(content, dict) else content
