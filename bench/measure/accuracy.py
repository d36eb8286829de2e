"""Computes the errors of a path and a map, by column; online and final ones have the same names.

Paths are (m, 3) poses at the truth's times. An estimate is aligned with the truth by a rigid motion, except in columns
that say "origin".
"""

from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Log, Map, Truth
from ...core.se2 import Array, Ints, act, compose, wrap
from ...core.truth.errors import standing
from .nees import landmark_nees, nees_columns
from .relative_error import pairs_by_path, pairs_by_time, relative_error

DISTANCES = {"rpe_m": 1.0, "rpe_10m_m": 10.0, "rpe_100m_m": 100.0}  # m of path; rpe_rad goes with the first
DURATIONS = {"rpe_1s_m": 1.0, "rpe_10s_m": 10.0}  # s, likewise
FEWEST = 3  # true poses from which on a path has a shape, and a motion that lays another on it
STRAIGHT = 1e-12  # share of a path's extent that it may extend to the side and still be straight
ULPS = 16  # rounding error of a coordinate less the mean of its column, summed in any order


class Alignment(NamedTuple):
    """The rigid motion applied to an estimate before it is compared with the truth."""

    motion: Array  # (3,) x, y, heading
    translation_only: bool  # the path is straight or standing, so that no rotation was looked for


class Accuracy(NamedTuple):
    """The errors of a path."""

    row: dict[str, Any]  # without those of the aligned path where the truth has no shape
    path: Array  # (m, 3) aligned
    alignment: Alignment


def has_shape(truth: Truth) -> bool:
    """False where the path is known at fewer than FEWEST poses, or all in one place: any other could be laid on it."""
    xy = truth.poses[:, :2]
    return len(xy) >= FEWEST and float(np.linalg.norm(xy - xy.mean(axis=0))) > _rounding(xy)


def stretches(truth: Truth, *, timed: bool, headings: bool = True) -> dict[str, Ints]:
    """The pairs of poses of each relative-error column; durations only where the log is timed.

    None where the truth's `headings` are not known: motions are in the frame of the pose before them.
    """
    if not headings:
        return {}
    pairs = {name: pairs_by_path(truth.poses, distance) for name, distance in DISTANCES.items()}
    if timed:
        pairs |= {name: pairs_by_time(truth.t, duration) for name, duration in DURATIONS.items()}
    return pairs


def path_accuracy(
    truth: Truth, path: Array, landmarks: Map, over: dict[str, Ints], *, headings: bool = True
) -> Accuracy:
    """Computes errors of the poses at the truth's times, and of the map after the path's alignment.

    A truth without a shape leaves no error of the aligned path, and the map is aligned by itself; where its `headings`
    are not known, none of these is judged.
    """
    alignment = align(path, truth.poses)
    moved = aligned(alignment, path)
    row: dict[str, Any] = {"ate_origin_m": ate(path, truth.poses)}
    shape = has_shape(truth)
    if shape:
        x, y, heading = alignment.motion.tolist()
        row |= {
            "ate_m": ate(moved, truth.poses),
            "ate_median_m": float(np.median(np.hypot(*(moved - truth.poses)[:, :2].T))),
            "align_x_m": x,
            "align_y_m": y,
            "align_rad": heading,
        }
    if headings:
        row["heading_rad"] = heading_error(moved, truth.poses)
    for name, pairs in over.items():
        found = relative_error(path, truth.poses, pairs)
        if found is not None:
            row[name] = found.translation
            row |= {"rpe_rad": found.rotation} if name == "rpe_m" else {}
    known = standing(truth)
    if known is not None and truth.places == truth.kind:  # else true places are in another frame than the path
        row["map_rmse_m"] = map_rmse(landmarks, known, alignment) if shape else own_map_rmse(landmarks, known)
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
        row |= nees_columns("landmark_nees", landmark_nees(found, known, fixed), 2)
    return row


def align(estimate: Array, truth: Array) -> Alignment:
    """Finds the motion with the least sum of squared position errors: no reflection, no scale.

    With the centred positions e and t, the rotation is atan2(sum e x t, sum e . t): Umeyama's solution (PAMI 13(4),
    1991) in two dimensions, where the best proper rotation has this closed form even if a reflection would fit better.
    A path on one line, or one point, but for rounding, is only shifted.
    """
    e, t = estimate[:, :2], truth[:, :2]
    mean_e, mean_t = e.mean(axis=0), t.mean(axis=0)
    together = (e - mean_e).T @ (t - mean_t)
    spread = np.linalg.svd(together, compute_uv=False)
    # |(e + de)' (t + dt) - e' t| <= |de| |t| + |e| |dt|, to first order, in Frobenius norms.
    by_rounding = _rounding(e) * np.linalg.norm(t - mean_t) + _rounding(t) * np.linalg.norm(e - mean_e)
    flat = bool(spread[1] <= STRAIGHT * spread[0] + by_rounding)
    heading = 0.0
    if not flat:
        heading = float(np.arctan2(together[0, 1] - together[1, 0], together[0, 0] + together[1, 1]))
    motion = np.array((0.0, 0.0, heading))
    motion[:2] = mean_t - act(motion, mean_e)
    return Alignment(motion, flat)


def _rounding(positions: Array) -> float:
    """Bounds the Frobenius norm of what rounding does to the centred `positions` (m, 2)."""
    return float(ULPS * np.finfo(np.float64).eps * np.abs(positions).max(initial=0.0) * np.sqrt(positions.size))


def aligned(alignment: Alignment, estimate: Array) -> Array:
    """The poses (m, 3) of `estimate` after the alignment."""
    return compose(np.broadcast_to(alignment.motion, estimate.shape), estimate)


def ate(estimate: Array, truth: Array) -> float:
    """Computes the absolute trajectory error, m: the root mean square distance between the positions."""
    return float(np.sqrt(((estimate[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


def heading_error(estimate: Array, truth: Array) -> float:
    """Computes the root mean square of the wrapped heading differences, rad."""
    return float(np.sqrt((wrap(estimate[:, 2] - truth[:, 2]) ** 2).mean()))


def map_rmse(estimate: Map, truth: Map, alignment: Alignment) -> float | None:
    """Computes the RMS distance, m, of the landmarks in both maps, aligned as the path; None without any."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if not len(mine):
        return None
    xy = act(np.broadcast_to(alignment.motion, (len(mine), 3)), estimate.xy[mine])
    return float(np.sqrt(((xy - truth.xy[theirs]) ** 2).sum(axis=1).mean()))


def own_map_rmse(estimate: Map, truth: Map) -> float | None:
    """Computes as `map_rmse`, the shared landmarks aligned by themselves; None with fewer than three."""
    _, mine, theirs = np.intersect1d(estimate.ids, truth.ids, return_indices=True)
    if len(mine) < 3:
        return None
    return map_rmse(estimate, truth, align(estimate.xy[mine], truth.xy[theirs]))


def missed(estimate: Map, truth: Map, sighted: Ints) -> int:
    """Counts the known landmarks that were sighted, by the ids (s,) of the sightings, and are not in the map."""
    return len(np.setdiff1d(np.intersect1d(truth.ids, sighted), estimate.ids))


def spurious(estimate: Map, truth: Map) -> int:
    """Counts the landmarks of the map that are none of the known ones."""
    return len(np.setdiff1d(estimate.ids, truth.ids))
