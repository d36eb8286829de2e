"""All that is timed in one process: backends after a survey of one map."""

import time
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...backends import registry
from ...backends.api import Backend
from ...core.errors import SlamduelError
from ..measure.cell import generator, located
from .timing import TimingRow
from .world import World

PATIENCE = 60.0  # s of CPU for a survey, which is not timed


class Subject(NamedTuple):
    """A backend's variant."""

    label: str
    name: str
    options: Any


class Stretch(NamedTuple):
    """Sizes of maps, and the part of a drive on each through which backends are timed."""

    sizes: tuple[int, ...]
    steps: int
    sightings: int
    seconds: float
    seed: int = 0
    scattered: bool = False


@dataclass(frozen=True)
class Process:
    """All that is measured in one process, so that it is comparable."""

    subjects: tuple[Subject, ...]
    landmarks: int
    extent: Stretch

    def __str__(self) -> str:
        return f"{', '.join(subject.label for subject in self.subjects)}: N={self.landmarks:,}"

    def lost(self, reason: str) -> list[TimingRow]:
        """The rows of a process that died."""
        return [TimingRow("backend", subject.label, self.landmarks, reason=reason) for subject in self.subjects]


def said_of(error: Exception) -> str:
    """Describes an error; one that is no sentence for users with the line that raised it."""
    if isinstance(error, SlamduelError):
        return str(error)
    return located(error)


def surveyed(subject: Subject, here: World, process: Process) -> Backend:
    """Makes a backend and drives it through the survey; TooSlow for one that takes more CPU than PATIENCE."""
    rng = generator(process.extent.seed, subject.label)
    backend = registry.find(subject.name).make(here.prior, subject.options, rng)
    start = time.process_time()
    for k, step in enumerate(here.survey):
        backend.step(step)
        if time.process_time() - start > PATIENCE:
            raise TooSlow(f"its map was not made within {PATIENCE:g} s of CPU: {k + 1} of {len(here.survey)} steps")
    return backend


class TooSlow(SlamduelError):
    """A backend that is too slow to be timed."""
