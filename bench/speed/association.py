"""`bench speed --association`: a step whose sightings have no ids beside the same step with them.

All run in turns in one process, one backend and size at a time. The survey has ids for all, so that the maps are the
same; joint compatibility then has to find out which landmarks of that map are in view. A third one has association, and
ids all the same: what the layer costs where there is nothing to decide. Without association there is no layer.

The first steps of the drive are not timed: at the first one without ids nothing is known yet of which landmarks are
near, and a backend that computes covariances when it is asked does so for all. What association adds is the difference
of median steps in each tenth of the drive: the median of these, and the second least to the second largest, which hold
the median with 97.9 % by the sign test.
"""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from ...backends import registry
from ...backends.association.layer import Associating
from ...core.errors import InputError
from ...core.files import csv_text, write_whole
from ...core.kernels import compiled
from ...core.se2 import Array, Ints
from ..measure.drive import WARM_UP
from ..plan.spec import backend_variants
from ..plan.variant import BackendVariant
from ..words.console import plain
from ..words.numerals import number
from .backends import FULL, QUICK, asked, executed
from .process import Process, Stretch, Subject, said_of, surveyed
from .timing import Timing, in_turns, timing
from .world import without_ids, world

BACKENDS = "ekf,ukf,invariant-ekf,smoother,isam2,fixed-lag"
RULE, SIGHTINGS = "jcbb", 8
OF_EACH = 0.5  # s of CPU; of a step's three ways
COLUMNS = ("backend", "landmarks", "steps", "told_p50_us", "told_p99_us", "p50_us", "p99_us", "layer_p50_us",
           "added_us", "added_low_us", "added_high_us", "right", "reason")  # fmt: skip
OPTIONS = ("backend", "sizes", "sightings", "steps", "seconds", "scattered")

EXPECTED, AT, RARELY = {"ekf": 15.0, "smoother": 50.0, "isam2": 2000.0}, 100, 100.0
"""µs that data association adds to a median step at most, with AT landmarks; to the 99th percentile of `ekf`'s."""


TENTHS = 10
"""Parts of a drive."""


class Limit(NamedTuple):
    """A cost, and the most that is expected of it."""

    what: str
    most: float  # µs
    reached: float  # µs

    @property
    def holds(self) -> bool:
        """True within it."""
        return self.reached <= self.most


class Added(NamedTuple):
    """The time that association adds to a median step, µs, with its interval."""

    us: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{number(self.us)} ({number(self.low)} to {number(self.high)})"


class AssociationRow(NamedTuple):
    """A backend at one size."""

    name: str
    landmarks: int
    told: Timing | None = None  # the step with ids
    found: Timing | None = None  # the step without
    idle: Timing | None = None  # the step with ids, behind association
    added: Added = Added(0.0, 0.0, 0.0)
    share: float = 0.0  # of the sightings, those whose landmark was found
    reason: str = ""  # "" where it was timed


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    usual = QUICK if namespace.quick else FULL._replace(seconds=OF_EACH)
    extent = asked(namespace, usual._replace(sightings=SIGHTINGS))
    processes = [
        Process((_subject(variant),), size, extent)
        for variant in backend_variants(namespace.backend or BACKENDS)
        for size in extent.sizes
    ]
    rows = list[AssociationRow]()
    for process, found, death in executed(measure, processes, console):
        rows += [AssociationRow(process.subjects[0].label, process.landmarks, reason=death)] if death else found
    reached = expectations(rows)
    console.print(_table(rows, extent))
    if reached:
        console.print(_limits(reached))
    files = {} if namespace.csv is None else {namespace.csv: as_csv(rows)}
    if namespace.out is not None:
        files[namespace.out / "association.csv"] = as_csv(rows)
    for path, text in files.items():
        write_whole(path, text)
    return list(files)


def measure(process: Process) -> list[AssociationRow]:
    """Measures a backend at one size; one that fails has a row with the reason."""
    (subject,), landmarks, extent = process.subjects, process.landmarks, process.extent
    here = world(landmarks, extent.steps, extent.sightings, extent.seed, scattered=extent.scattered)
    subject = subject._replace(options=of_one_form(subject.options, landmarks))
    hidden = subject._replace(options=dataclasses.replace(subject.options, association=RULE))
    drives = [here.drive, without_ids(here.drive), here.drive]
    first = min(WARM_UP, extent.steps - 1)
    try:
        while True:
            backends = [surveyed(one, here, process) for one in (subject, hidden, hidden)]
            for backend, drive in zip(backends, drives, strict=True):
                for step in drive[:first]:
                    backend.step(step)
            ready = compiled.ready()
            told, found, idle = in_turns(backends, [drive[first:] for drive in drives], len(drives) * extent.seconds)
            if ready == compiled.ready():  # else code was loaded while the clock ran
                break
    except Exception as error:  # whatever a backend raises, the others go on
        return [AssociationRow(subject.label, landmarks, reason=said_of(error))]
    assert isinstance(backends[1], Associating)
    right = [landmark for step in here.drive[first : first + len(found)] for landmark in step.sightings.ids.tolist()]
    taken = backends[1].assigned().tolist()[-len(right) :]
    share = sum(a == b for a, b in zip(taken, right, strict=True)) / max(1, len(right))
    return [
        AssociationRow(subject.label, landmarks, timing(told), timing(found), timing(idle), added(told, found), share)
    ]


