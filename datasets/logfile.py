"""A log as a folder that a person can read and a spreadsheet can open; what is written reads back bit for bit.

    log.toml         name, prior, truth kind, notes: sensor settings, source and licence
    odometry.csv     t,dx,dy,dtheta,cxx,cxy,cxt,cyy,cyt,ctt          a row a step; of step 0 only t is filled in
    sightings.csv    step,id,range,bearing,crr,crb,cbb[,true_id]     a row a sighting, sorted by step
    loops.csv        step,to,dx,dy,dtheta,cxx,cxy,cxt,cyy,cyt,ctt    a row a loop closure, sorted by step; optional
    truth.tum        t x y z qx qy qz qw                             optional
    landmarks.csv    id,x,y                                          the landmarks' true places; optional

Of a covariance the upper triangle is stored: one whose halves differ in the last digits is stored as their mean. Notes
that are None, and the covariance of a true map, are left out.
"""

import os
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..frontend.check import LOOPS, ODOMETRY, SIGHTINGS, check, problems
from ..frontend.errors import InputError
from ..frontend.factors import Dataset, Log, Truth
from ..frontend.options import option
from ..frontend.se2 import Ints
from ..frontend.table import Table, read_csv, symmetric, upper
from .logwords import read_words, write_words
from .registry import Source
from .truth import POSES, read_truth, write_truth

TRUE_ID = ("true_id",)


@dataclass(frozen=True)
class Options:
    """Which log."""

    path: str | None = option(None, "the folder of the log")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - a file is the same for everybody
    """A log of your own, from a folder of CSV files that a person can read: log[path=FOLDER]."""
    if options.path is None:
        raise InputError("option path of dataset log is not given, expected the folder of a log: log[path=FOLDER].")
    return read(Path(options.path))


source = Source(make, Options)


def write(folder: Path, log: Log, truth: Truth | None) -> None:
    """Write `log` and, where there is one, its `truth` to `folder`, which must not exist or be empty.

    The folder appears complete or not at all. InputError where it cannot be written, or the log not be used.
    """
    check(log, where=f"log {log.name}")
    beside = folder.absolute().parent / f".{folder.absolute().name}.{os.getpid()}.part"
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: exists and is not an empty folder; expected a new place for the log.")
        beside.mkdir(parents=True)
        _write_files(beside, log, truth)
        os.replace(beside, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def read(folder: Path) -> Dataset:
    """The log and truth in `folder`; InputError names the file, line and column of whatever cannot be used."""
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder, expected that of a log.")
    words = read_words(folder / "log.toml")
    odometry = read_csv(folder / "odometry.csv", ODOMETRY, blank_after=1)
    if not len(odometry.rows):
        raise InputError(f"{odometry.path}: there is no step, expected at least one row.")
    sightings = read_csv(folder / "sightings.csv", SIGHTINGS, TRUE_ID)
    loops = read_csv(folder / "loops.csv", LOOPS) if (folder / "loops.csv").exists() else None
    steps = len(odometry.rows)
    log = Log.from_arrays(
        words.name,
        words.prior,
        t=odometry.rows[:, 0],
        delta=odometry.rows[:, 1:4],
        delta_cov=symmetric(odometry.rows[:, 4:]),
        sighting_step=_steps(sightings, steps),
        ids=sightings.whole("id"),
        z=sightings.rows[:, 2:4],
        z_cov=symmetric(sightings.rows[:, 4:7]),
        loop_step=None if loops is None else _steps(loops, steps),
        loop_to=None if loops is None else loops.whole("to"),
        loop_delta=None if loops is None else loops.rows[:, 2:5],
        loop_cov=None if loops is None else symmetric(loops.rows[:, 5:]),
        notes=words.notes,
    )
    tables = {"odometry": odometry, "sightings": sightings, "loops": loops}
    for problem in problems(log):
        table = tables.get(problem.table)
        if table is None or problem.row >= len(table.lines):
            file = "log.toml" if problem.table == "prior" else f"{problem.table}.csv"
            raise InputError(f"{folder / file}: {problem.message}.")
        raise table.fault(problem.row, problem.message)
    return Dataset(log, _truth(folder, words.truth_kind, log, sightings))


def _write_files(folder: Path, log: Log, truth: Truth | None) -> None:
    """Every file of the log, into an empty folder."""
    write_words(folder / "log.toml", log, None if truth is None else truth.kind)
    odometry = zip(log.t.tolist(), *log.delta.T.tolist(), *upper(log.delta_cov).tolist(), strict=True)
    rows = [",".join(map(repr, row)) for row in odometry]
    rows[0] = f"{log.t[0]!s}" + "," * (len(ODOMETRY) - 1)
    _write_lines(folder / "odometry.csv", ODOMETRY, rows)

    assigned = None if truth is None else truth.assigned
    columns = [log.sighting_step.tolist(), log.ids.tolist(), *log.z.T.tolist(), *upper(log.z_cov).tolist()]
    columns += [] if assigned is None else [assigned.tolist()]
    header = SIGHTINGS if assigned is None else SIGHTINGS + TRUE_ID
    _write_lines(folder / "sightings.csv", header, (",".join(map(repr, row)) for row in zip(*columns, strict=True)))

    if len(log.loop_to):
        columns = [
            log.loop_step.tolist(),
            log.loop_to.tolist(),
            *log.loop_delta.T.tolist(),
            *upper(log.loop_cov).tolist(),
        ]
        _write_lines(folder / "loops.csv", LOOPS, (",".join(map(repr, row)) for row in zip(*columns, strict=True)))
    if truth is not None:
        write_truth(folder, truth)


def _write_lines(path: Path, header: Sequence[str], rows: Iterable[str]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(header) + "\n")
        file.writelines(row + "\n" for row in rows)


def _truth(folder: Path, kind: Literal["truth", "reference"] | None, log: Log, sightings: Table) -> Truth | None:
    found = read_truth(folder)
    assigned = sightings.whole(*TRUE_ID) if sightings.columns[-1:] == TRUE_ID else None
    if found is None and kind is None and assigned is None:
        return None
    truth = found or Truth(np.zeros(0), np.zeros((0, 3)), None, None, "truth")
    strangers = truth.t[~np.isin(truth.t, log.t)]
    if len(strangers):
        raise InputError(f"{folder / POSES}: t is {strangers[0]!s}, expected only times that odometry.csv has.")
    if assigned is not None:
        assigned.flags.writeable = False
    return truth._replace(assigned=assigned, kind=kind or "truth")


def _steps(table: Table, steps: int) -> Ints:
    """The column `step`: sorted, and each the number of a step."""
    step = table.whole("step")
    for row in np.flatnonzero((step < 0) | (step >= steps)):
        raise table.fault(row, f"step is {step[row]}, expected 0 to {steps - 1}, the steps that odometry.csv has")
    for row in np.flatnonzero(np.diff(step) < 0) + 1:
        raise table.fault(row, f"step is {step[row]} after {step[row - 1]}, expected rows sorted by step")
    return step
