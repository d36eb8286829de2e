"""Reads and writes a log as a folder of text files, restored bit for bit.

    log.toml         name, prior, truth kind, notes: sensor settings, source and licence
    odometry.csv     t,dx,dy,dtheta,cxx,cxy,cxt,cyy,cyt,ctt          one row per step; step 0 has only t
    sightings.csv    step,id,range,bearing,crr,crb,cbb[,true_id]     one row per sighting, sorted by step;
                                                                     optional beside one of the next three
    signatures.csv   signature,css                                   a third number of each row of sightings.csv, and
                                                                     its variance; optional
    ranges.csv       step,id,range,crr[,true_id]                     a range alone, and
    bearings.csv     step,id,bearing,cbb[,true_id]                   a bearing alone, sorted by step; optional
    fixes.csv        step,x,y,heading,cxx,cxy,cxt,cyy,cyt,ctt[,arm_x,arm_y]
                                                                     of the pose in the world, blank where not measured,
                                                                     and the antenna's place in the body frame; optional
    gyro.csv         step,turn,var,dt,walk                           turns by a gyro since the step before, at most one
                                                                     a step, sorted: see `core.gyro`; optional
    loops.csv        step,to,dx,dy,dtheta,cxx,cxy,cxt,cyy,cyt,ctt[,false]
                                                                     one row per loop closure, sorted by step; optional
    truth.tum        t x y z qx qy qz qw                             optional
    landmarks.csv    id,x,y[,moving]                                 the landmarks' true positions; optional
    relations.csv    true motions between poses beside steps         optional: see `core.relations.COLUMNS`
    scans.npz        laser scans, for maps and pictures              optional: see `beside_file`
    clouds.npz       clouds of a depth camera, for the same          optional

Covariances are stored as upper triangles. Notes that are None, and the covariance of a true map, are left out. The
table [contents] of log.toml has the number of rows and the digests of the files' contents, both optional: changed files
are refused. A loop closure that is known to be false has 1 in the column false, others 0. A table [sensor] with x, y,
yaw and delay says that sightings.csv is of a sensor mounted so, not of the body; it is never written. A table
[systematic] has the standard deviations of errors that are constant: range_scale, range_offset (m), heading_offset
(rad) and wheel_scale, and `each = true` where every landmark has its own of ranges. A table [gyro] has the mean and the
standard deviation of a gyro's bias before its first turn, rad/s: bias and bias_sd, 0 where not given.
"""

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.beside import KINDS
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Truth
from ...core.factors.check import LOOPS, ODOMETRY, SIGHTINGS, SIGNATURES, check, problems
from ...core.files import beside, number_rows
from ...core.mounting import NONE
from ...core.options import option
from ...core.scan import Scan, attempted, counted, strict
from ...core.se2 import Array, Ints
from ...core.small_matrices import symmetric, upper
from ...core.table import Table, scan_csv
from ...core.toml.table import TomlTable
from ...core.truth.check import check_truth, relation_problems
from ..registry import Named, Source
from ..truth import PLACES, POSES, RELATIONS, digest, scan_truth, write_truth
from .beside_file import read_beside, write_beside
from .log_toml import FILES, NOWHERE, Contents, Words, check_words, scan_words, write_words
from .part_tables import PARTS, TRUE_ID, as_read, columns_of, rows_of, scan_parts
from .steps import by_step

WORDS = "log.toml"
FALSE = ("false",)
SIGNATURES_FILE = "signatures.csv"

_NOBODY = Words(TomlTable.parse(WORDS, ""), "", NOWHERE, None, {}, Contents(), NONE)
"""Replaces an unreadable log.toml, so that the other files can be checked."""

_ACCEPT = "restore it, or delete [contents] from log.toml to accept the change"


