"""All that a report says of a study, worked out from its store alone: how far it is, its numbers, its answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from . import claim_test, study_file
from .claim_test import Answer
from .conclusion import Conclusion, conclude
from .exhibit import Exhibit
from .option_words import option_words
from .study import Study
from .study_medians import Medians, medians
from .study_standing import Standing, standing
from .study_store import StudyStore
from .study_table import StudyTable

SIGNS = {"holds": "✓", "fails": "✗", "open": "?", "yes": "✓", "no": "✗"}
"""By verdict: of a claim, and of the study."""

VERDICTS = {"holds": "holds", "fails": "fails", "open": "open", "yes": "holds", "no": "fails"}
"""The class of each in a page."""


@dataclass(frozen=True)
class Evidence:
    """A study as it stands."""

    folder: Path
    study: Study
    words: Mapping[str, Any]  # of the store
    table: StudyTable
    conclusion: Conclusion

    @property
    def answers(self) -> Sequence[Answer]:
        """What became of each claim."""
        return self.conclusion.answers

    @property
    def answered(self) -> tuple[str, str]:
        """What the study comes to: the words that say it, and what they are due to."""
        head, _, why = self.conclusion.sentence.partition(": ")
        return head, why

    @cached_property
    def standing(self) -> Standing:
        """How far it is."""
        return standing(self.table)

    @cached_property
    def medians(self) -> Sequence[Medians]:
        """The numbers of each figure."""
        return [medians(figure, self.table) for figure in self.study.figures]

    @cached_property
    def exhibits(self) -> Sequence[Exhibit]:
        """The figures."""
        from .study_figure import study_figure  # matplotlib

        backends = self.table.values("backend", np.arange(len(self.table)))
        drawn: list[Exhibit] = []
        for k, found in enumerate(self.medians, 1):
            x = option_words(found.figure.x, self.table)
            one = study_figure(f"{self.study.name}-{k}", found, backends, self.answers, x)
            drawn.append(one._replace(caption=f"{one.caption}{self._timing(found.figure.y)}"))
        return drawn

    @property
    def seconds(self) -> float:
        """s of wall time that its cells took, one after another."""
        return float(np.nansum(self.table.columns["seconds"]))

    def _timing(self, column: str) -> str:
        """Of a time, whether other cells ran on the same machine meanwhile."""
        if not column.startswith(study_file.TIMES):
            return ""
        beside = self.table.columns["timing_alone"] == 0
        if not beside.any():
            return " Timed alone on the machine."
        return f" Timed while other cells ran on the same machine: {beside.sum():,} of {len(beside):,}."


def evidence(folder: Path) -> Evidence:
    """Of the study in the folder; InputError where there is none."""
    with StudyStore(folder) as store:
        words = store.words()
        study = study_file.reread(words["name"], words["text"], full=words["size"] == "full")
        columns = [*claim_test.measures(study.claims), *(figure.y for figure in study.figures)]
        table = store.table(list(dict.fromkeys([*columns, "seconds", "timing_alone"])))
    conclusion = conclude([claim_test.answer(claim, table) for claim in study.claims], study.finding)
    return Evidence(folder, study, words, table, conclusion)
