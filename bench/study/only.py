"""Parses `--only NAME=VALUE[,VALUE]` into a selection of a study's cells."""

import re
from collections.abc import Callable, Hashable, Sequence
from typing import Any

from ...core.errors import InputError, nearest
from ..plan.work import PlannedCell
from .study import Study

MOST = 12  # values that a sentence names
_VALUE = re.compile(r"""(?:"[^"]*"|\[[^\]]*\]|[^,\["])+""")  # a value; commas in brackets are part of it

_LIST = re.compile(f"{_VALUE.pattern}(?:,{_VALUE.pattern})*")


def choice(study: Study, only: Sequence[str]) -> Callable[[PlannedCell], bool]:
    """A function that is True for cells selected by all of `only`, each the text after an --only.

    Values of one parameter are alternatives, in one --only or in several; * stands for anything, ? for any letter.
    InputError for a parameter or a value that no cell has, and where nothing is left.
    """
    allowed: dict[str, set[Hashable]] = {}
    for text in only:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals or not values.strip():
            raise InputError(f"--only {text}: expected NAME=VALUE, and NAME one of {', '.join(study.parameters)}.")
        if name not in study.parameters:
            raise InputError(f"--only {text}: no cell has a parameter {name!r}; {nearest(name, study.parameters)}")
        known = list(dict.fromkeys(cell.parameters[name] for cell in study.cells))
        if not _LIST.fullmatch(values):
            raise InputError(
                f"--only {text}: expected values separated by commas, with every bracket and quote closed."
            )
        for pattern in _VALUE.findall(values):
            found = [value for value in known if _is_meant(pattern.strip(), value)]
            if not found:
                texts = [word for word in map(text_of, known) if word]
                expected = f"one of {', '.join(texts[:MOST])}{', ...' * (len(texts) > MOST)}"
                raise InputError(f"--only {text}: no cell has {name}={pattern.strip()}, expected {expected}.")
            allowed.setdefault(name, set()).update(found)

    def chosen(cell: PlannedCell) -> bool:
        return all(cell.parameters[name] in values for name, values in allowed.items())

    if not any(map(chosen, study.cells)):
        texts = " --only ".join(only)
        raise InputError(f"--only {texts}: no cell has all of that, expected a choice that some have.")
    return chosen


def _is_meant(pattern: str, value: Any) -> bool:
    """True if the pattern matches the value: as a text, with its * and ?, or as a number."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            return float(pattern) == value
        except ValueError:
            pass
    anything = "".join({"*": ".*", "?": "."}.get(letter, re.escape(letter)) for letter in pattern)
    return re.fullmatch(anything, text_of(value), re.DOTALL) is not None


def text_of(value: Any) -> str:
    """Writes a parameter's value as --only takes it; "" for a cell without such an option."""
    return "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
