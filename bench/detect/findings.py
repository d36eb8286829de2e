"""The findings of a detection, which every sensor tells in sentences, figures and JSON, and shows on a page."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...core.factors import Dataset, Log, Truth
from ...core.truth.doubts import judges
from ...core.truth.errors import driven_errors
from ...datasets.inertial.open import NOTE
from ...frontend.inertial.tilts import LEVELS
from ...frontend.inertial.words import about_levels, about_turns
from ..contradiction.remark import remarks
from ..drawing.figure import ReportFigure
from ..measure.stated_noise import TYPICAL, noise_check
from ..words.numerals import listed, number

FEWEST_POSES = 10  # true poses from which errors of the motions are typical


@dataclass(frozen=True, eq=False)
class Findings(ABC):
    """The log of a recording, and what its sensor's front end has found."""

    template: ClassVar[str]  # of the page

    log: Log
    truth: Truth | None  # at the log's times
    seconds: float  # length of the recording

    @property
    def remarks(self) -> list[str]:
        """Lists what is legal in the log yet odd."""
        return remarks(Dataset(self.log, self.truth))

    @property
    def way(self) -> float:
        """The length of the path by the log's odometry, m."""
        return float(np.hypot(*self.log.delta[1:, :2].T).sum())

    @abstractmethod
    def headline(self) -> list[str]:
        """Summarises in sentences: what is in the log first."""

    def sentences(self) -> list[str]:
        """Summarises in sentences: the headline, and the inertial readings where there are some."""
        notes, said = self.log.notes, self.headline()
        said += [f"IMU: {notes[NOTE]}."] if NOTE in notes else []
        said += [f"T{turns.removeprefix('t')}." for turns in about_turns(notes)]
        levels = about_levels(notes[LEVELS]) if LEVELS in notes else ""
        return said + ([f"{levels[0].upper()}{levels[1:]}."] if levels else [])

    @abstractmethod
    def refused(self) -> str:
        """Says what is not in the log, and why."""

    @abstractmethod
    def advice(self) -> list[str]:
        """Says what looks wrong, in sentences."""

    def motions_by_truth(self) -> list[str]:
        """Says how large the errors of the log's motions are, where they are larger than stated."""
        truth = self.truth
        if truth is None or len(truth.t) < FEWEST_POSES or not judges(self.log, truth):
            return []
        errors = driven_errors(self.log, truth)
        found = noise_check(errors, self.log.delta_cov)
        if found is None or found.scale < TYPICAL:
            return []
        said = (
            f"Against the truth, the errors of the motions are typically {number(found.scale)} times what is stated: "
            "perhaps wheels are swapped or reversed, or their size, distance or noise is another."
        )
        return [said]

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Returns what the sensor adds to the JSON."""

    @abstractmethod
    def figures(self) -> list[ReportFigure]:
        """Draws the figures of the page."""

    @abstractmethod
    def shown(self, folder: Path) -> Mapping[str, Any]:
        """Writes the sensor's own files into `folder`, and returns what its template takes beside the findings."""

    def as_json(self, out: str) -> dict[str, Any]:
        """Returns the findings as JSON takes them; `out` is the log's folder."""
        known = None if self.truth is None else self.truth.kind
        said = {"advice": self.advice(), "remarks": self.remarks, "truth": known}
        said |= {name: self.log.notes[name] for name in (NOTE, LEVELS) if name in self.log.notes}
        return {"log": out, "name": self.log.name, **self.numbers(), **said}


def by_count(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    """Lists what was counted at all, the most frequent first."""
    return sorted(((name, n) for name, n in counts.items() if n), key=lambda one: (-one[1], one[0]))


def told(phrases: Sequence[str]) -> str:
    """Lists phrases in a line; "nothing" where there is none."""
    return listed(phrases) or "nothing"
