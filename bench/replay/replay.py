"""Repeats a recorded run: its log is made again, and every backend driven through it once more.

The record has paths and the final map, but not how the map evolved. So each backend is asked along the way, and its
path must be the recorded one to the last bit; where it is not, the replay says so.
"""

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ...core.arrays import numbered
from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.se2 import Array, Ints
from ...datasets import archive
from ..engine.batches import job_of
from ..engine.log_files import LogFiles
from ..plan.plan import Cell
from ..plan.reference import made_with_reference
from ..plan.spec import pieces
from ..plan.variant import Variant
from ..plan.work import PlannedCell, Work, recorded
from ..record.schema import Row
from ..record.store import Store
from ..words.names import called
from ..words.numerals import counted, listed
from ..words.reason import reason
from ..words.styles import Look, looks
from ..workers.tasks import execute
from . import course as replay_cell
from .course import Course, Landmarks, moments

V = TypeVar("V", bound=Variant)


class Part(NamedTuple):
    """A backend's part in a replay."""

    label: str
    look: Look
    course: Course
    step_us: Array  # (n,) recorded CPU time of each step, NaN where there is none
    remark: str  # for the viewer, "" for none
    repeated: bool  # False where its path is not the recorded one, or that cannot be read


class Replay(NamedTuple):
    """A log and the backends' courses."""

    dataset: str  # label
    seed: int
    log: Dataset
    timed: bool  # its times are seconds, and do not number its steps
    frames: Ints  # (f,) the steps that are shown
    reckoned: Array  # (n, 3)
    parts: Sequence[Part]

    @property
    def known(self) -> str:
        """The path that errors are measured from: "truth", "reference" (batch optimum), or "" for neither."""
        truth = self.log.truth
        return truth.kind if truth is not None and len(truth.t) else ""


class ReplayRequest(NamedTuple):
    """The cells of one log."""

    work: Work
    cells: Sequence[Cell]
    seed: int
    others: Sequence[str]  # the datasets of the run that were not chosen
    rows: dict[tuple[str, str, str, str, int], Row]  # the record's, by the cell's key


def choose(store: Store, dataset: str | None, names: str | None, seed: int | None) -> ReplayRequest:
    """Selects cells: of the named dataset, else the first, and the named backends, else all. InputError else."""
    work = recorded(store)
    rows = {row.key: row for row in store.cells()}
    datasets = list(dict.fromkeys(cell.cell.dataset for cell in work.cells))
    backends = list(dict.fromkeys(cell.cell.backend for cell in work.cells))
    chosen = datasets[0] if dataset is None else _named(dataset, datasets, "--dataset")
    wanted = [_named(name, backends, "--backend") for name in pieces(names, "--backend")] if names else backends
    cells = [c.cell for c in work.cells if c.cell.dataset == chosen and c.cell.backend in wanted]
    done = {cell.seed for cell in cells if cell.key in rows and rows[cell.key].columns["status"] == "done"}
    seeds = sorted({cell.seed for cell in cells})
    if seed is None:
        seed = min(done, default=seeds[0])
    if seed not in seeds:
        there = listed([str(number) for number in seeds])
        raise InputError(f"--seed {seed}: this run has no such log of {chosen.label}, expected {there}.")
    shown = [_cell(cells, backend, seed) for backend in dict.fromkeys(wanted)]
    others = [other.label for other in datasets if other != chosen]
    return ReplayRequest(work, [cell for cell in shown if cell is not None], seed, others, rows)


def replay(store: Store, request: ReplayRequest, frames: int, workers: int) -> Replay:
    """Repeats the cells on their log, at most `frames` steps shown; InputError where the log has changed."""
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        path = Path(scratch) / "log.npz"
        n = _steps(store, request, path)
        shown = np.unique(np.linspace(0, n - 1, min(frames, n)).round().astype(np.int64))
        look = looks(cell.cell.backend.label for cell in request.work.cells)
        parts = list(_parts(store, request, path, shown, workers))
        log = archive.load(path)  # not before: those who repeat it have it in memory, too
    labels = [cell.backend.label for cell in request.cells]
    named = [Part(name, look[name], *told) for name, told in zip(labels, parts, strict=True)]
    datasets = [cell.cell.dataset.label for cell in request.work.cells]
    name = called(datasets)[request.cells[0].dataset.label]
    timed = request.cells[0].log.dataset.source.seeded or not numbered(log.log.t)  # a world may have a step a second
    return Replay(name, request.seed, log, timed, shown, log.log.dead_reckoned(), named)


