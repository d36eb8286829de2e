"""`bench speed`: CPU time of backends' steps against the size of the map, in turns on the same steps of the same log.

Ratios of costs are taken from one process, in which a disturbance slows all of them; each size has a process of its
own. Whole logs, and how a cost grows along them, are timed by `bench run`, by the study `map-size` and by the suite
`programs`.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from ...backends import registry
from ...backends.api import Backend
from ...core.errors import InputError
from ...core.files import write_whole
from ...core.kernels import compiled
from ..measure.drive import WARM_UP
from ..plan.spec import backend_variants
from ..words.console import ProgressBar, plain
from ..workers.tasks import execute
from .isam2_parts import isam2_parts
from .process import Process, Stretch, Subject, said_of, surveyed
from .tables import as_csv, part_table, turns_table
from .timing import TimingRow, in_turns, timing
from .world import World, world

BACKENDS = "ekf,smoother,isam2,mrpt-ekf[method=davison],textbook-ekf"
OPTIONS = ("backend", "sizes", "sightings", "steps", "seconds", "scattered")  # the study's own options
FULL, QUICK = Stretch((10, 100, 1000), 5000, 6, 5.0), Stretch((10, 30, 100), 200, 6, 1.0)
OVERDUE = 1800.0  # s of wall clock after which a process is killed


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    add = group.add_argument
    add("--backend", metavar="NAMES", help=f"as in bench run; costs are multiples of the first one's ({BACKENDS})")
    add("--sizes", metavar="N,...", help=f"landmarks on the map ({_listed(FULL.sizes)}; quick {_listed(QUICK.sizes)})")
    add("--sightings", type=int, metavar="K", help=f"a step ({FULL.sightings})")
    add("--steps", type=int, metavar="N", help=f"timed, at most ({FULL.steps}; quick {QUICK.steps})")
    seconds = f"{FULL.seconds:g}; quick {QUICK.seconds:g}"
    add("--seconds", type=float, metavar="S", help=f"of CPU for each backend, then timing stops ({seconds})")
    add(
        "--scattered",
        action="store_true",
        help="sight landmarks anywhere on the map, not the nearest: the worst case of a compressed filter",
    )


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    extent = asked(namespace, QUICK if namespace.quick else FULL)
    variants = backend_variants(namespace.backend or BACKENDS)
    subjects = tuple(Subject(v.label, v.name, v.options) for v in variants if v.builder is not None)
    unknown = [TimingRow("backend", v.label, 0, reason=v.missing) for v in variants if v.builder is None]
    rows = list[TimingRow]()
    for process, found, death in executed(measure, [Process(subjects, size, extent) for size in extent.sizes], console):
        rows += process.lost(death) if death else found
    which = "any landmarks of the map" if extent.scattered else "the nearest landmarks"
    console.print(turns_table([*rows, *unknown], f"{extent.sightings} sightings a step, of {which}"))
    if any(row.kind == "part" for row in rows):
        console.print(part_table(rows))
    files = [path for path in (namespace.csv, namespace.out and namespace.out / "backends.csv") if path is not None]
    for path in files:
        write_whole(path, as_csv([*rows, *unknown]))
    return files


def asked(namespace: argparse.Namespace, usual: Stretch) -> Stretch:
    """The extent that was asked for, else the `usual` one; InputError for an invalid value."""
    for flag in ("sightings", "steps"):
        count = getattr(namespace, flag)
        if count is not None and count < 1:
            raise InputError(f"--{flag} {count}: expected 1 or more")
    if namespace.seconds is not None and not 0 < namespace.seconds < float("inf"):
        raise InputError(f"--seconds {namespace.seconds:g}: expected a number above 0")
    return Stretch(
        _counts("--sizes", namespace.sizes, usual.sizes),
        namespace.steps or usual.steps,
        namespace.sightings or usual.sightings,
        namespace.seconds or usual.seconds,
        namespace.seed,
        namespace.scattered,
    )


def measure(process: Process) -> list[TimingRow]:
    """Times the backends in turns, then the parts of each `isam2`'s step; one that fails has a row with the reason."""
    extent = process.extent
    here = world(process.landmarks, extent.steps, extent.sightings, extent.seed, scattered=extent.scattered)
    while True:
        ready = compiled.ready()
        rows = _in_turns(process, here)
        if ready == compiled.ready():  # else code was loaded while the clock ran
            break
    for subject in process.subjects:
        if subject.name == "isam2":
            backend = surveyed(subject, here, process)
            rows += isam2_parts(backend, here.drive, extent.seconds, process.landmarks, subject.label)
            from .hand_loop import beside_hand_loop  # a large library

            backend = surveyed(subject, here, process)
            rows += beside_hand_loop(backend, subject.options, here, extent.seconds, subject.label)
    return rows


def _in_turns(process: Process, here: World) -> list[TimingRow]:
    lost, there = list[TimingRow](), dict[Subject, Backend]()
    for subject in process.subjects:
        try:
            surveyed(subject, here._replace(survey=here.survey[:WARM_UP]), process)
            there[subject] = surveyed(subject, here, process)
        except Exception as error:  # whatever a backend raises, the others go on
            lost.append(TimingRow("backend", subject.label, process.landmarks, reason=said_of(error)))
    if not there:
        return lost
    spent = in_turns(list(there.values()), [here.drive] * len(there), process.extent.seconds * len(there))
    return lost + [
        TimingRow(
            "backend",
            subject.label,
            process.landmarks,
            timing=timing(ns),
            implementation=registry.implementation(subject.name, subject.options),
        )
        for subject, ns in zip(there, spent, strict=True)
    ]


T = TypeVar("T")
R = TypeVar("R")


def executed(
    function: Callable[[T], list[R]], tasks: Sequence[T], console: Console
) -> Iterator[tuple[T, list[R], str]]:
    """Yields each task with its rows, or with why its process died, one process at a time."""
    with ProgressBar(console, "timing", len(tasks)) as bar:
        for ended in execute(function, tasks, workers=1, timeout_s=OVERDUE):
            said = f"it took longer than {OVERDUE:g} s" if ended.death == "timeout" else ended.death
            console.print(f"[dim]timed {plain(str(tasks[ended.task]))}[/]", highlight=False)
            bar.advance()
            yield tasks[ended.task], [] if said else ended.value, said


def _counts(flag: str, text: str | None, usual: tuple[int, ...]) -> tuple[int, ...]:
    """Parses whole numbers above 0, separated by commas, and sorts them."""
    if text is None:
        return usual
    try:
        counts = sorted({int(word) for word in text.split(",")})
    except ValueError:
        counts = [0]
    if counts[0] < 1:
        raise InputError(f"{flag} {text}: expected whole numbers above 0, separated by commas")
    return tuple(counts)


def _listed(counts: Sequence[int]) -> str:
    return ",".join(map(str, counts))
