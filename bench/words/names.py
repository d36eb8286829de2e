"""Shortens the labels of a run's datasets and backends as far as they stay distinct."""

import re
from collections.abc import Iterable, Sequence

_PATH = re.compile(r'^\w+\[path=(?:"([^"]*)"|([^",\]]*))(?:,(.*))?\]$', re.DOTALL)


def called(labels: Sequence[str]) -> dict[str, str]:
    """A distinct name for each dataset label: log[path=runs/kitchen] is kitchen if no other is."""
    depth, names = 1, [_called(label, 1) for label in labels]
    while len(set(names)) < len(set(labels)):
        depth += 1
        deeper = [_called(label, depth) for label in labels]
        if deeper == names:  # their paths do not differ: another kind of dataset at the same place
            return {label: label for label in labels}
        names = deeper
    return dict(zip(labels, names, strict=True))


def _called(label: str, depth: int) -> str:
    found = _PATH.match(label)
    if found is None:
        return label
    parts = [part for part in (found[1] or found[2]).split("/") if part not in ("", ".")]
    rest = f"[{found[3]}]" if found[3] else ""
    patterns = next((k for k, part in enumerate(reversed(parts)) if not {"*", "?"} & set(part)), 0)
    return "/".join(parts[-depth - patterns :] or [label]) + rest


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
