"""GTSAM's symbols as ids of vertices: a letter in the highest of eight bytes, a number in the others.

Older versions of GTSAM write x7 as 8646911284551352327, which no double is. The number alone is the id, if all poses
have one letter and all points one; where both then have the same numbers, those of the poses begin above the points'.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from ...core.table import Table

BITS, LARGEST = 56, 2.0**64  # of a symbol's number, and above all symbols

_POSE, _POINT, _EITHER = "poses", "points", "either"


class _Place(NamedTuple):
    """A word that is an id."""

    kind: str
    row: int
    word: int
    role: str
    symbol: int


def has_symbols(tables: Mapping[str, Table]) -> bool:
    """Tells if a file has ids as large as symbols."""
    return any(
        ((table.column(name) >= 2.0**BITS) & (table.column(name) < LARGEST)).any()
        for table in tables.values()
        for name, role in zip(table.columns, _roles(table.columns), strict=True)
        if role
    )


def without_symbols(
    path: Path, rows: dict[str, list[str]], lines: Mapping[str, Sequence[int]], columns: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """The rows of each kind with the numbers of symbols in their place; InputError for several letters."""
    places = list(_places(rows, columns))
    letters = dict[str, int]()
    for place in places:
        letter = place.symbol >> BITS
        known = letters.setdefault(place.role, letter)
        if letter != known and place.role != _EITHER:
            raise InputError(
                f"{path}, line {lines[place.kind][place.row]}: found the symbol {_shown(place.symbol)} beside others "
                f"of {chr(known)!r}, expected one letter for all {place.role}."
            )
    if _POINT in letters and letters.get(_POSE) == letters[_POINT]:
        raise InputError(f"{path}: found poses and points of one letter, {chr(letters[_POINT])!r}, expected two.")
    numbers = {role: {one.symbol & (2**BITS - 1) for one in places if one.role == role} for role in (_POSE, _POINT)}
    above = max(numbers[_POINT], default=-1) + 1 if numbers[_POSE] & numbers[_POINT] else 0
    words = {kind: [row.split() for row in content] for kind, content in rows.items()}
    for kind, row, word, _, symbol in places:
        of_pose = symbol >> BITS == letters.get(_POSE)
        words[kind][row][word] = str((symbol & (2**BITS - 1)) + above * of_pose)
    return {kind: [" ".join(row) for row in content] for kind, content in words.items()}


def _places(rows: Mapping[str, Sequence[str]], columns: Mapping[str, Sequence[str]]) -> Iterable[_Place]:
    for kind, content in rows.items():
        roles = _roles(columns[kind])
        for row, text in enumerate(content):
            for word, (role, found) in enumerate(zip(roles, text.split(None, len(roles)), strict=False)):
                if role and found.isascii() and found.isdigit() and int(found) < LARGEST:
                    yield _Place(kind, row, word, role, int(found))


def _roles(names: Sequence[str]) -> list[str]:
    """The vertices, poses or points, that the words of a row are ids of; "" for those that are none."""
    of_id = _POINT if "pose" in names or tuple(names) == ("id", "x", "y") else _POSE
    roles = {"from": _POSE, "to": _POSE, "pose": _POSE, "id": of_id if len(names) > 1 else _EITHER}
    return [roles.get(name, "") for name in names]


def _shown(symbol: int) -> str:
    letter = chr(symbol >> BITS)
    return f"{letter}{symbol & (2**BITS - 1)}" if letter.isprintable() else str(symbol)
