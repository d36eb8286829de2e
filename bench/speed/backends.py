"""`bench speed`: CPU time of every backend's step against the size of the map, beside references.

Each backend and size has a process of its own, one thread, one at a time, in which its references are timed too.
"""

import argparse
import dataclasses
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from rich.console import Console

from ...core.errors import InputError
from ...core.files import write_whole
from ..plan.spec import backend_variants
from ..plan.variant import BackendVariant
from ..words.console import ProgressBar, plain
from ..workers.tasks import execute
from .mrpt import built
from .process import Process, Stretch, Subject, lost, measure
from .ratios import Ratio, ratios
from .side_by_side import REFERENCE, Together, chosen, measure_together
from .tables import as_csv, backend_table, part_table, ratio_table, ratios_as_csv, reference_table, together_table
from .timing import TimingRow

BACKENDS = "ekf,ekf[compress_above=9999],ukf,invariant-ekf,fastslam[version=1],fastslam,smoother,isam2,fixed-lag"
"""those with a cost per step; `graph` has one at the end alone"""

OPTIONS = ("backend", "sizes", "particles", "sightings", "steps", "seconds", "scattered")  # the study's own options


class _Size(NamedTuple):
    sizes: tuple[int, ...]
    particles: tuple[int, ...]
    steps: int
    seconds: float


FULL = _Size((10, 30, 100, 300, 1000), (100, 1000, 10_000), 5000, 5.0)
QUICK = _Size((10, 30, 100), (100,), 200, 1.0)
SIGHTINGS = 6
OF_EACH = 0.5  # s of CPU; of a step's three ways with data association

OVERDUE = 1800.0  # s of wall clock after which a process is killed


def arguments(group: argparse._ArgumentGroup) -> None:  # pyright: ignore[reportPrivateUsage]
    """Adds the study's own options."""
    add = group.add_argument
    add("--backend", metavar="NAMES", help=f"as in bench run ({BACKENDS})")
    add("--sizes", metavar="N,...", help=f"landmarks on the map ({_listed(FULL.sizes)}; quick {_listed(QUICK.sizes)})")
    add(
        "--particles",
        metavar="M,...",
        help=f"of a backend that has them ({_listed(FULL.particles)}; quick {_listed(QUICK.particles)})",
    )
    add("--sightings", type=int, metavar="K", help=f"a step ({SIGHTINGS})")
    add("--steps", type=int, metavar="N", help=f"timed, at most ({FULL.steps}; quick {QUICK.steps})")
    add(
        "--seconds",
        type=float,
        metavar="S",
        help=f"of CPU, then timing stops ({FULL.seconds:g}; quick {QUICK.seconds:g}; --association: {OF_EACH:g})",
    )
    add(
        "--scattered",
        action="store_true",
        help="sight landmarks anywhere on the map, not the nearest: the worst case of a compressed filter",
    )


def study(namespace: argparse.Namespace, console: Console) -> list[Path]:
    """Measures and prints; returns the files written."""
    sizes, particles, extent = asked(namespace)
    variants = backend_variants(namespace.backend or BACKENDS)
    rows = _measured(list(_processes(variants, sizes, particles, extent)), console)
    together = _together(variants, sizes, extent, console)
    rows += [TimingRow("backend", v.label, size, reason=v.missing) for v in variants if v.missing for size in sizes]
    order = [variant.label for variant in variants]
    rows.sort(
        key=lambda row: (
            order.index(row.name) if row.kind == "backend" else len(order),
            row.particles or 0,
            row.landmarks,
        )
    )
    reached = ratios(rows, {variant.label: variant.options for variant in variants})
    which = "any landmarks of the map" if extent.scattered else "the nearest landmarks"
    title = f"{extent.sightings} sightings a step, of {which}, one thread"
    _print(rows, reached, title, console)
    if together:
        console.print(together_table(together, REFERENCE))
    return _written(namespace, rows, together, reached, title)


