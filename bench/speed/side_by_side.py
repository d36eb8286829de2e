"""Times EKF, smoother and iSAM2 on the same steps of the same log, in turns within one process.

Ratios of their costs are taken from here: disturbances slow all of them. MRPT's EKF, a program of its own, goes through
the same steps right after.
"""

from collections.abc import Sequence
from typing import NamedTuple

from ...backends import registry as backends
from ...backends.api import Backend
from ...core.kernels import compiled
from ..plan.variant import BackendVariant
from .mrpt import Program, mrpt_row
from .process import PATIENCE, Process, Subject, said_of, surveyed
from .timing import TimingRow, in_turns, timing
from .world import World, world

TOGETHER = ("ekf", "smoother", "isam2")
REFERENCE = TOGETHER[0]  # the others' costs are divided by its


class Together(NamedTuple):
    """One process, of one size."""

    process: Process
    mrpt: Program

    def __str__(self) -> str:
        return f"in turns, {self.process}"


def chosen(variants: Sequence[BackendVariant]) -> tuple[Subject, ...]:
    """Selects those of the backends that are compared so, with default options; () where there are no two."""
    here = [v for v in variants if v.builder is not None and v.label in TOGETHER]
    found = tuple(Subject(v.label, v.name, v.options) for v in sorted(here, key=lambda v: TOGETHER.index(v.label)))
    return found if len(found) > 1 else ()


def measure_together(task: Together) -> list[TimingRow]:
    """Measures a row for each backend, and MRPT's beside the reference; one that fails has the reason."""
    process, rows = task.process, list[TimingRow]()
    extent = process.extent
    for landmarks in process.sizes:
        here = world(landmarks, extent.steps, extent.sightings, extent.seed, scattered=extent.scattered)
        while True:
            ready = compiled.ready()
            found = _timed(process, here)
            if ready == compiled.ready():  # else code was loaded while the clock ran
                break
        rows += found
        if any(subject.label == REFERENCE for subject in process.subjects):
            rows.append(mrpt_row(task.mrpt, here, extent.seconds, PATIENCE))
    return rows


def _timed(process: Process, here: World) -> list[TimingRow]:
    landmarks, lost, there = len(here.map.ids), list[TimingRow](), dict[Subject, Backend]()
    for subject in process.subjects:
        try:
            there[subject] = surveyed(subject, here, process)
        except Exception as error:  # whatever a backend raises, the others go on
            lost.append(TimingRow("together", subject.label, landmarks, reason=said_of(error)))
    spent = in_turns(list(there.values()), [here.drive] * len(there), process.extent.seconds * len(there))
    return lost + [
        TimingRow(
            "together",
            subject.label,
            landmarks,
            timing=timing(ns),
            implementation=backends.implementation(subject.name, subject.options),
        )
        for subject, ns in zip(there, spent, strict=True)
    ]