@dataclass(frozen=True)
class Options(Named):
    """Which log."""

    path: str | None = option(None, "the folder of the log")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Your own log, from a folder of readable CSV files: log[path=FOLDER]."""
    if options.path is None:
        raise InputError("option path of dataset log is not given, expected the folder of a log: log[path=FOLDER].")
    return read(Path(options.path))


source = Source(make, Options)


def write(folder: Path, log: Log, truth: Truth | None) -> None:
    """Writes `log` and, if given, its `truth` to `folder`, which must not exist or be empty.

    The folder appears complete or not at all. InputError if it cannot be written, or the log is unusable.
    """
    check_writable(log, truth)
    part = beside(folder)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: exists and is not an empty folder; expected a new place for the log.")
        part.mkdir(parents=True)
        _write_files(part, log, truth)
        os.replace(part, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def check_writable(log: Log, truth: Truth | None) -> None:
    """Raises InputError if `log` and `truth` are unusable, or their name or notes cannot be stored."""
    check_words(log)
    where = f"log {log.name}"
    check(log, where)
    if truth is not None:
        check_truth(log, truth, where)


def read(folder: Path) -> Dataset:
    """Reads the log and ground truth in `folder`; InputError names the file, line and column of what is invalid."""
    dataset = strict(scan(folder))
    assert dataset is not None  # None only after a fault
    return dataset


def scan(folder: Path) -> Scan[Dataset | None]:
    """Scans as `read` reads, yielding every fault of every file. After one the result is unusable."""
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder, expected that of a log.")
    (dataset, words), faults = yield from counted(_scan_files(folder))
    if dataset is None:
        return None
    if not faults:
        yield from _scan_changes(words, _contents(*dataset))
        if words.sensor != NONE:
            dataset = dataset._replace(log=dataset.log.of_sensor(words.sensor))
    found: dict[str, Any] = {}
    for kind in KINDS:
        found[kind] = yield from attempted(_scan_beside(folder, kind, len(dataset.log)))
    return dataset._replace(log=replace(dataset.log, **found))


def _scan_beside(folder: Path, kind: str, steps: int) -> Scan[Any]:
    yield from ()
    return read_beside(folder, kind, steps)


def _scan_files(folder: Path) -> Scan[tuple[Dataset | None, Words]]:
    """The log and the ground truth, and the content of log.toml."""
    words = (yield from attempted(_scan_words(folder))) or _NOBODY
    odometry = yield from attempted(scan_csv(folder / "odometry.csv", ODOMETRY, blank_after=1))
    sightings = _empty(folder / "sightings.csv", SIGHTINGS)
    if os.path.lexists(sightings.path) or not any(os.path.lexists(folder / file) for file in PARTS):
        sightings = yield from attempted(scan_csv(sightings.path, SIGHTINGS, TRUE_ID))
    loops = _empty(folder / "loops.csv", LOOPS)
    if os.path.lexists(loops.path):
        loops = yield from attempted(scan_csv(loops.path, LOOPS, FALSE))
    if odometry is not None and not len(odometry.rows):
        yield InputError(f"{odometry.path}: found no steps, expected at least one row.")
    for table in (odometry, sightings, loops):
        if table is not None:
            yield from _scan_rows(words, {table.path.name: len(table.rows)})
    if odometry is None or not len(odometry.rows):
        yield from scan_truth(folder)
        return None, words
    sightings = sightings or _empty(folder / "sightings.csv", SIGHTINGS)
    loops = loops or _empty(folder / "loops.csv", LOOPS)
    signed = yield from attempted(_scan_signatures(folder / SIGNATURES_FILE, sightings, words))
    true_id = TRUE_ID if sightings.columns[-1:] == TRUE_ID else ()
    sightings = yield from by_step(sightings, len(odometry.rows), "id", *true_id)
    told = loops.columns[-1:] == FALSE
    loops = yield from by_step(loops, len(odometry.rows), "to", *(FALSE if told else ()))
    if signed is not None and len(signed.rows) != len(sightings.rows):
        signed = None  # rows of sightings.csv have faults, and were left out
    parts = yield from scan_parts(folder, len(odometry.rows), words.prior.gyro)
    yield from _scan_rows(words, parts.counts)
    tables = {"odometry": odometry, "sightings": sightings, "loops": loops}
    log = Log.from_arrays(
        words.name,
        words.prior,
        t=odometry.rows[:, 0],
        delta=odometry.rows[:, 1:4],
        delta_cov=symmetric(odometry.rows[:, 4:]),
        sighting_step=sightings.whole("step"),
        ids=sightings.whole("id"),
        z=sightings.rows[:, 2:4],
        z_cov=symmetric(sightings.rows[:, 4:7]),
        loop_step=loops.whole("step"),
        loop_to=loops.whole("to"),
        loop_delta=loops.rows[:, 2:5],
        loop_cov=symmetric(loops.rows[:, 5 : len(LOOPS)]),
        partial=parts.partial,
        fixes=parts.fixes,
        gyro=parts.gyro,
        signature=None if signed is None else signed.rows[:, 0],
        signature_var=None if signed is None else signed.rows[:, 1],
        notes=words.notes,
    )
    log = replace(log, lines={name: tables[name].lines_of() for name in tables})
    broken = set(odometry.broken.tolist())
    tables |= {} if signed is None else {"signatures": signed}
    for problem in problems(log):
        if problem.table == "prior":
            yield words.file.refused("prior", f"{problem.message}.")
        elif problem.table not in tables:
            yield parts.fault(problem)
        elif problem.table != "odometry" or problem.row not in broken:
            yield tables[problem.table].fault(problem.row, problem.message)
    truth = yield from scan_truth(folder, None if broken else log.t)
    assigned = sightings.whole(*true_id) if true_id else None
    false = (yield from _scan_false(loops)) if told else None
    if truth is None and words.truth_kind is None and all(one is None for one in (assigned, parts.assigned, false)):
        return Dataset(log, None), words
    for column in (assigned, false):
        if column is not None:
            column.flags.writeable = False
    truth = truth or Truth(np.zeros(0), np.zeros((0, 3)), None, None, "truth")
    truth = truth._replace(assigned=assigned, kind=words.truth_kind or truth.kind, false_loops=false)
    truth = truth._replace(assigned_partial=parts.assigned)
    if truth.relations is not None:
        for message in relation_problems(log, truth.relations):
            yield InputError(f"{folder / RELATIONS}: {message}.")
    return Dataset(log, truth), words


def _scan_words(folder: Path) -> Scan[Words | None]:
    """The metadata, or a fault that tells a user with other CSV files how to read them."""
    if os.path.lexists(folder / WORDS):
        return (yield from scan_words(folder / WORDS))
    of_others = "in the folder of a log; CSV files of other columns are read by csv[odometry=FILE]"
    yield InputError(f"{folder / WORDS}: there is no such file, expected it {of_others}.")
    return None


def _empty(path: Path, columns: tuple[str, ...]) -> Table:
    return Table(path, columns, np.zeros((0, len(columns))), np.zeros(0, np.int64))


def _scan_signatures(path: Path, sightings: Table, words: Words) -> Scan[Table | None]:
    """The signatures of the sightings; None if there are none, or some have faults."""
    if not os.path.lexists(path):
        return None
    table = yield from scan_csv(path, SIGNATURES)
    yield from _scan_rows(words, {path.name: len(table.rows)})
    rows, wanted = len(table.rows), len(sightings.rows)
    if rows != wanted:
        yield InputError(f"{path}: found {rows} rows, expected {wanted}, one for each row of {sightings.path.name}.")
    return table if rows == wanted and not len(table.broken) else None


def _scan_false(loops: Table) -> Scan[Ints]:
    """The rows of loop closures that are known to be false."""
    flag = loops.column("false")
    for row in np.flatnonzero((flag != 0) & (flag != 1)):
        yield loops.fault(row, f"false is {flag[row]!s}, expected 0 or 1")
    return np.flatnonzero(flag == 1)


def _scan_changes(words: Words, found: Contents) -> Scan[None]:
    """Yields a fault for each file that no longer matches log.toml's digests."""
    yield from _scan_rows(words, {file: found.rows.get(file, 0) for file in words.contents.rows})
    also = "".join(f", or {file}" for file in FILES[3:8] if file in found.rows)
    parts = {
        "factors": "prior, odometry.csv, sightings.csv or loops.csv" + also,
        "truth": "truth.tum, landmarks.csv, relations.csv, true_id or false",
    }
    for key, parts_of_it in parts.items():
        was, now = getattr(words.contents, key), getattr(found, key)
        if was is not None and was != now:
            differs = f"contents.{key} is {was[:12]!r}, but the digest is now {(now or 'none')[:12]!r}"
            yield words.file.at(("contents", key), f"{differs}: {parts_of_it} has changed; {_ACCEPT}.")


