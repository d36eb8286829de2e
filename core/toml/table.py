"""Reads a TOML file table by table; errors name the file, line and key."""

import functools
import math
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import InputError, nearest
from ..scan import Scan, strict
from ..se2 import Array
from ..table import text
from .lines import Place, lines

T = TypeVar("T", bound=str | int)
D = TypeVar("D")

LARGEST = 2**63 - 1  # TOML's largest integer
HUGE = 1e12  # upper limit of lengths, times and factors
SHOWN = 80  # characters of a value that a message quotes


@dataclass(frozen=True)
class TomlTable:
    """A table and its position in the file.

    Methods that read a key raise InputError for a value of the wrong type or out of range, and for a missing key
    without default.
    """

    file: str
    lines: Callable[[], Mapping[Place, int]]  # computed when an error first needs them
    place: Place  # () for the file itself
    entries: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> "TomlTable":
        """Reads the file at `path`. InputError if it is missing or not TOML."""
        return cls.parse(str(path), text(path))

    @classmethod
    def parse(cls, file: str, text: str) -> "TomlTable":
        """Parses `text`, called `file` in errors. InputError if it is not TOML."""
        try:
            entries = tomllib.loads(text)
        except ValueError as error:  # TOMLDecodeError, or that of a number with thousands of digits
            said = _with_line(str(error).partition("; use ")[0], text)
            raise InputError(f"{file}{said}; expected a TOML file.") from None
        except RecursionError:
            raise too_deep(file) from None
        return cls(file, functools.cache(functools.partial(lines, text)), (), entries)

    def has(self, key: str) -> bool:
        """Tells if the key is given."""
        return key in self.entries

    def unknown(self, known: Collection[str]) -> Scan[None]:
        """Yields a fault for each key that is not `known`."""
        for key in self.entries:
            if key not in known:
                yield self.refused(key, f"there is no such key; {nearest(key, known)}")

    def only(self, known: Collection[str]) -> "TomlTable":
        """Returns itself. InputError for a key that is not `known`."""
        strict(self.unknown(known))
        return self

    def given(self, key: str, expected: str) -> Any:
        """The value, of any type."""
        if key not in self.entries:
            raise self.lacks(key, expected)
        return self.entries[key]

    def text(self, key: str, default: str | None = None) -> str:
        """A string; without a default it must be given and not be empty."""
        found = self.given(key, "a text in quotes") if default is None else self.entries.get(key, default)
        if not isinstance(found, str) or (default is None and not found.strip()):
            raise self.fault(key, "a text in quotes")
        return found

    def text_or_none(self, key: str) -> str | None:
        """A string that is not empty; None if it is not given."""
        return self.text(key) if self.has(key) else None

    def choice(self, key: str, default: D, known: Collection[T]) -> T | D:
        """One of the strings or integers `known`, or the default."""
        if key not in self.entries:
            return default
        found = self.entries[key]
        if type(found) not in map(type, known) or found not in known:
            raise self.fault(key, f"one of {', '.join(map(shown, known))}")
        return found

    def switch(self, key: str, default: bool) -> bool:
        """true or false."""
        found = self.entries.get(key, default)
        if not isinstance(found, bool):
            raise self.fault(key, "true or false")
        return found

    def whole(self, key: str, default: int, least: int, most: int = LARGEST) -> int:
        """An integer from `least` to `most`."""
        found = self.entries.get(key, default)
        if type(found) is not int or not least <= found <= most:
            raise self.fault(key, f"a whole number, at least {least}" + f" and at most {most:,}" * (most < LARGEST))
        return found

    def number(
        self, key: str, default: float | None = None, *, above: float = -math.inf, least: float = -math.inf
    ) -> float:
        """A number above `above`, at least `least` and not beyond `HUGE`; the default is not checked."""
        expected = "a number" + f" above {above:g}" * (above > -math.inf) + f" at least {least:g}" * (least > -math.inf)
        if key not in self.entries and default is not None:
            return default
        found = self.given(key, expected)
        if not is_number(found) or not (above < found and least <= found and abs(found) <= HUGE):
            beyond = is_number(found) and HUGE < abs(found) < math.inf
            raise self.fault(key, expected + f", not beyond {HUGE:g}" * beyond)
        return float(found)

    def numbers(self, key: str, *shape: int, default: Sequence[float] | None = None, most: float = HUGE) -> Array:
        """Numbers, none beyond `most`, in nested lists of that shape."""
        expected = f"{' x '.join(map(str, shape))} numbers"
        if key not in self.entries and default is not None:
            return np.array(default, float)
        found = self.given(key, expected)
        if not _fits(found, shape, most):
            raise self.fault(key, expected)
        return np.array(found, float).reshape(shape)

    def wholes(self, key: str) -> tuple[int, ...]:
        """A list of whole numbers, at least 0, none twice."""
        expected = "a list of different whole numbers, such as [5, 14]"
        found = self.given(key, expected)
        numbers = isinstance(found, list) and all(type(one) is int and one >= 0 for one in found)
        if not numbers or len(set(found)) < len(found):
            raise self.fault(key, expected)
        return tuple(found)

    def names(self, key: str) -> list[str]:
        """A string or a list of strings, at least one."""
        found = self.given(key, "a text or a list of texts")
        found = [found] if isinstance(found, str) else found
        if not isinstance(found, list) or not found or not all(isinstance(name, str) for name in found):
            raise self.fault(key, "a text or a list of texts, at least one")
        return found

    def table(self, key: str) -> "TomlTable":
        """The table `key`, empty if missing."""
        found = self.entries.get(key, {})
        if not isinstance(found, dict):
            raise self.fault(key, f"a table, [{called((*self.place, key))}] or {called((key,))} = {{ ... }}")
        return replace(self, place=(*self.place, key), entries=found)

    def tables(self, key: str, expected: str) -> "list[TomlTable]":
        """The elements of an array of tables, none if missing."""
        found = self.entries.get(key, [])
        if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
            raise self.fault(key, expected)
        return [replace(self, place=(*self.place, key, k), entries=one) for k, one in enumerate(found)]

    def flat(self) -> dict[str, tuple[Any, Place]]:
        """Entries and their places by dotted key, dataset.tags and "dataset.tags" being the same."""
        found: dict[str, tuple[Any, Place]] = {}
        for key, value in self.entries.items():
            inner = self.table(key).flat() if isinstance(value, dict) and value else {"": (value, (*self.place, key))}
            for rest, (deeper, place) in inner.items():
                name = f"{key}.{rest}" if rest else key
                if name in found:
                    raise self.at(place, f"{name} is given twice, expected once.")
                found[name] = deeper, place
        return found

    def fault(self, key: str, expected: str) -> InputError:
        """The error for a value at `key` that is not `expected`."""
        return self.refused(key, f"found {shown(self.entries[key])}, expected {expected}.")

    def refused(self, key: str, sentence: str) -> InputError:
        """The error `sentence` about `key`."""
        return InputError(f"{self.where(key)}: {sentence}")

    def lacks(self, key: str, expected: str) -> InputError:
        """The error for a missing `key`."""
        return self.at(self.place, f"{called(self.place) or 'the file'} has no {key!r}, expected {expected}.")

    def at(self, place: Place, sentence: str) -> InputError:
        """The error `sentence` about the value at `place`."""
        return InputError(f"{self._line(place)}: {sentence}")

    def where(self, *key: str) -> str:
        """File, line and dotted name of `key`, or of the table itself, as the start of an error."""
        place = (*self.place, *key)
        return f"{self._line(place)}: {called(place)}"

    def line(self, place: Place) -> int | None:
        """The line of the value at `place`, or else of the table or list around it."""
        while place and place not in self.lines():
            place = place[:-1]
        return self.lines().get(place)

    def _line(self, place: Place) -> str:
        line = self.line(place)
        return self.file if line is None else f"{self.file}, line {line}"


