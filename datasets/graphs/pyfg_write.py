"""Writes a log with its truth as a graph in PyFG's format; it reads back with the same factors, up to rounding.

What the format cannot represent is left out: the name, the notes, constant errors, which loops are false, and sightings
whose landmark is unknown. Bearings alone, and fixes that are not of a whole pose, are refused.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...core.coordinates import after_motion, as_points
from ...core.errors import InputError
from ...core.factors import Dataset, Log
from ...core.factors.check import check
from ...core.files import replaced
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ...core.small_matrices import upper
from ...core.truth.errors import rows_of
from ..formats.graph_parts import check_parts

POSE, POINT = "A", "L"


def write_pyfg(path: Path, dataset: Dataset) -> int:
    """Writes the log and its truth to `path` atomically; returns the number of sightings left out.

    InputError for a given map, bearings alone, fixes of a part of a pose, and where a pose or a landmark has no true
    place: the format has no other.
    """
    log, truth = dataset
    check(log, where=f"log {log.name}")
    if log.prior.map is not None:
        raise InputError(f"{path}: log {log.name} has a given map, which a PyFG file cannot represent.")
    check_parts(path, log, "PyFG file", RANGE)
    left_out, log = log.unknown, log.identified()
    pose = np.full(len(log), -1) if truth is None or truth.kind != "truth" else rows_of(truth.t, log.t)
    for step in np.flatnonzero(pose < 0):
        raise InputError(
            f"{path}: log {log.name} has no true pose of step {step}, expected that of all in a PyFG file; g2o and "
            "jrl need none."
        )
    assert truth is not None
    ids = np.unique(log.seen)
    place = np.full(len(ids), -1) if truth.map is None else rows_of(truth.map.ids, ids)
    for row in np.flatnonzero(place < 0):
        raise InputError(f"{path}: log {log.name} has no true place of landmark {ids[row]}, expected that of all.")
    places = np.zeros((0, 2)) if truth.map is None else truth.map.xy[place]
    try:
        with replaced(path) as part, part.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(_rows("VERTEX_SE2", log.t, (POSE, np.arange(len(log))), *truth.poses[pose].T))
            file.writelines(_rows("VERTEX_XY", None, (POINT, ids), *places.T))
            file.writelines(_factors(log))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from error
    return left_out


def _factors(log: Log) -> Iterator[str]:
    """The prior, the odometry, the loop closures and the sightings."""
    pose, cov, n = log.prior.pose[None], log.prior.cov[None], np.arange(len(log))
    yield from _rows("VERTEX_SE2:PRIOR", log.t[:1], (POSE, n[:1]), *pose.T, *upper(after_motion(pose, cov)))
    if (one := log.fixes) is not None:
        cov, step = after_motion(one.z, one.cov), one.step
        yield from _rows("VERTEX_SE2:PRIOR", log.t[step], (POSE, step), *one.z.T, *upper(cov))
    cov = after_motion(log.delta[1:], log.delta_cov[1:])
    yield from _rows("EDGE_SE2", log.t[1:], (POSE, n[:-1]), (POSE, n[1:]), *log.delta[1:].T, *upper(cov))
    ends = (POSE, log.loop_to), (POSE, log.loop_step)
    cov = after_motion(log.loop_delta, log.loop_cov)
    yield from _rows("EDGE_SE2", log.t[log.loop_step], *ends, *log.loop_delta.T, *upper(cov))
    xy, cov = as_points(log.z, log.z_cov)
    step = log.sighting_step
    yield from _rows("EDGE_SE2_XY", log.t[step], (POSE, step), (POINT, log.ids), *xy.T, *upper(cov))
    if (one := log.partial) is not None:
        yield from _rows("EDGE_RANGE", log.t[one.step], (POSE, one.step), (POINT, one.ids), one.z, one.var)


def _rows(tag: str, t: Array | None, *columns: Array | tuple[str, Ints]) -> Iterator[str]:
    """Lines of a tag, a time and the columns: numbers, or names by their letter and numbers."""
    words = list[list[str]]()
    for column in (*columns,) if t is None else (t, *columns):
        if isinstance(column, tuple):
            letter, numbers = column
            words.append([f"{letter}{number}" for number in numbers.tolist()])
        else:
            words.append([repr(number) for number in column.tolist()])
    return (f"{tag} {' '.join(row)}\n" for row in zip(*words, strict=True))
