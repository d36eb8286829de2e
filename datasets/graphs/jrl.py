"""Reads JSON Robot Logs (JRL), datasets for optimisers with their ground truth and their known outliers.

    {"name": ..., "robots": ["a"],
     "measurements": {"a": [{"stamp": 0, "measurements": [...]}, ...]},
     "groundtruth": {"a": [{"key": ..., "type": "Pose2", "x": ..., "y": ..., "theta": ...}, ...]},     optional
     "outlier_factors": {"a": [[entry, measurement], ...]}}                                            optional

    PriorFactorPose2        key, prior, covariance                   of the first pose the prior, others are fixes
    BetweenFactorPose2      key1, key2, measurement, covariance      pose key2 in the body frame of pose key1
    BearingRangeFactor2D    key1, key2, measurement, covariance      landmark key2 from pose key1; bearing, range
    RangeFactor2D           key1, key2, measurement, covariance      likewise the range alone

D. McGann, jrl (rpl-cmu/jrl). A key is a symbol of GTSAM: a letter in the highest of eight bytes, a number in the
others; one of the letters is the robot's, and landmarks have another, or numbers from a billion on. Covariances are all
entries of a matrix, in GTSAM's frames: after the motion, and of the body at the prior. Stamps are whole numbers of no
stated unit: t is the number of the step.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.coordinates import before_motion
from ...core.csv_values import shortened
from ...core.errors import InputError
from ...core.factors import Dataset, Map, Prior, Truth
from ...core.options import option
from ...core.partial import RANGE
from ...core.table import Table
from ..false_loops import FalseLoops
from ..formats.graph_parts import Alone, Placed, with_parts
from ..formats.pose_graph import START, PoseGraph, log_of, loop_edges, wrapped
from ..redrawn import Drawn
from ..registry import Named, Source
from .jrl_rows import (
    BETWEEN,
    COLUMNS,
    POINT,
    POSE,
    PRIOR,
    RANGES,
    SIGHTING,
    Values,
    factors_of,
    outliers_of,
    read_content,
    robot_of,
    truth_of,
)


@dataclass(frozen=True)
class Options(Drawn, FalseLoops, Named):
    """Which log."""

    path: str | None = option(None, "the file of the log")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A planar JSON Robot Log of one robot, with its truth and outliers if it has them: jrl[path=FILE]."""
    if options.path is None:
        raise InputError("option path of dataset jrl is not given, expected the file of a log: jrl[path=FILE].")
    return read(Path(options.path))


source = Source(make, Options)


def read(path: Path) -> Dataset:
    """Reads the log in the file `path`, and its truth; InputError names the file and the place of what is invalid."""
    content = read_content(path)
    robot = robot_of(path, content)
    letters = dict[str, int]()
    factors = factors_of(path, content["measurements"][robot], letters)
    edges, sightings = factors[BETWEEN], factors[SIGHTING]
    nothing = Table(path, COLUMNS[POSE], np.zeros((0, 4)), np.zeros(0, np.int64))
    z = wrapped(sightings, "bearing")[:, [3, 2]]
    z_cov = sightings.rows[:, 4:].reshape(-1, 2, 2)[:, ::-1, ::-1]
    cov = before_motion(wrapped(edges, "dtheta")[:, 2:5], edges.rows[:, 5:].reshape(-1, 3, 3))
    graph = PoseGraph(
        path, nothing, Table(path, COLUMNS[POINT], np.zeros((0, 3)), nothing.lines), edges, cov, sightings, z, z_cov,
        shared_ids=False,
    )  # fmt: skip
    truth = truth_of(path, content, robot, letters)
    outliers = outliers_of(path, content, robot)
    notes = {
        "source": f"the JSON Robot Log {shortened(str(content.get('name', path.name)))}",
        "licence": "not stated in the file",
        "covariances": "JRL's are in the body frame after a motion, converted to the one before it",
    }
    if outliers is not None:
        of_loops = np.isin(outliers, edges.lines[loop_edges(graph)]).sum()
        notes["outliers"] = f"{len(outliers)}, {of_loops} of them loop closures, which alone are marked"
    prior, placed = _priors(graph, factors[PRIOR], truth[POSE])
    ranges = factors[RANGES]
    alone = Alone(RANGE, ranges, ranges.column("range"), ranges.column("c11"))
    log = with_parts(log_of(graph, path.stem, prior, notes), graph.ids(), [alone], [placed])
    false = None if outliers is None else np.flatnonzero(np.isin(edges.lines[loop_edges(graph)], outliers))
    poses, places = truth[POSE], truth[POINT]
    if not len(poses.rows) and not len(places.rows):
        return Dataset(log, None if false is None else Truth(np.zeros(0), np.zeros((0, 3)), false_loops=false))
    ids = graph.ids()
    known = np.flatnonzero(np.isin(poses.whole("id"), ids))
    known = known[np.argsort(poses.rows[known, 0])]
    step = np.searchsorted(ids, poses.whole("id")[known])
    points = Map(places.whole("id"), places.rows[:, 1:3], None) if len(places.rows) else None
    return Dataset(log, Truth(log.t[step], wrapped(poses, "theta")[known, 1:4], points, false_loops=false))


def _priors(graph: PoseGraph, priors: Table, truth: Values) -> tuple[Prior | None, Placed]:
    """The prior of the first pose, its true pose where the file has none, None without both; and the other priors."""
    first = int(graph.ids()[0])
    poses = wrapped(priors, "theta")[:, 1:4]
    cov = before_motion(poses, priors.rows[:, 4:].reshape(-1, 3, 3))
    own = np.flatnonzero(priors.whole("id") == first)[:1]
    others = np.setdiff1d(np.arange(len(priors.rows)), own)
    placed = Placed(priors.take(others), poses[others], cov[others])
    if len(own):
        return Prior(poses[own[0]], cov[own[0]]), placed
    rows = np.flatnonzero(truth.column("id") == first)
    return Prior(wrapped(truth, "theta")[rows[0], 1:4], START * np.eye(3)) if len(rows) else None, placed