def is_number(value: Any) -> bool:
    """Tells a number from anything else, which true and false are."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def shown(value: Any, depth: int = 3) -> str:
    """Formats a value as in the file, truncated."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table" if value else "an empty table"
    if isinstance(value, int) and abs(value) > LARGEST:
        return "a whole number beyond 64 bits"
    if isinstance(value, list):
        inside = [shown(one, depth - 1) for one in value[:4]] if depth else []
        said = f"[{', '.join([*inside, '...'] if len(value) > len(inside) else inside)}]"
    else:
        said = repr(value) if isinstance(value, str | int | float) else f"the time {value}"
    return said if len(said) <= SHOWN else f"{said[:SHOWN]}..."


def called(place: Place) -> str:
    """The dotted key of `place`, without array indices."""
    keys = [part for part in place if isinstance(part, str)]
    return ".".join(key if key.isprintable() and 0 < len(key) <= SHOWN else shown(key) for key in keys)


def too_deep(file: str) -> InputError:
    """The error for deeply nested tables or lists."""
    return InputError(f"{file}: found tables or lists nested hundreds deep, expected a few levels.")


def _with_line(said: str, text: str) -> str:
    """Reformats tomllib's message with the line first, as in every other error."""
    what, _, where = said.rstrip(")").rpartition(" (at ")
    line, _, column = where.removeprefix("line ").partition(", column ")
    if not what:
        return f": not valid TOML: {said}"
    if not column:
        return f", line {len(text.splitlines())}: not valid TOML at its end: {what}"
    return f", line {line}: not valid TOML at column {column}: {what}"


def _fits(found: Any, shape: tuple[int, ...], most: float) -> bool:
    """Tells if it is a list nested to that shape, of numbers not beyond `most`."""
    if not shape:
        return is_number(found) and abs(found) <= most
    return isinstance(found, list) and len(found) == shape[0] and all(_fits(one, shape[1:], most) for one in found)
