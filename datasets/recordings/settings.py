"""A table of a TOML file, read key by key, so that a refusal names the file, the table and the key."""

import difflib
import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...frontend.errors import InputError
from ...frontend.table import text

HUGE = 1e12
"""No length, time or factor of a robot's is as large."""


@dataclass(frozen=True)
class Settings:
    """One table and where it stands. Every reader raises InputError for a value of another kind or out of range."""

    path: Path
    name: str  # "" for the file itself
    entries: Mapping[str, Any]

    @classmethod
    def load(cls, path: Path, known: Collection[str]) -> "Settings":
        """The file itself, which has none but the keys `known`. InputError where it is no TOML."""
        try:
            entries = tomllib.loads(text(path))
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: not valid TOML: {error}.") from error
        return cls(path, "", entries)._only(known)

    def table(self, key: str, known: Collection[str] | None) -> "Settings":
        """The table `key`, empty where there is none; it has none but the keys `known`, if these are given."""
        found = self.entries.get(key, {})
        if not isinstance(found, dict):
            raise self.fault(key, found, f"a table [{key}]")
        inside = Settings(self.path, f"{self.name}.{key}" if self.name else key, found)
        return inside if known is None else inside._only(known)

    def has(self, key: str) -> bool:
        """Whether `key` is given."""
        return key in self.entries

    def number(self, key: str, default: float | None = None, *, above: float = -math.inf, least: float = -math.inf,
               most: float = math.inf) -> float:  # fmt: skip
        """A finite number over `above`, from `least` to `most`; without a default it has to be given."""
        found = self._found(key, default, "a number")
        bounds = [f"above {above:g}"] if above > -math.inf else []
        bounds += [f"at least {least:g}"] if least > -math.inf else []
        bounds += [f"at most {most:g}"] if most < math.inf else []
        expected = " ".join(["a number", " and ".join(bounds)]).strip()
        if not _is_number(found) or not (above < found and least <= found <= most):
            raise self.fault(key, found, expected)
        return float(found)

    def whole(self, key: str, choices: Collection[int]) -> int | None:
        """One of the whole numbers `choices`; None where it is not given."""
        found = self.entries.get(key)
        if found is not None and (type(found) is not int or found not in choices):
            raise self.fault(key, found, f"one of {', '.join(map(str, choices))}")
        return found

    def words(self, key: str, default: str | None = None, choices: Collection[str] = ()) -> str:
        """A text, one of `choices` where there are any; without a default it has to be given."""
        expected = f"one of {', '.join(map(repr, choices))}" if choices else "a text in quotes"
        found = self._found(key, default, expected)
        if not isinstance(found, str) or not found or (choices and found not in choices):
            raise self.fault(key, found, expected)
        return found

    def numbers(self, key: str, length: int, default: list[float] | None = None) -> list[float]:
        """`length` finite numbers."""
        found = self._found(key, default, f"{length} numbers")
        if not isinstance(found, list) or len(found) != length or not all(map(_is_number, found)):
            raise self.fault(key, found, f"{length} numbers")
        return [float(one) for one in found]

    def fault(self, key: str, found: Any, expected: str) -> InputError:
        """The error that says what was found at `key` and what was `expected`."""
        return InputError(f"{self.where(key)}: found {found!r}, expected {expected}.")

    def where(self, key: str) -> str:
        """The file, table and key, for an error's sentence."""
        return f"{self.path}: [{self.name}] {key}" if self.name else f"{self.path}: {key}"

    def _found(self, key: str, default: Any, expected: str) -> Any:
        found = self.entries.get(key, default)
        if found is None:
            raise InputError(f"{self.where(key)}: is missing, expected {expected}.")
        return found

    def _only(self, known: Collection[str]) -> "Settings":
        for key in self.entries:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
                hint = f"did you mean {close[0]!r}?" if close else f"expected none but {', '.join(known)}."
                raise InputError(f"{self.where(key)}: there is no such key; {hint}")
        return self


def _is_number(found: Any) -> bool:
    """Whether it is a number that something on a robot can have; a NaN is within no bounds."""
    return isinstance(found, int | float) and not isinstance(found, bool) and -HUGE < found < HUGE
