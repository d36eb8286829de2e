"""Lists the logs of a dataset of many: those that fit a pattern, a TOML file's, or a published dataset's."""

import glob
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ...core.errors import InputError
from ...datasets.formats import log_list
from ...datasets.formats.log_list import Entry
from ...datasets.registry import Member, Named, Source
from .variant import DatasetVariant

LIST = "logs"  # the dataset that reads a TOML file of logs
FILE = ".toml"

Find = Callable[[str, str], Sequence[DatasetVariant]]  # a dataset as on the command line, who asks -> its variants


def members(name: str, options: Any, source: Source, find: Find) -> tuple[Member, ...]:
    """Lists the logs that a dataset with these options stands for, none for one that is by itself.

    InputError for a pattern that fits nothing, a file that cannot be used, and a log that is named twice.
    """
    path = getattr(options, "path", None)
    if name == LIST:
        found = [one for entry in log_list.read(path) for one in _of_entry(entry, find)]
    elif several := source.many(options):
        found = [*several]
    elif isinstance(path, str) and is_pattern(path):
        drawn = source.seeded  # each log has noise of its own
        places = matches(path)
        found = [Member(name, replace(options, path=one), one, None, k * drawn) for k, one in enumerate(places)]
    else:
        return ()
    _refuse_twice(found, f"dataset {name}[path={path}]" if path else f"dataset {name}")
    return tuple(found)


def is_pattern(path: str) -> bool:
    """True for a path with * or ?, unless something has that very name."""
    return ("*" in path or "?" in path) and not os.path.lexists(path)


def matches(pattern: str) -> list[str]:
    """Lists what fits a pattern of * and ?, numbers in names by their size; InputError where nothing does."""
    found = glob.glob(pattern.replace("[", "[[]"))
    if not found:
        raise InputError(f"{pattern}: nothing fits this pattern, expected one or more logs.")
    return sorted(found, key=lambda path: [int(p) if p.isdecimal() else p for p in re.split(r"(\d+)", path)])


def _of_entry(entry: Entry, find: Find) -> list[Member]:
    """Lists the logs of one entry of a file: one, or those of a pattern or of a dataset of many."""
    if entry.dataset == LIST or entry.dataset.startswith(f"{LIST}[") or entry.path.lower().endswith(FILE):
        raise entry.refused("is a file of logs again, expected one log or a dataset")
    text = entry.dataset or f'"{entry.path}"'
    found: list[Member] = []
    for variant in find(text, entry.where):
        if entry.seed is not None and (variant.members or not variant.source.draws(variant.options)):
            raise entry.refused("draws nothing at random, expected no seed")
        if variant.members:
            named = os.path.normpath if entry.path else str
            found += [
                one._replace(name=named(one.name), cluster=entry.cluster or one.cluster) for one in variant.members
            ]
            continue
        called = getattr(variant.options, "name", None) or entry.said
        called += f", seed {entry.seed}" * (entry.seed is not None)
        found.append(Member(variant.name, variant.options, called, entry.cluster, entry.seed or 0))
    return found


def _refuse_twice(found: Sequence[Member], where: str) -> None:
    seen: dict[Any, Member] = {}
    for one in found:
        path = getattr(one.options, "path", None)
        options = replace(one.options, path=os.path.realpath(path)) if path else one.options
        options = replace(options, name=None) if isinstance(options, Named) else options
        before = seen.setdefault((one.dataset, options, one.seed), one)
        if before is not one:
            both = one.name if one.name == before.name else f"{before.name} and {one.name}"
            raise InputError(f"{where}: found the same log twice, {both}; expected each log once.")
