"""What a run wrote beside its record, read back where the record cannot be: cells.csv, metrics.csv and run.json."""

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .schema import COLUMNS, KEY, TEXTS

CELLS, METRICS, RUN = "cells.csv", "metrics.csv", "run.json"


class Written(NamedTuple):
    """A run as its files tell it: rows by column, what is known of the run, and sentences on what was left out."""

    rows: list[dict[str, Any]]
    run: dict[str, Any]
    said: list[str]


def written(folder: Path) -> Written:
    """Whatever can be had from the folder's files; nothing at all where there are none."""
    said: list[str] = []
    rows = list(_table(folder / CELLS, said))
    more = {tuple(row[name] for name in KEY): row for row in _table(folder / METRICS, said)}
    return Written([more.get(tuple(row[name] for name in KEY), {}) | row for row in rows], _run(folder, said), said)


def _run(folder: Path, said: list[str]) -> dict[str, Any]:
    path = folder / RUN
    if not path.is_file():
        return {}
    try:
        found: Any = json.loads(path.read_text(encoding="utf-8", errors="replace"))
    except (ValueError, RecursionError, OSError) as error:
        said.append(f"{RUN} cannot be read ({error}): what it says of the run as a whole is left out.")
        return {}
    if not isinstance(found, dict):
        said.append(f"{RUN} holds no names and values: it is left out.")
        return {}
    return {str(name): value for name, value in found.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]


def _table(path: Path, said: list[str]) -> Iterator[dict[str, Any]]:
    """The table's rows by column; the first of several of the same cell."""
    if not path.is_file():
        return
    try:
        lines = csv.reader(path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True))
        header = next(lines, [])
    except (OSError, csv.Error) as error:
        said.append(f"{path.name} cannot be read ({error}): it is left out.")
        return
    if not set(KEY) <= set(header):
        said.append(f"{path.name}: its first row does not name {', '.join(KEY)}: it is left out.")
        return
    keys: set[tuple[Any, ...]] = set()
    try:
        for values in lines:
            row = dict(zip(header, map(_value, header, values), strict=False))
            problem = _problem(header, values, tuple(row.get(name) for name in KEY) in keys)
            if problem:
                said.append(f"{path.name}, line {lines.line_num}: {problem}: it is left out.")
                continue
            keys.add(tuple(row[name] for name in KEY))
            yield row
    except csv.Error as error:
        said.append(f"{path.name}, line {lines.line_num}: {error}: it and all after it is left out.")


def _problem(header: Sequence[str], values: Sequence[str], again: bool) -> str:
    if len(values) != len(header):
        return f"found {len(values)} values, expected {len(header)}"
    return "the same cell once more" if again else ""


def _value(column: str, text: str) -> Any:
    """As the record has it; a text that is no number stays one, for whoever judges the row."""
    if column in TEXTS and (text or column in COLUMNS):  # those of metrics.csv may have no value
        return text
    if not text:
        return None
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
