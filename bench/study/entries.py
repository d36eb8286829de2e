"""The words of a study file, read table by table, so that a refusal names the file, the line and the key."""

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ...frontend.errors import InputError
from ..plan.spec import nearest
from .toml_lines import Place, lines

Size = Literal["quick", "full"]

LARGEST = 2**63 - 1
"""Of whole numbers, to TOML and to the store."""


@dataclass(frozen=True)
class Entries:
    """One table and where it stands. Every reader raises InputError for a value of another kind or out of range."""

    file: str
    lines: Mapping[Place, int]
    place: Place  # () for the file itself
    entries: Mapping[str, Any]

    @classmethod
    def load(cls, file: str, text: str, size: Size) -> "Entries":
        """The file itself, with the one of that size in the place of every {quick = ..., full = ...}."""
        try:
            entries = tomllib.loads(text)
        except ValueError as error:  # TOMLDecodeError, or that of a number with thousands of digits
            said = _with_line(str(error).partition("; use ")[0])
            raise InputError(f"{file}{said}; expected a TOML file.") from None
        except RecursionError:
            raise _too_deep(file) from None
        found: dict[Place, int] = {}
        try:
            sized = _Sizes(file, lines(text), size, found).chosen(entries, (), ())
        except RecursionError:
            raise _too_deep(file) from None
        return cls(file, found, (), sized)

    def has(self, key: str) -> bool:
        """Whether it is given."""
        return key in self.entries

    def only(self, known: Collection[str]) -> "Entries":
        """Itself, where it has none but the keys `known`."""
        for key in self.entries:
            if key not in known:
                raise self.refused(key, f"there is no such key; {nearest(key, known)}")
        return self

    def text(self, key: str, default: str | None = None) -> str:
        """A text; without a default it has to be given, and to have a letter."""
        found = self._found(key, default, "a text")
        if not isinstance(found, str) or (default is None and not found.strip()):
            raise self.fault(key, "a text")
        return found

    def choice(self, key: str, default: str, known: Collection[str]) -> str:
        """One of the texts `known`."""
        found = self.text(key, default)
        if found not in known:
            raise self.fault(key, "one of " + ", ".join(repr(name) for name in known))
        return found

    def switch(self, key: str, default: bool) -> bool:
        """true or false."""
        found = self.entries.get(key, default)
        if not isinstance(found, bool):
            raise self.fault(key, "true or false")
        return found

    def whole(self, key: str, default: int, least: int, most: int = LARGEST) -> int:
        """A whole number from `least` to `most`."""
        found = self.entries.get(key, default)
        if type(found) is not int or not least <= found <= most:
            raise self.fault(key, f"a whole number, at least {least}" + f" and at most {most:,}" * (most < LARGEST))
        return found

    def above(self, key: str, default: float | None, bound: float) -> float:
        """A finite number above the bound; without a default it has to be given."""
        found = self._found(key, default, f"a number above {bound:g}")
        if not is_number(found) or not bound < found < math.inf:
            raise self.fault(key, f"a number above {bound:g}")
        return float(found)

    def number(self, key: str, default: float) -> float:
        """A finite number, or the default."""
        if key not in self.entries:
            return default
        found = self.entries[key]
        if not is_number(found) or not math.isfinite(found):
            raise self.fault(key, "a number")
        return float(found)

    def names(self, key: str) -> list[str]:
        """A text or a list of texts, at least one."""
        found = self._found(key, None, "a text or a list of texts")
        found = [found] if isinstance(found, str) else found
        if not isinstance(found, list) or not found or not all(isinstance(name, str) for name in found):
            raise self.fault(key, "a text or a list of texts, at least one")
        return found

    def table(self, key: str) -> "Entries":
        """The table `key`, empty where there is none."""
        found = self.entries.get(key, {})
        if not isinstance(found, dict):
            raise self.fault(key, f"a table, {key} = {{ ... }}")
        return Entries(self.file, self.lines, (*self.place, key), found)

    def tables(self, key: str, expected: str) -> "list[Entries]":
        """Those of a list of tables, none where it is not given."""
        found = self.entries.get(key, [])
        if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
            raise self.fault(key, expected)
        return [Entries(self.file, self.lines, (*self.place, key, k), one) for k, one in enumerate(found)]

    def flat(self) -> dict[str, tuple[Any, Place]]:
        """Its entries by dotted key, and where each stands: dataset.tags and "dataset.tags" are the same to a study."""
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
        """The error that says what was found at `key` and what was `expected`."""
        return self.refused(key, f"found {shown(self.entries[key])}, expected {expected}.")

    def refused(self, key: str, sentence: str) -> InputError:
        """The error that says so of `key`."""
        return self.at((*self.place, key), f"{self._called(key)}: {sentence}")

    def lacks(self, key: str, expected: str) -> InputError:
        """The error that says that `key` is not there."""
        name = "the file" if not self.place else self._called()
        return self.at(self.place, f"{name} has no {key!r}, expected {expected}.")

    def at(self, place: Place, sentence: str) -> InputError:
        """The error that says so of what stands at `place`."""
        while place and place not in self.lines:
            place = place[:-1]
        line = f", line {self.lines[place]}" if place else ""
        return InputError(f"{self.file}{line}: {sentence}")

    def line(self, key: str) -> int:
        """Where `key` is, or else the table."""
        return self.lines.get((*self.place, key)) or self.lines[self.place]

    def _called(self, *key: str) -> str:
        return ".".join(part or "''" for part in (*self.place, *key) if isinstance(part, str))

    def _found(self, key: str, default: Any, expected: str) -> Any:
        if key not in self.entries and default is None:
            raise self.lacks(key, expected)
        return self.entries.get(key, default)


