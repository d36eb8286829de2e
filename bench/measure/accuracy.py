"""Computes the error columns of a path and a map, under the same names for the online and the final ones."""

from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Log, Map, Truth
from ...core.se2 import Array, Ints
from ...core.truth_errors import standing
from .metrics import (
    Alignment,
    align,
    aligned,
    ate,
    consistency,
    heading_error,
    landmark_nees,
    map_rmse,
    missed,
    own_map_rmse,
    spurious,
)
from .relative_error import pairs_by_path, pairs_by_time, relative_error

DISTANCES = {"rpe_m": 1.0, "rpe_10m_m": 10.0, "rpe_100m_m": 100.0}  # m of path; rpe_rad goes with the first
DURATIONS = {"rpe_1s_m": 1.0, "rpe_10s_m": 10.0}  # s, likewise


class Accuracy(NamedTuple):
    """The errors of a path."""

    row: dict[str, Any]
    path: Array  # (m, 3) aligned
    alignment: Alignment


def stretches(truth: Truth, *, timed: bool) -> dict[str, Ints]:
    """Returns the pairs of poses of each relative-error column; durations only where the log is timed."""
    pairs = {name: pairs_by_path(truth.poses, distance) for name, distance in DISTANCES.items()}
    if timed:
        pairs |= {name: pairs_by_time(truth.t, duration) for name, duration in DURATIONS.items()}
    return pairs


def path_accuracy(truth: Truth, path: Array, landmarks: Map, over: dict[str, Ints]) -> Accuracy:
    """Computes errors of the poses at the truth's times, and of the map after the path's alignment."""
    alignment = align(path, truth.poses)
    moved = aligned(alignment, path)
    x, y, heading = alignment.motion.tolist()
    row: dict[str, Any] = {
        "ate_m": ate(moved, truth.poses),
        "ate_origin_m": ate(path, truth.poses),
        "ate_median_m": float(np.median(np.hypot(*(moved - truth.poses)[:, :2].T))),
        "heading_rad": heading_error(moved, truth.poses),
        "align_x_m": x,
        "align_y_m": y,
        "align_rad": heading,
    }
    for name, pairs in over.items():
        found = relative_error(path, truth.poses, pairs)
        if found is not None:
            row[name] = found.translation
            row |= {"rpe_rad": found.rotation} if name == "rpe_m" else {}
    known = standing(truth)
    if known is not None and truth.places == truth.kind:  # else true places are in another frame than the path
        row["map_rmse_m"] = map_rmse(landmarks, known, alignment)
    return Accuracy(row, moved, alignment)


def map_accuracy(log: Log, truth: Truth, known: Map, found: Map) -> dict[str, Any]:
    """Compares the map with the known one, aligned by itself where no path is known in that one's frame.

    Landmarks that move have no error, but may be missed.
    """
    ids = log.ids if truth.assigned is None else truth.assigned
    row: dict[str, Any] = {"landmarks_missed": missed(found, known, ids), "landmarks_spurious": spurious(found, known)}
    known = standing(truth) or known
    if not len(truth.t) or truth.places != truth.kind:
        row["map_rmse_m"] = own_map_rmse(found, known)
    elif truth.kind == "truth":
        given = log.prior.map
        fixed = given.ids if given is not None and given.cov is None else np.zeros(0, np.int64)
        row |= consistency_columns("landmark_nees", landmark_nees(found, known, fixed), 2)
    return row


def consistency_columns(name: str, values: Array, dof: int) -> dict[str, Any]:
    """Returns the mean NEES over its `dof` degrees of freedom, and the share inside the 95 % bound, by column."""
    found = consistency(values, dof)
    return {} if found is None else {name: found.mean, f"{name}_inside": found.inside}
