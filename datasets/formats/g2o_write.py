"""Writes a log as a graph in g2o's format; it reads back, except for what the format cannot represent.

That is the times, the name, the notes and constant errors, and sightings whose landmark is unknown. Ranges alone are
refused, and fixes that are not of a whole pose or of x and y. Numbers are restored bit for bit; a covariance is written
as information, and restored up to rounding times its condition. The file has no comments: gtsam.readG2o finds no factor
at all in one that begins with a comment.
"""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ...core.coordinates import after_motion, as_points
from ...core.elementary import sincos
from ...core.errors import InputError
from ...core.factors import UNKNOWN, Log
from ...core.factors.check import check
from ...core.files import number_rows
from ...core.partial import BEARING
from ...core.se2 import Array, Ints, act
from ...core.small_matrices import upper
from .graph_parts import check_parts
from .pose_graph import inverses

CHUNK = 100_000  # sightings that are converted at once
MOST_ID = 2**31 - 1  # the largest id of a vertex: g2o's is an int


def write_g2o(path: Path, log: Log, for_gtsam: bool = False) -> int:
    """Writes `log` to `path` atomically; returns the number of sightings of unknown landmarks left out.

    Initial values are the dead-reckoned poses, and the landmarks' first sightings from there, or 1 m along the first
    bearing. Landmarks keep their ids,
    and poses are numbered from 0, or from above the landmarks where that would clash. InputError for ids that g2o
    cannot read, and for a given map that is not held fixed.

    gtsam.readG2o ignores EDGE_SE2_XY, bearings, priors and FIX silently. A file `for_gtsam` has sightings as BR rows,
    which it reads, and no prior; InputError for a log with a given map, bearings alone or fixes, or with range and
    bearing correlated.
    """
    check(log, where=f"log {log.name}")
    known = log.prior.map
    if known is not None and known.cov is not None:
        raise InputError(f"{path}: log {log.name} has a map with covariance, which a g2o file cannot represent.")
    if for_gtsam:
        _check_for_gtsam(path, log)
    check_parts(path, log, "g2o file", BEARING, positions=True)
    poses = log.dead_reckoned()
    left_out, log = log.unknown, log.identified()
    landmarks, xy = _places(log, poses)
    first = 0 if not len(landmarks) or landmarks.min() >= len(log) else int(landmarks.max()) + 1
    top = max(first + len(log) - 1, int(landmarks.max(initial=0)))
    if top > MOST_ID:
        raise InputError(
            f"{path}: log {log.name} needs the vertex id {top}, expected at most {MOST_ID}, g2o's largest."
        )

    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with beside.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(_rows("VERTEX_SE2", first + np.arange(len(poses)), *poses.T))
            file.writelines(_rows("VERTEX_XY", landmarks, *xy.T))
            if known is not None and len(known.ids):
                file.write(f"FIX {' '.join(map(str, known.ids.tolist()))}\n")
            file.writelines(() if for_gtsam else _prior(log, first))
            file.writelines(_motions(log, first))
            file.writelines(_bearing_ranges(log, first) if for_gtsam else _points(log, first))
            file.writelines(() if for_gtsam else _parts(log, first))
        os.replace(beside, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from error
    finally:
        beside.unlink(missing_ok=True)
    return left_out


def _prior(log: Log, first: int) -> Iterator[str]:
    pose, cov = log.prior.pose[None], log.prior.cov[None]
    return _rows("EDGE_PRIOR_SE2", np.array([first]), *pose.T, *_information(after_motion(pose, cov)))


def _motions(log: Log, first: int) -> Iterator[str]:
    """Odometry, then the loop closures."""
    delta, cov = log.delta[1:], log.delta_cov[1:]
    steps = first + np.arange(len(log))
    yield from _rows("EDGE_SE2", steps[:-1], steps[1:], *delta.T, *_information(after_motion(delta, cov)))
    delta, cov = log.loop_delta, log.loop_cov
    ends = first + log.loop_to, first + log.loop_step
    yield from _rows("EDGE_SE2", *ends, *delta.T, *_information(after_motion(delta, cov)))


def _points(log: Log, first: int) -> Iterator[str]:
    for begin in range(0, len(log.ids), CHUNK):
        some = slice(begin, begin + CHUNK)
        xy, cov = as_points(log.z[some], log.z_cov[some])
        yield from _rows("EDGE_SE2_XY", first + log.sighting_step[some], log.ids[some], *xy.T, *_information(cov))


def _parts(log: Log, first: int) -> Iterator[str]:
    """The bearings alone, and the fixes of whole poses, then those of positions."""
    if (one := log.partial) is not None:
        yield from _rows("EDGE_BEARING_SE2_XY", first + one.step, one.ids, one.z, 1 / one.var)
    if (fixes := log.fixes) is not None:
        whole = ~np.isnan(fixes.z[:, 2])
        information = _information(after_motion(fixes.z[whole], fixes.cov[whole]))
        yield from _rows("EDGE_PRIOR_SE2", first + fixes.step[whole], *fixes.z[whole].T, *information)
        z, cov = fixes.z[~whole, :2], fixes.cov[~whole, :2, :2]
        yield from _rows("EDGE_PRIOR_SE2_XY", first + fixes.step[~whole], *z.T, *_information(cov))


def _bearing_ranges(log: Log, first: int) -> Iterator[str]:
    sd = np.sqrt(log.z_cov[:, [1, 0], [1, 0]])
    return _rows("BR", first + log.sighting_step, log.ids, *log.z.T[::-1], *sd.T)


def _check_for_gtsam(path: Path, log: Log) -> None:
    if log.prior.map is not None:
        raise InputError(f"{path}: log {log.name} has a given map, which gtsam.readG2o cannot read.")
    if log.partial is not None or log.fixes is not None:
        raise InputError(
            f"{path}: log {log.name} has bearings alone, or fixes, which gtsam.readG2o cannot read; use g2o."
        )
    correlated = np.abs(log.z_cov[:, 0, 1]) > 1e-9 * np.sqrt(log.z_cov[:, 0, 0] * log.z_cov[:, 1, 1])
    for row in np.flatnonzero(correlated & (log.ids != UNKNOWN)):
        found = f"range and bearing of sighting {row} are correlated"
        raise InputError(f"{path}: log {log.name}: {found}, which a BR row cannot represent; use g2o.")


def _information(cov: Array) -> Iterable[Array]:
    """Upper triangles of the inverses, by columns."""
    return upper(inverses(cov)[0])


def _rows(tag: str, *columns: Array | Ints) -> Iterator[str]:
    return number_rows(columns, " ", f"{tag} ")


def _places(log: Log, poses: Array) -> tuple[Ints, Array]:
    """The landmarks (l,), given ones first, and their positions (l, 2): as given, or from the first sighting."""
    ids, seen = np.unique(log.ids, return_index=True)
    xy = act(poses[log.sighting_step[seen]], as_points(log.z[seen], log.z_cov[seen])[0])
    if (one := log.partial) is not None:
        names, row = np.unique(one.ids, return_index=True)
        row = row[~np.isin(names, ids)]
        s, c = sincos(one.z[row])
        ids = np.concatenate((ids, one.ids[row]))
        xy = np.concatenate((xy, act(poses[one.step[row]], np.column_stack((c, s)))))
    known = log.prior.map
    if known is None:
        return ids, xy
    new = ~np.isin(ids, known.ids)
    return np.concatenate((known.ids, ids[new])), np.concatenate((known.xy, xy[new]))
