"""Reads and checks the values of options, on the command line and from Python."""

import math
from argparse import ArgumentTypeError
from collections.abc import Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

from ...core.errors import InputError

T = TypeVar("T")

MOST_CELLS = 1_000_000  # of a run or a study: more take gigabytes before the first is run


def too_many(cells: int) -> str:
    """The end of a sentence on so many cells; "" where they are no more than MOST_CELLS."""
    if cells <= MOST_CELLS:
        return ""
    return f"with these there are {cells:,} cells, expected at most {MOST_CELLS:,}."


def seed(text: str) -> int:
    """Reads a whole number, at least 0; raises argparse's own error, as all functions that read text."""
    return _read(text, 0)


def count(text: str) -> int:
    """Reads a whole number, at least 1."""
    return _read(text, 1)


def positive(text: str) -> float:
    """Reads a number above 0."""
    try:
        return as_positive("", float(text))
    except (ValueError, InputError):
        raise ArgumentTypeError(f"found {text}, expected {_POSITIVE}") from None


def check_file(flag: str, path: Path | None, endings: Sequence[str] = ()) -> None:
    """Raises InputError unless `path`, if any, can be a file with one of the endings in a folder that exists."""
    if path is None:
        return
    if endings and path.suffix.lower() not in endings:
        ending = f"the ending {path.suffix!r}" if path.suffix else "a name without an ending"
        raise InputError(f"{flag} {path}: found {ending}, expected one of {', '.join(endings)}.")
    if path.is_dir():
        raise InputError(f"{flag} {path}: found a folder, expected the name of a file.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{flag} {path}: there is no folder {path.parent}, expected an existing one.")


def as_whole(name: str, value: Any, least: int) -> int:
    """Returns `value` as a whole number, at least `least`; InputError names the argument."""
    if type(value) is bool or not isinstance(value, Integral) or int(value) < least:
        raise InputError(f"{name}: found {value!r}, expected {_whole(least)}.")
    return int(value)


def as_choice(name: str, value: Any, known: Sequence[T]) -> T:
    """Returns `value` if it is one of `known`; InputError names the argument."""
    for one in known:
        if value == one:
            return one
    raise InputError(f"{name}: found {value!r}, expected one of {', '.join(map(str, known))}.")


def as_positive(name: str, value: Any) -> float:
    """Returns `value` as a number above 0; InputError names the argument."""
    if type(value) is bool or not isinstance(value, Real) or not 0 < float(value) < math.inf:
        raise InputError(f"{name}: found {value!r}, expected {_POSITIVE}.")
    return float(value)


def as_switch(name: str, value: Any) -> bool:
    """Returns `value` as True or False; InputError names the argument."""
    if not isinstance(value, bool):
        raise InputError(f"{name}: found {value!r}, expected True or False.")
    return value


def as_text(name: str, value: Any) -> str:
    """Returns `value` as a text; InputError names the argument."""
    if not isinstance(value, str):
        raise InputError(f"{name}: found {value!r}, expected a text.")
    return value


_POSITIVE = "a number above 0"


def _whole(least: int) -> str:
    return f"a whole number, at least {least}"


def _read(text: str, least: int) -> int:
    if not (text.isascii() and text.isdigit() and int(text) >= least):
        raise ArgumentTypeError(f"found {text}, expected {_whole(least)}")
    return int(text)
