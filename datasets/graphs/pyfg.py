"""Reads planar graphs in PyFG's text format, whose poses and landmarks are the true ones.

    VERTEX_SE2 t A0 x y theta                                        the true pose A0
    VERTEX_XY L0 x y                                                 the true place of landmark L0
    VERTEX_SE2:PRIOR t A0 x y theta c11 c12 c13 c22 c23 c33          a measured pose: the prior, or a fix
    EDGE_SE2 t A0 A1 dx dy dtheta c11 c12 c13 c22 c23 c33            pose A1 in the body frame of pose A0
    EDGE_SE2_XY t A0 L0 x y c11 c12 c22                              landmark L0 in the body frame of pose A0
    EDGE_RANGE t A0 L0 range var                                     a range alone

A. Papalia et al., py-factor-graph (MarineRoboticsGroup/PyFactorGraph). A letter is a robot's, L that of landmarks; the
six numbers are a covariance, of which the format does not say the frame: that after the motion, as GTSAM has it, which
the package solves with. The first VERTEX_SE2:PRIOR of the first pose is the prior of the log, others are fixes.

The package writes the true values of its variables, and has no other place for values to start a solver with. Some
files have these in the place of the true ones, goats_15.pyfg for one: poses that are the motions one after another, to
rounding, and that ranges, sightings and loop closures do not fit. Such poses are no truth, nor are the landmarks with
them.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.coordinates import before_motion
from ...core.csv_values import no_number, number, shortened
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Prior, Truth
from ...core.options import option
from ...core.partial import RANGE
from ...core.se2 import Array, Ints, between
from ...core.small_matrices import symmetric
from ...core.table import LARGEST, MOST, Table, text
from ...core.truth.errors import difference, driven_errors, partial_errors, rows_of, sighting_errors
from ..false_loops import FalseLoops
from ..formats.graph_parts import Alone, Placed, with_parts
from ..formats.pose_graph import START, PoseGraph, log_of, points_seen, wrapped
from ..formats.tagged import LENGTHS
from ..redrawn import Drawn
from ..registry import Named, Source

_SIX = ("c11", "c12", "c13", "c22", "c23", "c33")
_KINDS = {
    "VERTEX_SE2": ("t", "id", "x", "y", "theta"),
    "VERTEX_XY": ("id", "x", "y"),
    "VERTEX_SE2:PRIOR": ("t", "id", "x", "y", "theta", *_SIX),
    "EDGE_SE2": ("t", "from", "to", "dx", "dy", "dtheta", *_SIX),
    "EDGE_SE2_XY": ("t", "pose", "id", "x", "y", "c11", "c12", "c22"),
    "EDGE_RANGE": ("t", "pose", "id", "range", "var"),
}
_POINTS = {"VERTEX_XY": "id", "EDGE_SE2_XY": "id", "EDGE_RANGE": "id"}  # the column of a landmark's name
_NAMED = ("id", "from", "to", "pose")
_NAME = re.compile(r"([A-Za-z])(\d{1,15})", re.ASCII)
_LEFT_OUT = {
    "VERTEX_XY:PRIOR": "priors of landmarks, which a log has no place for",
}
ROUNDING = 2e-6  # m, rad; motions of written poses are that close to the written motions, where they are their sum
EXACT = 100.0  # times ROUNDING that motions are stated to be uncertain by, where equal ones are no chance
MISFIT = 3.0  # standard deviations that other measurements are typically off where poses are no truth
NO_TRUTH = "none: the file's poses are its motions one after another, which its other measurements do not fit"
_IN_SPACE = re.compile(r"SE3|XYZ")


@dataclass(frozen=True)
class Options(Drawn, FalseLoops, Named):
    """Which graph."""

    path: str | None = option(None, "the file of the graph")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A planar graph in PyFG's format, with its true poses and landmarks: pyfg[path=FILE]."""
    if options.path is None:
        raise InputError("option path of dataset pyfg is not given, expected the file of a graph: pyfg[path=FILE].")
    return read(Path(options.path))


source = Source(make, Options)


def read(path: Path) -> Dataset:
    """Reads the log and the truth in the file `path`; InputError names the file and line of what is invalid."""
    tables = _tables(path)
    vertices, points, edges, sightings = (
        tables[kind] for kind in ("VERTEX_SE2", "VERTEX_XY", "EDGE_SE2", "EDGE_SE2_XY")
    )
    cov = before_motion(wrapped(edges, "dtheta")[:, 2:5], symmetric(edges.rows[:, 5:11]))
    seen = points_seen(sightings, symmetric(sightings.rows[:, 4:7]))
    graph = PoseGraph(path, vertices, points, edges, cov, sightings, *seen, shared_ids=False)
    notes = {
        "source": f"the PyFG file {path.name}",
        "licence": "not stated in the file",
        "covariances": "taken to be in the body frame after a motion, converted to the one before it",
    }
    prior, placed = _priors(graph, tables["VERTEX_SE2:PRIOR"])
    log, ids, ranges = log_of(graph, path.stem, prior, notes), graph.ids(), tables["EDGE_RANGE"]
    log = with_parts(log, ids, [Alone(RANGE, ranges, ranges.column("range"), ranges.column("var"))], [placed])
    step = np.searchsorted(ids, vertices.whole("id"))
    order = np.argsort(step)
    log = _timed(log, step, vertices.column("t"))
    places = Map(points.whole("id"), points.rows[:, 1:3], None) if len(points.rows) else None
    truth = Truth(log.t[step[order]], wrapped(vertices, "theta")[order, 1:4], places)
    if _is_start(log, truth):
        return Dataset(replace(log, notes={**log.notes, "truth": NO_TRUTH}), None)
    return Dataset(log, truth)


