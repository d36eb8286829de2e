"""Names the programs behind a dataset's backends: costs compare implementations, not algorithms alone."""

from collections.abc import Sequence

from ...backends.api import COMPILED_HERE
from ..words.numerals import listed
from .summary import Line

CAUTION = "Costs compare implementations, not algorithms alone."


def sentence(lines: Sequence[Line]) -> str:
    """Says which backend is whose program, where there are several programs; else "".

    The most frequent comes last and names none: "GTSAM's wheel: isam2; compiled here: the others." The labels are in
    full: an option may choose the program.
    """
    known = [line for line in lines if line.done and line.implementation]
    by_kind: dict[str, list[str]] = {}
    for line in known:
        by_kind.setdefault(line.implementation, []).append(line.backend)
    if len(by_kind) < 2:
        return ""
    most = max(by_kind, key=lambda kind: (len(by_kind[kind]), kind == COMPILED_HERE))
    told = [f"{kind}: {listed(names)}" for kind, names in by_kind.items() if kind != most]
    told.append(f"{most}: {'the others' if len(by_kind[most]) > 1 else by_kind[most][0]}")
    return f"{'; '.join(told)}. {CAUTION}"


def foreign(lines: Sequence[Line]) -> set[str]:
    """The labels of backends not compiled here, where others are; none where all are of one kind."""
    said = {line.backend: line.implementation for line in lines if line.implementation}
    if COMPILED_HERE not in said.values():
        return set()
    return {backend for backend, kind in said.items() if kind != COMPILED_HERE}