@dataclass(frozen=True)
class _Sizes:
    """Takes the one of a size from every {quick = ..., full = ...}, and notes where what is left stands."""

    file: str
    lines: Mapping[Place, int]
    size: Size
    found: dict[Place, int]

    def chosen(self, value: Any, stood: Place, place: Place) -> Any:
        if stood in self.lines:
            self.found[place] = self.lines[stood]
        if isinstance(value, dict):
            if "quick" in value or "full" in value:
                if set(value) != {"quick", "full"}:
                    raise Entries(self.file, self.lines, stood, value).at(
                        stood,
                        f"{'.'.join(str(part) for part in stood if isinstance(part, str)) or 'the file'}: found "
                        f"{' and '.join(value)}, expected quick and full, each with a value, and nothing else.",
                    )
                return self.chosen(value[self.size], (*stood, self.size), place)
            return {name: self.chosen(inner, (*stood, name), (*place, name)) for name, inner in value.items()}
        if isinstance(value, list):
            return [self.chosen(inner, (*stood, k), (*place, k)) for k, inner in enumerate(value)]
        if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
            raise Entries(self.file, self.lines, (), {}).at(
                stood, f"found a whole number of {len(str(abs(value)))} digits, expected 19 at most: one of 64 bits."
            )
        return value


def _too_deep(file: str) -> InputError:
    return InputError(f"{file}: found tables or lists that are hundreds deep in one another, expected a few.")


def _with_line(said: str) -> str:
    """What tomllib says, with the line before it as in every other sentence."""
    what, _, where = said.rstrip(")").rpartition(" (at line ")
    if not what:
        return f": not valid TOML: {said}"
    line, _, column = where.partition(", column ")
    return f", line {line}: not valid TOML at column {column}: {what}"


def is_number(value: Any) -> bool:
    """Whether it is one: true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def shown(value: Any) -> str:
    """A value as the file has it, short."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table" if value else "an empty table"
    if isinstance(value, list):
        inside = ", ".join(shown(one) for one in value[:4])
        return f"[{inside}{', ...' if len(value) > 4 else ''}]"
    return repr(value) if isinstance(value, str | int | float) else f"the time {value}"