def _is_start(log: Log, truth: Truth) -> bool:
    """Tells if poses are the motions one after another, to rounding, and what else is measured does not fit them."""
    driven = driven_errors(log, truth)
    if not len(driven.row) or (np.abs(driven.values) > ROUNDING).any():
        return False
    sds = np.sqrt(np.diagonal(log.delta_cov[driven.row], axis1=1, axis2=2))
    other = np.concatenate([np.zeros(0), *_squared(log, truth)])
    return bool((sds > EXACT * ROUNDING).any() and len(other) and np.median(other) > MISFIT**2)


def _squared(log: Log, truth: Truth) -> Iterator[Array]:
    """Yields the squared distances of sightings, ranges and loop closures, each over its degrees of freedom."""
    seen = sighting_errors(log, truth)
    yield _distances(seen.values, log.z_cov[seen.row])
    at = rows_of(truth.t, log.t)
    ends = np.flatnonzero((at[log.loop_to] >= 0) & (at[log.loop_step] >= 0))
    to, here = truth.poses[at[log.loop_to[ends]]], truth.poses[at[log.loop_step[ends]]]
    yield _distances(difference(between(to, here), log.loop_delta[ends]), log.loop_cov[ends])
    if log.partial is not None:
        alone = partial_errors(log, truth)
        yield alone.values**2 / log.partial.var[alone.row]


def _distances(values: Array, cov: Array) -> Array:
    return np.einsum("mi,mi->m", values, np.linalg.solve(cov, values[..., None])[..., 0]) / values.shape[1]


def _priors(graph: PoseGraph, priors: Table) -> tuple[Prior | None, Placed]:
    """The prior of the first pose, its true one where the file has none, None without both; and the other priors."""
    first = int(graph.ids()[0])
    poses = wrapped(priors, "theta")[:, 1:4]
    cov = before_motion(poses, symmetric(priors.rows[:, 4:10]))
    own = np.flatnonzero(priors.whole("id") == first)[:1]
    others = np.setdiff1d(np.arange(len(priors.rows)), own)
    placed = Placed(priors.take(others), poses[others], cov[others])
    if len(own):
        return Prior(poses[own[0]], cov[own[0]]), placed
    place = graph.place(first)
    return None if place is None else Prior(place, START * np.eye(3)), placed


def _timed(log: Log, step: Ints, t: Array) -> Log:
    """The log with the times of its poses, where all have one and they ascend; goats_15.pyfg, for one, has zeros."""
    times = np.full(len(log), np.nan)
    times[step] = t
    if not (np.diff(times) > 0).all() or np.isnan(times).any():
        return log
    times.flags.writeable = False
    return replace(log, t=times, notes={**log.notes, "time": "as in the file"})


def _tables(path: Path) -> dict[str, Table]:
    """The rows of each kind, names without their letters and times last."""
    rows = {kind: list[list[float]]() for kind in _KINDS}
    lines = {kind: list[int]() for kind in _KINDS}
    letters = dict[str, str]()
    for line, content in enumerate(text(path).split("\n"), start=1):
        kind, *words = content.split() or ["#"]
        if kind.startswith("#"):
            continue
        if kind not in _KINDS:
            raise _unknown(path, line, kind)
        rows[kind].append(_row(path, line, kind, words, letters))
        lines[kind].append(line)
    found = dict[str, Table]()
    for kind, columns in _KINDS.items():
        names = tuple(name for name in columns if name != "t") + ("t",) * (columns[0] == "t")
        table = Table(path, names, np.array(rows[kind]).reshape(-1, len(names)), np.array(lines[kind], np.int64))
        lengths = (name for name in names if name in LENGTHS)
        found[kind] = table.finite().bounded(-LARGEST, LARGEST, *lengths)
    return found


def _row(path: Path, line: int, kind: str, words: Sequence[str], letters: dict[str, str]) -> list[float]:
    """The numbers of a row, that of its time last; `letters` are those of poses and landmarks so far."""
    where, columns = f"{path}, line {line}:", _KINDS[kind]
    if len(words) != len(columns):
        raise InputError(
            f"{where} found {len(words)} words after {kind}, expected {len(columns)} ({' '.join(columns)})."
        )
    row = list[float]()
    for name, word in zip(columns, words, strict=True):
        if name in _NAMED:
            what = "landmarks" if _POINTS.get(kind) == name else "poses"
            row.append(_number_of(where, name, word, what, letters))
        elif (value := number(word)) is None:
            raise InputError(f"{where} {name} {no_number(word)}.")
        else:
            row.append(value)
    return [*row[1:], row[0]] if columns[0] == "t" else row


def _number_of(where: str, name: str, word: str, what: str, letters: dict[str, str]) -> float:
    """The number in the name of a pose or a landmark; InputError for another letter than that of the others."""
    match = _NAME.fullmatch(word)
    if match is None or int(match[2]) > MOST:
        raise InputError(f"{where} {name} is {shortened(word)}, expected a letter and a number, as in A0.")
    if letters.setdefault(what, match[1]) != match[1]:
        raise InputError(
            f"{where} found {word} beside {what} of {letters[what]!r}, expected one letter for all {what}."
        )
    return float(match[2])


def _unknown(path: Path, line: int, kind: str) -> InputError:
    known = ", ".join(_KINDS)
    if _IN_SPACE.search(kind):
        return InputError(
            f"{path}, line {line}: rows {kind} are of a graph in space, 3D, expected planar ones: {known}."
        )
    if kind in _LEFT_OUT:
        return InputError(f"{path}, line {line}: rows {kind} are {_LEFT_OUT[kind]}; expected only {known}.")
    return InputError(f"{path}, line {line}: found the tag {shortened(kind)}, expected one of {known}.")
