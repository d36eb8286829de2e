"""Shortens the labels of a run's datasets and backends as far as they stay distinct."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

NAME, PATH = "name", "path"  # the options that name a log
FILES = {"csv": ("odometry", "detections", "truth", "landmarks"), "world": ("path", "landmarks")}
"""Options that are files, of datasets of several; the first is the one that a log is called by."""

_LABEL = re.compile(r"^(\w+)\[(.*)\]$", re.DOTALL)
_OPTION = re.compile(r'(\w+)=(?:"([^"]*)"|([^",]*))(?:,|$)')


def called(labels: Sequence[str]) -> dict[str, str]:
    """A distinct name for each dataset label: log[path=runs/kitchen] is kitchen if no other is.

    csv[name=kitchen,...] is kitchen, and csv[odometry=runs/kitchen/odometry.csv,...] too.
    """
    labelled = {label: _labelled(label) for label in dict.fromkeys(labels)}
    ends = {one.place: _ends(one) for one in labelled.values()}
    places = {place: next(names) for place, names in ends.items()}
    while alike := _alike(places):
        before = dict(places)
        places |= {place: next(ends[place], name) for place, name in before.items() if name in alike}
        if places == before:
            break
    found = {label: places[one.place] + one.rest for label, one in labelled.items()}
    for name in _alike(found):
        group = {label: labelled[label].options for label, other in found.items() if other == name}
        found |= {label: name + more for label, more in _differences(group).items()}
    alike = _alike(found)
    return {label: label if name in alike else name for label, name in found.items()}


def short(label: str) -> str:
    """The shortest name of a dataset label, whatever others there are."""
    return next(_ends(_labelled(label)))


class _Labelled(NamedTuple):
    """A dataset label as far as it names a log."""

    place: tuple[str, str]  # NAME or an option of a path, with its value; "" and the label for any other dataset
    files: bool  # the path is that of one file of several
    rest: str  # all other options, in brackets, of a dataset with a path alone
    options: Mapping[str, str]


def _labelled(label: str) -> _Labelled:
    """Parses a label, as `Variant.label` writes it."""
    found = _LABEL.match(label)
    options = {one[1]: one[2] or one[3] or "" for one in _OPTION.finditer(found[2])} if found else {}
    several = FILES.get(found[1], ()) if found else ()
    if options.get(NAME):
        return _Labelled((NAME, options[NAME]), False, "", options)
    if several and options.get(several[0]):
        return _Labelled((several[0], options[several[0]]), True, "", options)
    if not several and next(iter(options), "") == PATH:
        return _Labelled((PATH, options[PATH]), False, _bracketed(options, options.keys() - {PATH}), options)
    return _Labelled(("", label), False, "", options)


def _ends(one: _Labelled) -> Iterator[str]:
    """The names by the place, each longer than the one before."""
    kind, place = one.place
    parts = [part for part in place.split("/") if part not in ("", ".")]
    if kind in ("", NAME) or not parts:
        yield place
        return
    if one.files:  # of many recordings all files have the same names, and of one recording all are in one folder
        yield parts[-2] if len(parts) > 1 else parts[0].rpartition(".")[0] or parts[0]
        yield "/".join(parts[-3:-1]) or parts[0]
    patterns = next((k for k, part in enumerate(reversed(parts)) if not {"*", "?"} & set(part)), 0)
    for depth in range(1 + one.files + patterns, max(len(parts), 1 + one.files) + 1):
        yield "/".join(parts[-depth:])


def _alike(names: Mapping[Any, str]) -> set[str]:
    """Names that occur more than once."""
    return {name for name, count in Counter(names.values()).items() if count > 1}


def _differences(group: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The options of each label that not all have, in brackets."""
    shared = set.intersection(*({*options.items()} for options in group.values()))
    return {label: _bracketed(options, dict({*options.items()} - shared)) for label, options in group.items()}


def _bracketed(options: Mapping[str, str], which: Iterable[str]) -> str:
    wanted = {*which} - {NAME}
    more = ",".join(f"{option}={text}" for option, text in options.items() if option in wanted)
    return f"[{more}]" if more else ""


def tags(labels: Iterable[str]) -> dict[str, str]:
    """A distinct name for each backend label: without options, or with those that differ."""
    known = list(dict.fromkeys(labels))
    named: dict[str, list[str]] = {}
    for label in known:
        named.setdefault(label.partition("[")[0], []).append(label)
    return {label: _tag(label, named[label.partition("[")[0]]) for label in known}


def _tag(label: str, alike: list[str]) -> str:
    name, _, mine = label.partition("[")
    if len(alike) == 1 or not mine:
        return name
    shared = set.intersection(*({*_options(other)} for other in alike))
    return f"{name}[{','.join(option for option in _options(label) if option not in shared)}]"


def _options(label: str) -> list[str]:
    return label.partition("[")[2].removesuffix("]").split(",")