def added(told: Ints | Array, found: Ints | Array) -> Added:
    """Returns what association adds to the median step, by CPU times (n,) in ns of the same steps in both ways."""
    parts = [
        float(np.median(hidden) - np.median(known)) / 1e3
        for known, hidden in zip(np.array_split(told, TENTHS), np.array_split(found, TENTHS), strict=True)
        if len(known)
    ]
    parts.sort()
    outermost = 1 if len(parts) == TENTHS else 0
    return Added(float(np.median(parts)), parts[outermost], parts[-1 - outermost])


def expectations(rows: Sequence[AssociationRow]) -> list[Limit]:
    """Compares what is added with what is expected, where that is known."""
    found = list[Limit]()
    for row in rows:
        if row.told is None or row.found is None or row.landmarks != AT or row.name not in EXPECTED:
            continue
        what = f"data association adds to {row.name}'s step, N={AT}"
        found.append(Limit(f"{what}, median", EXPECTED[row.name], row.added.us))
        if row.name == "ekf":
            found.append(Limit(f"{what}, 99th percentile", RARELY, row.found.p99 - row.told.p99))
    return found


def as_csv(rows: Sequence[AssociationRow]) -> str:
    """Writes one line per backend and size; blank where it was not timed."""
    lines = list[Sequence[object]]()
    for row in rows:
        figures: list[object] = [""] * (len(COLUMNS) - 3)
        if row.told is not None and row.found is not None:
            idle = row.told if row.idle is None else row.idle
            us = row.told.p50, row.told.p99, row.found.p50, row.found.p99, idle.p50
            figures = [row.found.steps, *(f"{one:.4g}" for one in (*us, *row.added)), f"{row.share:.4f}"]
        lines.append((row.name, row.landmarks, *figures, row.reason))
    return csv_text(COLUMNS, lines)


def _table(rows: Sequence[AssociationRow], extent: Stretch) -> Table:
    which = "any landmarks of the map" if extent.scattered else "the nearest landmarks"
    title = f"CPU time of a step, µs, with ids and without, association={RULE}; {extent.sightings} sightings of {which}"
    table = Table(title=title)
    table.add_column("backend")
    for heading in ("N", "steps", "with ids", "p99", "layer, ids", "without", "p99", "added (interval)", "right"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        if row.told is None or row.found is None:
            table.add_row(plain(row.name), f"{row.landmarks:,}", f"[red]{plain(row.reason)}[/]")
            continue
        idle = row.told if row.idle is None else row.idle
        told, found = row.told, row.found
        figures = map(number, (told.p50, told.p99, idle.p50, found.p50, found.p99))
        table.add_row(
            plain(row.name), f"{row.landmarks:,}", f"{row.found.steps:,}", *figures, str(row.added),
            f"{100 * row.share:.1f} %",
        )  # fmt: skip
    return table


def _limits(limits: Sequence[Limit]) -> Table:
    table = Table(title="What is expected of it")
    for heading in ("what", "at most, µs", "reached, µs"):
        table.add_column(heading)
    for limit in limits:
        style = "green" if limit.holds else "bold red"
        table.add_row(plain(limit.what), f"{limit.most:,g}", f"[{style}]{number(limit.reached)}[/]")
    return table


def of_one_form(options: Any, landmarks: int) -> Any:
    """The options with which a landmark that is mapped twice does not have the filter compressed.

    Else a map at the threshold would compare two forms of the filter; with ids, the form is that of these options.
    """
    if landmarks > getattr(options, "compress_above", -1):
        return options
    return dataclasses.replace(options, compress_above=max(options.compress_above, 2 * landmarks))


def _subject(variant: BackendVariant) -> Subject:
    """The backend as it is with ids; InputError for one without data association."""
    if variant.builder is None or not variant.builder.can_associate:
        raise InputError(f"--backend {variant.label}: {variant.missing or 'has no data association'}; expected others")
    if registry.find(variant.name).associates is True or getattr(variant.options, "association", "none") != "none":
        raise InputError(f"--backend {variant.label}: associates; expected it without association, which is added")
    return Subject(variant.label, variant.name, variant.options)
