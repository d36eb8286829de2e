"""Measures in one process: a backend's variants at its sizes, and the references beside them."""

import dataclasses
import os
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ...backends import registry as backends
from ...backends.api import Backend
from ...core.errors import SlamduelError
from ...core.kernels import compiled
from ..measure.cell import generator, located
from ..measure.drive import WARM_UP
from .isam2_parts import isam2_parts
from .references import Floors, particle_loop, search, textbook
from .timing import TimingRow, array_bytes, holds_foreign, stepped, timing
from .world import World, world

GAUSSIAN = ("ekf", "ukf", "invariant-ekf")  # with a full covariance: dsyrk and memory are lower bounds
PATIENCE = 60.0  # s of CPU for a survey, which is not timed


class Subject(NamedTuple):
    """A backend's variant."""

    label: str
    name: str
    options: Any


class Stretch(NamedTuple):
    """The part of a world that a backend is driven through."""

    steps: int
    sightings: int
    seconds: float
    seed: int
    scattered: bool


@dataclass(frozen=True)
class Process:
    """All that is measured in one process, so that it is comparable."""

    subjects: tuple[Subject, ...]  # variants of one backend
    sizes: tuple[int, ...]
    particles: int | None
    extent: Stretch

    @property
    def name(self) -> str:
        """The backend's name."""
        return self.subjects[0].name

    def __str__(self) -> str:
        labels = " and ".join(subject.label for subject in self.subjects)
        maps = ", ".join(f"{size:,}" for size in self.sizes)
        return f"{labels}: N={maps}" + (f", M={self.particles:,}" if self.particles is not None else "")


def measure(process: Process) -> list[TimingRow]:
    """Measures every row; a backend that fails is a row with the reason."""
    rows: list[TimingRow] = []
    e = process.extent
    for landmarks in process.sizes:
        here = world(landmarks, e.steps, e.sightings, e.seed, scattered=e.scattered)
        floors = Floors(landmarks, e.sightings) if process.name in GAUSSIAN else None
        if floors is not None:
            floors.measure()
        for subject in process.subjects:
            rows += _attempted(subject, here, process)
        if floors is not None:
            floors.measure()
            rows += floors.rows(process.name)
        if process.name == "ekf":
            rows += [textbook(here, process.name), search(here, process.name)]
        if process.name == "fastslam" and process.particles is not None:
            rows.append(particle_loop(here, process.particles, e.seed, process.name))
    return rows


def lost(process: Process, reason: str, kind: str = "backend") -> list[TimingRow]:
    """The rows of a process that died."""
    return [
        TimingRow(kind, subject.label, landmarks, process.particles, reason=reason)
        for landmarks in process.sizes
        for subject in process.subjects
    ]


def _attempted(subject: Subject, here: World, process: Process) -> list[TimingRow]:
    """Measures the backend's row and those of its parts; if it fails, the reason replaces what is missing."""
    landmarks, rows = len(here.map.ids), list[TimingRow]()
    try:
        rows.append(_timed(subject, here, process))
        if subject.name == "isam2":
            backend = surveyed(subject, here, process)
            rows += isam2_parts(backend, here.drive, process.extent.seconds, landmarks, subject.label)
            from .hand_loop import beside_hand_loop  # a large library

            backend = surveyed(subject, here, process)
            rows += beside_hand_loop(backend, subject.options, here, process.extent.seconds, subject.label)
        return rows
    except Exception as error:  # whatever a backend raises, the others go on
        reason = said_of(error)
    return [*rows, TimingRow("part" if rows else "backend", subject.label, landmarks, process.particles, reason=reason)]


def said_of(error: Exception) -> str:
    """Describes an error; one that is no sentence for users with the line that raised it."""
    if isinstance(error, SlamduelError):
        return str(error)
    return located(error)


def _timed(subject: Subject, here: World, process: Process) -> TimingRow:
    surveyed(subject, here._replace(survey=here.survey[:WARM_UP]), process)
    while True:
        ready, before = compiled.ready(), _resident()
        backend = surveyed(subject, here, process)
        ns = stepped(backend, here.drive, process.extent.seconds)
        if ready == compiled.ready():  # else code was loaded meanwhile that neither warm-up nor survey came to
            break
    resident = _resident() - before if holds_foreign(backend) else None
    held = array_bytes(backend)
    start = time.process_time_ns()
    finished = backend.finish()
    finish_ms = None if finished is None else (time.process_time_ns() - start) / 1e6
    size = len(here.map.ids)
    return TimingRow(
        "backend",
        subject.label,
        size,
        process.particles,
        timing(ns),
        finish_ms=finish_ms,
        array_bytes=held,
        resident_bytes=resident,
        implementation=backends.implementation(subject.name, subject.options),
    )


def surveyed(subject: Subject, here: World, process: Process) -> Backend:
    """Makes a backend and drives it through the survey."""
    options = subject.options
    if process.particles is not None:
        options = dataclasses.replace(options, particles=process.particles)
    rng = generator(process.extent.seed, subject.label)
    backend = backends.find(subject.name).make(here.prior, options, rng)
    start = time.process_time()
    for k, step in enumerate(here.survey):
        backend.step(step)
        if time.process_time() - start > PATIENCE:
            raise TooSlow(f"its map was not made within {PATIENCE:g} s of CPU: {k + 1} of {len(here.survey)} steps")
    return backend


class TooSlow(SlamduelError):
    """A backend that is too slow to be timed."""


def _resident() -> int:
    """The bytes of memory that the process has now; elsewhere than on Linux the most it had."""
    if sys.platform == "linux":
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