def _scan_rows(words: Words, found: Mapping[str, int]) -> Scan[None]:
    for file, rows in found.items():
        if (was := words.contents.rows.get(file, rows)) != rows:
            said = f"contents.rows has {was} for {file}, which has {rows} rows; {_ACCEPT}."
            yield words.file.at(("contents", "rows", file), said)


def _contents(log: Log, truth: Truth | None) -> Contents:
    """The digests and row counts of the files of this log."""
    rows = {"odometry.csv": len(log), "sightings.csv": len(log.ids), "loops.csv": len(log.loop_to)}
    rows |= rows_of(log) | ({} if log.signatures is None else {SIGNATURES_FILE: len(log.signatures)})
    if truth is None:
        return Contents(rows, log.digest)
    places = 0 if truth.map is None else len(truth.map.ids)
    rows |= {POSES: len(truth.t), PLACES: places}
    rows |= {} if truth.relations is None else {RELATIONS: len(truth.relations.delta)}
    return Contents(rows, log.digest, digest(truth))


def _write_files(folder: Path, log: Log, truth: Truth | None) -> None:
    """Writes every file of the log into an empty folder."""
    motions, sighted, looped = upper(log.delta_cov), upper(log.z_cov), upper(log.loop_cov)
    head = ",".join(ODOMETRY) + f"\n{log.t[0]!s}" + "," * (len(ODOMETRY) - 1)
    _write_rows(folder / "odometry.csv", head, [column[1:] for column in (log.t, *log.delta.T, *motions)])
    columns, head = [log.sighting_step, log.ids, *log.z.T, *sighted], ",".join(SIGHTINGS)
    if truth is not None and truth.assigned is not None:
        columns, head = [*columns, truth.assigned], ",".join((*SIGHTINGS, *TRUE_ID))
    _write_rows(folder / "sightings.csv", head, columns)
    if log.signatures is not None:
        _write_rows(folder / SIGNATURES_FILE, ",".join(SIGNATURES), [log.signatures.s, log.signatures.var])
    if len(log.loop_to):
        columns, head = [log.loop_step, log.loop_to, *log.loop_delta.T, *looped], ",".join(LOOPS)
        if truth is not None and truth.false_loops is not None:
            false = np.isin(np.arange(len(log.loop_to)), truth.false_loops).astype(np.int64)
            columns, head = [*columns, false], ",".join((*LOOPS, *FALSE))
        _write_rows(folder / "loops.csv", head, columns)
    true = None if truth is None else truth.assigned_partial
    for file, (names, of_parts) in columns_of(log, true).items():
        _write_rows(folder / file, ",".join(names), of_parts)
    write_beside(folder, log)
    # As it will be read: symmetric covariances, and of step 0 nothing but t.
    parts, true = as_read(log, true)
    log = replace(
        log, delta_cov=symmetric(motions.T), z_cov=symmetric(sighted.T), loop_cov=symmetric(looped.T), **parts
    )
    log = log.head(len(log))
    if truth is not None:
        write_truth(folder, truth)
        again = strict(scan_truth(folder, log.t)) or Truth(np.zeros(0), np.zeros((0, 3)), None, None, "truth")
        assigned = None if truth.assigned is None else np.asarray(truth.assigned, np.int64)
        truth = again._replace(assigned=assigned, kind=truth.kind, false_loops=truth.false_loops)
        truth = truth._replace(assigned_partial=true)
    write_words(folder / WORDS, log, None if truth is None else truth.kind, _contents(log, truth))


def _write_rows(path: Path, head: str, columns: Sequence[Array | Ints]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(head + "\n")
        file.writelines(number_rows(columns))
