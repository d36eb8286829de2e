"""Collects a study's evidence from its record: progress, numbers, answers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...backends import registry as backends
from ...core.errors import InputError
from ...datasets import registry as datasets
from ..claims import answer as claim_answer
from ..claims.answer import Answer
from ..claims.conclusion import Conclusion, conclude
from ..claims.curves import Medians, medians
from ..claims.finding import Verdict
from ..claims.standing import Progress, standing
from ..drawing.figure import ReportFigure
from ..record.cell_table import CellTable
from ..record.store import Store
from ..study import file as study_file
from ..study.study import Study
from ..words.columns import about
from ..words.numerals import counted

SIGNS = {"holds": "✓", "fails": "✗", "open": "?", "yes": "✓", "no": "✗"}  # by verdict: of a claim, and of the study
WORDS = ("name", "text", "size", "command", "executor", "environment", "started")  # required facts

VERDICTS = {"holds": "holds", "fails": "fails", "open": "open", "yes": "holds", "no": "fails"}
"""the class of each in a page"""


MOST_TELLING = 3  # claims that a page with many studies has room for, of each


class ClaimSummary(NamedTuple):
    """A claim's result, in the parts in which a page shows it."""

    verdict: Verdict
    says: str
    measured: str  # the numbers, the bounds, and remarks


@dataclass(frozen=True)
class Evidence:
    """A study's current evidence."""

    folder: Path
    study: Study
    words: Mapping[str, Any]  # of the store
    table: CellTable
    conclusion: Conclusion

    @property
    def answers(self) -> Sequence[Answer]:
        """The answer to each claim."""
        return self.conclusion.answers

    @property
    def answered(self) -> tuple[str, str]:
        """The conclusion, and its reason in few words."""
        head, _, why = self.conclusion.sentence.partition(": ")
        if not self.answers or self.conclusion.reproduced == "yes":
            return head, why
        counts = Counter(answer.verdict for answer in self.answers)
        said = [f"{counts['holds']} of {counted(len(self.answers), 'claim')} hold"]
        said += [f"{counts['fails']} {'fails' if counts['fails'] == 1 else 'fail'}"] * (counts["fails"] > 0)
        said += [f"{counts['open']} {'is' if counts['open'] == 1 else 'are'} open"] * (counts["open"] > 0)
        return head, f"{', '.join(said)}."

    @property
    def findings(self) -> Sequence[ClaimSummary]:
        """Lists every claim with its result, in the file's order."""
        return [
            ClaimSummary(
                found.verdict,
                found.claim.says.rstrip("."),
                found.sentence.partition(f"{found.claim.says.rstrip('.')}: ")[2],
            )
            for found in self.answers
        ]

    @property
    def most_telling(self) -> Sequence[ClaimSummary]:
        """Lists all claims that do not hold, and of the others the first ones."""
        others = [found for found in self.findings if found.verdict != "holds"]
        held = [found for found in self.findings if found.verdict == "holds"]
        return [*others, *held[: max(MOST_TELLING - len(others), 1)]]

    @cached_property
    def standing(self) -> Progress:
        """The study's progress."""
        return standing(self.table)

    @cached_property
    def medians(self) -> Sequence[Medians]:
        """The numbers of each figure."""
        return [medians(figure, self.table) for figure in self.study.figures]

    @cached_property
    def figures(self) -> Sequence[ReportFigure]:
        """Draws the figures."""
        from .figure import study_figure  # matplotlib

        backends = self.table.values("backend", np.arange(len(self.table)))
        drawn: list[ReportFigure] = []
        for k, found in enumerate(self.medians, 1):
            x = option_words(found.figure.x, self.table)
            one = study_figure(f"{self.study.name}-{k}", found, backends, self.answers, x)
            drawn.append(one._replace(caption=f"{one.caption}{self._timing(found.figure.y)}"))
        return drawn

    @property
    def seconds(self) -> float:
        """Sums the s of wall time of its cells."""
        return float(np.nansum(self.table.columns["seconds"]))

    def _timing(self, column: str) -> str:
        """Says of a time whether other cells ran on the same machine meanwhile."""
        if not about(column).kind.is_time:
            return ""
        beside = self.table.columns["timing_alone"] == 0
        if not beside.any():
            return " Timed alone on the machine."
        return f" Timed while other cells ran on the same machine: {beside.sum():,} of {len(beside):,}."


def evidence(folder: Path) -> Evidence:
    """Reads the evidence of the study in the folder; InputError where there is none."""
    with Store(folder) as store:
        words = store.about()
        lacks = [name for name in WORDS if name not in words]
        if lacks:
            raise InputError(
                f"{folder}: has no {lacks[0]} of the study yet; expected one that was begun: bench ablate."
            )
        study = study_file.reread(words["name"], words["text"], full=words["size"] == "full")
        columns = [*claim_answer.measures(study.claims), *(figure.y for figure in study.figures)]
        table = store.table(list(dict.fromkeys([*columns, "seconds", "timing_alone"])))
    conclusion = conclude([claim_answer.answer(claim, table) for claim in study.claims], study.finding)
    return Evidence(folder, study, words, table, conclusion)


LONGEST = 84  # letters that an axis has room for, in two lines


def option_words(parameter: str, table: CellTable) -> str:
    """Describes a swept option with its unit, if its help is short; else returns its name."""
    name = parameter.rpartition(".")[2]
    plain = name.replace("_", " ")
    having = np.flatnonzero(table.columns[parameter] != None)  # noqa: E711 - of each element
    if not len(having) or parameter in ("dataset", "backend", "seed"):
        return plain
    for column, registry in (("dataset", datasets), ("backend", backends)):
        summary = _summary(registry, str(table.columns[column][having[0]]).partition("[")[0], name)
        if summary and ":" not in summary:  # text after a colon lists choices
            said = summary if plain in summary else f"{summary} ({plain})"
            return said if len(said) <= LONGEST else plain
    return plain


def _summary(registry: Any, who: str, name: str) -> str:
    """The first half of a built-in's option help; "" where there is none."""
    if who not in registry.BUILTIN:
        return ""
    options = {field.name: field for field in fields(registry.find(who).options)}
    return options[name].metadata["summary"].partition(";")[0] if name in options else ""
