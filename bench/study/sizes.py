"""Takes the value of one size, quick or full, from every {quick = ..., full = ...} of a study file."""

from dataclasses import replace
from typing import Any, Literal

from ...frontend.toml.lines import Place
from ...frontend.toml.table import LARGEST, TomlTable, called, shown, too_deep

Size = Literal["quick", "full"]


def sized(file: TomlTable, size: Size) -> TomlTable:
    """Returns the file in that size; InputError for other sizes, and a number beyond 64 bits."""
    lines, found = file.lines(), dict[Place, int]()

    def chosen(value: Any, stood: Place, place: Place) -> Any:
        """Returns the value that `stood` in the file and has the `place` in what is left."""
        if stood in lines:
            found[place] = lines[stood]
        if isinstance(value, dict) and ("quick" in value or "full" in value):
            if set(value) != {"quick", "full"}:
                given = f"{called(stood) or 'the file'}: found {' and '.join(value)}"
                raise file.at(stood, f"{given}, expected quick and full, each with a value, and nothing else.")
            return chosen(value[size], (*stood, size), place)
        if isinstance(value, dict):
            return {name: chosen(inner, (*stood, name), (*place, name)) for name, inner in value.items()}
        if isinstance(value, list):
            return [chosen(inner, (*stood, k), (*place, k)) for k, inner in enumerate(value)]
        if isinstance(value, int) and abs(value) > LARGEST:
            raise file.at(stood, f"found {shown(value)}, expected {LARGEST:,} at most.")
        return value

    try:
        entries = chosen(file.entries, (), ())
    except RecursionError:
        raise too_deep(file.file) from None
    return replace(file, lines=lambda: found, entries=entries)
