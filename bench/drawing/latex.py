"""Writes a table for a paper: LaTeX with booktabs and nothing else, one column wide where possible."""

import re
from collections.abc import Sequence

from ..words.column import Column
from .table import Entry, Table

COLUMN = 241  # points; a column of a two-column paper, 85 mm
LETTER, SMALL, GAP = 4.1, 3.6, 4.0  # points of a letter in \footnotesize, in \scriptsize, and between columns, roughly
LONGEST = 8  # letters of a heading on one line

_LETTERS = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "#": r"\#", "$": r"\$", "%": r"\%", "&": r"\&", "_": r"\_",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\N{EN DASH}": "--", "\N{EM DASH}": "---",
    "\N{MULTIPLICATION SIGN}": r"$\times$", "\N{INFINITY}": r"$\infty$", "\N{MICRO SIGN}": r"$\mu$",
    "\N{DAGGER}": r"\dag{}", "\N{HORIZONTAL ELLIPSIS}": r"\ldots{}", "<": r"$<$", ">": r"$>$", "|": r"$|$",
    "\N{PLUS-MINUS SIGN}": r"$\pm$", "\N{DEGREE SIGN}": r"$^\circ$", '"': r"\textquotedbl{}",
}  # fmt: skip
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def latex(table: Table, caption: str, label: str) -> str:
    """Writes a floating table; it needs \\usepackage{booktabs} and, for quotation marks, T1 fonts.

    It spans both columns (table*) where one has no room for it. Empty entries are dashes.
    """
    heads = [table.of, *(_below(escaped(top), [*more]) for top, *more in map(_heading, table.headings))]
    sides = [
        "l" if not any(row.entries[k].value is not None for row in table.rows) else "r"
        for k in range(len(table.headings))
    ]
    place = "table*" if _width(table) > COLUMN else "table"
    lines = [
        rf"\begin{{{place}}}",
        r"\centering\footnotesize\setlength{\tabcolsep}{2pt}",
        rf"\caption{{{escaped(caption)}}}",
        rf"\label{{{re.sub('[^A-Za-z0-9:._-]+', '-', label)}}}",
        rf"\begin{{tabular}}{{@{{}}l{''.join(sides)}@{{}}}}",
        r"\toprule",
        " & ".join(heads) + r" \\",
        r"\midrule",
        *(" & ".join([escaped(row.backend), *map(_cell, row.entries)]) + r" \\" for row in table.rows),
        r"\bottomrule",
        r"\end{tabular}",
        rf"\end{{{place}}}",
    ]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    """Escapes text for LaTeX; powers of ten become exponents."""
    parts = re.split("\N{MULTIPLICATION SIGN}10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", " ".join(text.split()))
    said = ["".join(_LETTERS.get(letter, letter) for letter in part) for part in parts[::2]]
    powers = [rf"$\times10^{{{power.translate(_RAISED)}}}$" for power in parts[1::2]]
    return "".join(a + b for a, b in zip(said, [*powers, ""], strict=True))


def _heading(column: Column) -> list[str]:
    """Splits a long heading into lines, the unit on its own."""
    words = column.heading.split(" ", 1) if len(column.heading) > LONGEST else [column.heading]
    return [*words, *[f"({column.kind.unit})"] * bool(column.kind.unit)]


def _cell(entry: Entry) -> str:
    """Sets an entry, its note and word below."""
    if not entry.text:
        return "--"
    text = escaped(entry.text)
    return _below(rf"\textbf{{{text}}}" if entry.best else text, [entry.note, entry.word])


def _below(text: str, small: Sequence[str]) -> str:
    """Stacks small lines below the text; `\\shortstack` needs no package."""
    lines = [text, *(rf"\scriptsize {escaped(part)}" for part in small if part)]
    stack = r" \\ ".join(lines)
    return text if len(lines) == 1 else rf"\shortstack[r]{{{stack}}}"


def _width(table: Table) -> float:
    width = LETTER * max(len("backend"), *(len(row.backend) for row in table.rows)) if table.rows else 0.0
    for k, column in enumerate(table.headings):
        entries = [row.entries[k] for row in table.rows]
        large = [len(_heading(column)[0]), *(len(entry.text) for entry in entries)]
        small = [len(part) for entry in entries for part in (entry.note, entry.word)]
        small += [len(part) for part in _heading(column)[1:]]
        width += GAP + max(LETTER * max(large), SMALL * max(small, default=0))
    return width