def _steps(store: Store, request: ReplayRequest, path: Path) -> int:
    """Archives the cells' log at `path`, read or made; returns its length. InputError if it is not the recorded one."""
    cell = request.cells[0]
    dataset, given = cell.dataset, request.work.map
    of = next((planned.log for planned in store.planned() if planned.key == cell.key), None)
    if of is None:
        raise InputError(
            f"{store.folder}: {dataset.label} with {cell.backend.label}, seed {cell.seed}, is not in its record's "
            "plan, expected every cell of the run."
        )
    before = store.logs().get(of)
    made = None if before is None else LogFiles(store.folder).read(cell.log.dataset.name, before)
    if made is None:
        known = None if given is None else given.of(dataset, request.seed)
        start = "known" if given is None else given.start
        log = cell.log
        made = made_with_reference(log.dataset.name, log.dataset.options, log.seed, known, start)
    if before is not None and made.log.digest != before.digest:
        raise InputError(
            f"{store.folder}: {dataset.label}, seed {request.seed}, has changed since this run: its "
            f"digest is {made.log.digest[:12]}, expected {before.digest[:12]}; run it into a new folder to replay it."
        )
    archive.save(path, made)
    return len(made.log)


def _parts(
    store: Store, request: ReplayRequest, path: Path, frames: Ints, workers: int
) -> Iterator[tuple[Course, Array, str, bool]]:
    able = [cell for cell in request.cells if cell.backend.builder is not None]
    jobs = [job_of(request.work, PlannedCell(cell, {})) for cell in able]
    tasks = [replay_cell.ReplayTask(job, path, frames) for job in jobs]
    courses: dict[Cell, Course] = {}
    for ended in execute(replay_cell.run, tasks, workers=workers, timeout_s=request.work.timeout_s):
        courses[able[ended.task]] = ended.value or _none("took too long" if ended.death == "timeout" else ended.death)
    for cell in request.cells:
        course = courses.get(cell) or _none(cell.backend.missing)
        row = request.rows.get(cell.key)
        arrays = _recorded(store, row)
        step_us = arrays["step_ns"] / 1e3 if "step_ns" in arrays else np.full(int(frames[-1]) + 1, np.nan)
        differs = "" if row is None else _difference(course, row, arrays)
        remarks = [*_remarks(course, row, len(frames)), *[differs] * bool(differs)]
        yield course, step_us, "; ".join(remarks), not differs


def _recorded(store: Store, row: Row | None) -> dict[str, Any]:
    """Reads the cell's recorded paths and costs; {} where there are none, or none that can be read."""
    with contextlib.suppress(InputError):
        return {} if row is None else store.arrays(row, ("online", "final", "step_ns"))
    return {}


def _none(why: str) -> Course:
    return Course(np.zeros((0, 3)), np.zeros((0, 3, 3)), list[Landmarks](), 0, False, why, [])


def _remarks(course: Course, row: Row | None, frames: int) -> Iterator[str]:
    if course.ended:
        ended = reason(course.ended)
        yield f"stops after {counted(len(course.path), 'step')}: {ended}" if len(course.path) else ended
    elif course.final:
        yield "no online path: the final one is shown"
    if course.asked < len(course.maps):
        yield f"its map was asked for at {course.asked} of {counted(frames, 'frame')}, as it is slow"
    if course.revised and len(course.revised) < len(moments(frames)):
        yield f"its grid is drawn at {counted(len(course.revised), 'frame')}, as its smoothed path is slow"
    if row is None:
        yield "not in the record yet, so there is nothing to compare with"
    elif row.columns["status"] != "done" and not course.ended:
        yield f"ended as {row.columns['status']} in the run, and reached the end this time"


def _difference(course: Course, row: Row, arrays: dict[str, Any]) -> str:
    """Compares the path with the recorded one to the last bit; "" where they are the same, or none was recorded."""
    recorded = arrays.get("final" if course.final else "online")
    if recorded is None:
        could_not = "NOT COMPARED: the recorded path is not there, or cannot be read"
        return could_not if row.columns["status"] == "done" else ""
    if recorded.tobytes() == course.path.tobytes():
        return ""
    both = min(len(course.path), len(recorded))
    apart = np.flatnonzero((course.path[:both] != recorded[:both]).any(axis=1))
    if not len(apart):
        return f"NOT THE RECORDED PATH: that has {counted(len(recorded), 'step')}"
    far = float(np.hypot(*(course.path[:both] - recorded[:both])[:, :2].T).max())
    return f"NOT THE RECORDED PATH: another from step {apart[0]} on, by up to {far:.2g} m"


def _cell(cells: Sequence[Cell], backend: Variant, seed: int) -> Cell | None:
    """Finds the backend's cell on the log; the only one where log and backend are the same for all seeds."""
    own = [cell for cell in cells if cell.backend == backend]
    same = [cell for cell in own if cell.seed == seed]
    return next(iter(same or [cell for cell in own if not cell.dataset.numbered]), None)


def _named(name: str, there: Sequence[V], flag: str) -> V:
    """Finds the variant of that label, or of that name in tables, or the only one of that name."""
    names = called([v.label for v in there])
    found = [v for v in there if name in (v.label, names[v.label])] or [v for v in there if v.name == name]
    if len(found) == 1:
        return found[0]
    labels = listed([variant.label for variant in (found or there)])
    wrong = "is ambiguous in this run" if found else "is not in this run"
    raise InputError(f"{flag} {name}: {wrong}, expected {'one of ' * (len(found or there) > 1)}{labels}.")