def asked(
    namespace: argparse.Namespace, sightings: int = SIGHTINGS, seconds: float | None = None
) -> tuple[tuple[int, ...], tuple[int, ...], Stretch]:
    """Returns numbers of landmarks and of particles, and the extent; InputError for invalid ones.

    `sightings` and `seconds` are the study's own, where none are given.
    """
    usual = QUICK if namespace.quick else FULL
    sizes = _counts("--sizes", namespace.sizes, usual.sizes)
    particles = _counts("--particles", namespace.particles, usual.particles)
    for flag in ("sightings", "steps"):
        count = getattr(namespace, flag)
        if count is not None and count < 1:
            raise InputError(f"--{flag} {count}: expected 1 or more")
    if namespace.seconds is not None and not 0 < namespace.seconds < float("inf"):
        raise InputError(f"--seconds {namespace.seconds:g}: expected a number above 0")
    extent = Stretch(
        namespace.steps or usual.steps,
        namespace.sightings or sightings,
        namespace.seconds or seconds or usual.seconds,
        namespace.seed,
        namespace.scattered,
    )
    return sizes, particles, extent


def _processes(
    variants: Sequence[BackendVariant], sizes: tuple[int, ...], particles: tuple[int, ...], extent: Stretch
) -> Iterator[Process]:
    """Yields one process per backend and size; with particles, one per number of these, with all sizes in it."""
    here = [variant for variant in variants if variant.builder is not None]
    for name in dict.fromkeys(variant.name for variant in here):
        mine = [variant for variant in here if variant.name == name]
        subjects = tuple(Subject(variant.label, variant.name, variant.options) for variant in mine)
        if "particles" in {field.name for field in dataclasses.fields(mine[0].options)}:
            for count in particles:
                yield Process(subjects, sizes, count, extent)
        else:
            for size in sizes:
                yield Process(subjects, (size,), None, extent)


def _measured(processes: Sequence[Process], console: Console) -> list[TimingRow]:
    rows: list[TimingRow] = []
    for process, found, death in executed(measure, processes, console):
        rows += lost(process, death) if death else found
    return rows


def _together(
    variants: Sequence[BackendVariant], sizes: Sequence[int], extent: Stretch, console: Console
) -> list[TimingRow]:
    """Measures what is timed in turns, one process per size; nothing where fewer than two are asked for."""
    subjects, rows = chosen(variants), list[TimingRow]()
    if not subjects:
        return rows
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        mrpt = built(Path(scratch))
        tasks = [Together(Process(subjects, (size,), None, extent), mrpt) for size in sizes]
        for task, found, death in executed(measure_together, tasks, console):
            rows += lost(task.process, death, "together") if death else found
    return rows


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


def _print(rows: Sequence[TimingRow], reached: Sequence[Ratio], title: str, console: Console) -> None:
    backends = [row for row in rows if row.kind == "backend"]
    for with_particles in (False, True):
        mine = [row for row in backends if (row.particles is not None) == with_particles]
        if mine:
            console.print(backend_table(mine, f"CPU time of a step, µs: {title}"))
    kinds = {row.kind for row in rows if row.timing is not None}
    if "reference" in kinds:
        console.print(reference_table(rows))
    if "part" in kinds:
        console.print(part_table(rows))
    if reached:
        console.print(ratio_table(reached))


def _written(
    namespace: argparse.Namespace,
    rows: Sequence[TimingRow],
    together: Sequence[TimingRow],
    reached: Sequence[Ratio],
    title: str,
) -> list[Path]:
    written, every = list[Path](), [*rows, *together]
    if namespace.csv is not None:
        write_whole(namespace.csv, as_csv(every))
        written.append(namespace.csv)
    if namespace.out is not None:
        from .figure import write_figure

        table, compared, picture = (namespace.out / name for name in ("backends.csv", "ratios.csv", "backends.png"))
        write_whole(table, as_csv(every))
        write_whole(compared, ratios_as_csv(reached))
        written += [table, compared]
        if write_figure(picture, rows, title):
            written.append(picture)
    return written


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
