"""Remarks on cells that are done, from their reasons: each once, with the cells that it holds for."""

import re
from collections.abc import Iterator, Sequence

from ..verdict.summary import Line
from ..words.numerals import counted, listed

NUMBER = r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\w)"
IDS = r"landmarks? \d+(?:(?:, | and )\d+)*"
PARTS = re.compile(f"({IDS})|({NUMBER})")
NAMED = 3  # backends that a remark names
MOST = 8  # remarks of a dataset that are shown


def cell_remarks(lines: Sequence[Line]) -> Iterator[str]:
    """Yields them for one dataset's lines, those of the most cells first; alike are those that differ in numbers."""
    found: dict[tuple[str, ...], list[tuple[str, list[str]]]] = {}
    for line in lines:
        for row in line.rows:
            said = (row.columns["reason"] or "") if row.columns["status"] == "done" else ""
            for remark in filter(None, said.split("; ")):
                words, numbers = _apart(remark)
                found.setdefault(words, []).append((line.backend, numbers))
    cells = sum(line.done for line in lines)
    ranked = sorted(found.items(), key=lambda one: -len(one[1]))
    for words, of in ranked[:MOST]:
        numbers = (_span(one) for one in zip(*(numbers for _, numbers in of), strict=True))
        remark = words[0] + "".join(f"{number}{word}" for number, word in zip(numbers, words[1:], strict=True))
        backends = list(dict.fromkeys(backend for backend, _ in of))
        whole = len(of) == cells
        yield f"{'all' if whole and cells > 1 else listed(backends, NAMED)}{_many(len(of), cells)}: {remark}"
    if len(ranked) > MOST:
        yield f"{counted(len(ranked) - MOST, 'remark')} more: cells.csv has them in the column reason"


def _apart(remark: str) -> tuple[tuple[str, ...], list[str]]:
    """The words of a remark before, between and after its numbers, and these; ids of landmarks are words."""
    words, numbers, done = list[str](), list[str](), 0
    for part in PARTS.finditer(remark):
        if part[2]:
            words.append(remark[done : part.start()])
            numbers.append(part[2])
            done = part.end()
    return (*words, remark[done:]), numbers


def _many(n: int, cells: int) -> str:
    """Counts those of the cells that are done; nothing where there is one."""
    return f", {n} of {counted(cells, 'cell')}" if cells > 1 else ""


def _span(numbers: Sequence[str]) -> str:
    """The number, or the least and the largest."""
    ranked = sorted(set(numbers), key=lambda one: float(one.replace(",", "")))
    return ranked[0] if len(ranked) == 1 else f"{ranked[0]} to {ranked[-1]}"
