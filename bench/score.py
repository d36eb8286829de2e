"""What a cell is judged to be: its outcome held against the truth, its fit to the factors, and its costs."""

from typing import Any, NamedTuple

import numpy as np

from ..backends.api import Diverged
from ..frontend.factors import UNKNOWN, Log, Map, Truth
from ..frontend.se2 import Array, Ints
from ..frontend.table import upper
from .cost import Cost, cost
from .drive import Outcome
from .metrics import INSIDE_95, Alignment, align, aligned, ate, heading_error, map_rmse, nees, own_map_rmse, rpe
from .summary import REFERENCE, SURVEYED

FEW = 0.9
"""Truth at a smaller share of the steps than this is remarked on."""

JOINT_MOST = 1_000
"""Landmarks up to which a map's joint covariance is kept: 16 MB then, as float64; 0.4 MB for 150 of them."""

TRANSLATION_ONLY = "aligned by translation only: the path is straight or standing"


class Score(NamedTuple):
    """A row's values by column name, arrays by name, and a remark for the row's reason ("" for none)."""

    row: dict[str, Any]
    arrays: dict[str, Array | Ints]
    remark: str


def score(log: Log, outcome: Outcome, truth: Truth | None) -> Score:
    """Judge an outcome. Online and final are never mixed; a value that does not exist is absent from the row."""
    row: dict[str, Any] = {}
    arrays = _kept(log, outcome)
    remarks = _remarks(log, truth)
    if truth is not None and not len(truth.t):
        row |= _map_alone(outcome, truth)
    elif truth is not None:
        at = np.searchsorted(log.t, truth.t)  # truth's times are a subset of the log's
        if outcome.online is not None:
            online = outcome.online[at]
            found = _accuracy(truth, online, outcome.map)
            row |= found.row
            arrays |= {"at": at, "aligned": found.path, "alignment": found.alignment.motion}
            if truth.kind == "truth":
                arrays["nees"] = nees(online, outcome.cov[at], truth.poses)
                row |= _consistency(arrays["nees"])
            remarks += [TRANSLATION_ONLY] * found.alignment.translation_only
        if outcome.solution is not None:
            found = _accuracy(truth, outcome.solution.path[at], outcome.solution.map)
            row |= {f"final_{name}": found.row[name] for name in ("ate_m", "ate_origin_m", "map_rmse_m")}
            arrays |= {"at": at, "final_aligned": found.path, "final_alignment": found.alignment.motion}
    dof = int(outcome.nis_dof.sum())
    if dof:
        row["nis"] = float(np.nansum(outcome.nis)) / dof
    fit = _fit(log, outcome)
    if fit is not None:
        row["cost_j"] = fit.total
        arrays["cost_terms"] = np.array(fit)
    row["landmarks"] = len((outcome.solution or outcome).map.ids)
    return Score(row | _costs(outcome), arrays, "; ".join(remarks))


def _remarks(log: Log, truth: Truth | None) -> list[str]:
    """What a reader of the row must know of the log."""
    said: list[str] = []
    given = log.prior.map
    if given is not None and not np.isin(given.ids, log.ids).any():
        said.append(f"none of the {len(given.ids)} landmarks of the given map is sighted")
    unknown = int((log.ids == UNKNOWN).sum())
    if unknown:
        said.append(f"{unknown} of {len(log.ids)} sightings have no id")
    if truth is not None and truth.kind == "reference" and truth.map is not None and truth.places == "truth":
        said.append(SURVEYED)
    if truth is not None and truth.words:
        said.append(REFERENCE + truth.words)
    if truth is not None and len(truth.t) < FEW * len(log):
        said.append(f"truth is known at {len(truth.t)} of {len(log)} steps")
    return said


def _map_alone(outcome: Outcome, truth: Truth) -> dict[str, Any]:
    """The map's error where the landmarks' places are known and the path is not: aligned by the landmarks alone."""
    if truth.map is None:
        return {}
    row = {"map_rmse_m": own_map_rmse(outcome.map, truth.map)}
    if outcome.solution is not None:
        row["final_map_rmse_m"] = own_map_rmse(outcome.solution.map, truth.map)
    return row


class _Accuracy(NamedTuple):
    row: dict[str, Any]
    path: Array
    alignment: Alignment


def _accuracy(truth: Truth, path: Array, landmarks: Map) -> _Accuracy:
    """Errors of the poses at the truth's times, and of the map after the path's alignment."""
    alignment = align(path, truth.poses)
    moved = aligned(alignment, path)
    row = {
        "ate_m": ate(moved, truth.poses),
        "ate_origin_m": ate(path, truth.poses),
        "heading_rad": heading_error(moved, truth.poses),
        "rpe_m": rpe(truth.t, path, truth.poses),
        "map_rmse_m": _map_error(truth, landmarks, alignment),
    }
    return _Accuracy(row, moved, alignment)


def _map_error(truth: Truth, landmarks: Map, alignment: Alignment) -> float | None:
    """The map's error, aligned as the path; true places beside a reference path are in another frame than that."""
    if truth.map is None:
        return None
    return (
        map_rmse(landmarks, truth.map, alignment) if truth.places == truth.kind else own_map_rmse(landmarks, truth.map)
    )


def _consistency(values: Array) -> dict[str, Any]:
    """Mean NEES over its 3 degrees of freedom, and the share of steps inside the belief's own 95 % bound.

    A step whose belief has no usable covariance has no bound to be inside of, and counts as outside: a filter that has
    collapsed must not be judged by its better moments.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return {}
    return {"nees": float(known.mean() / 3), "nees_inside": float((known <= INSIDE_95).sum() / len(values))}


def _fit(log: Log, outcome: Outcome) -> Cost | None:
    """J of the final, else the online, path and map; None where it is not defined."""
    path, landmarks = outcome.online, outcome.map
    if outcome.solution is not None:
        path, landmarks = outcome.solution.path, outcome.solution.map
    try:
        return None if path is None else cost(log, path, landmarks)
    except Diverged:  # a landmark at a robot's very place has no bearing
        return None


def _costs(outcome: Outcome) -> dict[str, float]:
    """Process CPU time, in the unit that each name ends in."""
    us = outcome.step_ns / 1e3
    return {
        "step_us_mean": float(us.mean()),
        "step_us_p50": float(np.percentile(us, 50)),
        "step_us_p95": float(np.percentile(us, 95)),
        "step_us_p99": float(np.percentile(us, 99)),
        "step_us_max": float(us.max()),
        "belief_us_mean": float(outcome.belief_ns.mean() / 1e3),
        "finish_s": outcome.finish_ns / 1e9,
        "setup_s": outcome.setup_ns / 1e9,
        "cpu_s": float(outcome.step_ns.sum() + outcome.setup_ns + outcome.finish_ns) / 1e9,
    }


def _kept(log: Log, outcome: Outcome) -> dict[str, Array | Ints]:
    """The arrays that a record keeps.

    Of each map's covariance the blocks (n, 2, 2) on its diagonal; of the final map's, or the online one's where that of
    the final is not known, the upper triangle of the whole as well, row by row: what another run can start from.
    """
    arrays: dict[str, Array | Ints] = {
        "t": log.t,
        "cov": outcome.cov,
        "nis": outcome.nis,
        "nis_dof": outcome.nis_dof,
        "n_eff": outcome.n_eff,
        "ancestors": outcome.ancestors,
        "refused": outcome.refused,
        "step_ns": outcome.step_ns,
        "wall_ns": outcome.wall_ns,
        "belief_ns": outcome.belief_ns,
        "other_ns": np.array((outcome.map_ns, outcome.setup_ns, outcome.finish_ns, outcome.clock_ns)),
    }
    if outcome.online is not None:
        arrays["online"] = outcome.online
    if outcome.solution is not None:
        arrays["final"] = outcome.solution.path
        arrays |= _map_arrays("final_map", outcome.solution.map)
    arrays |= _map_arrays("map", outcome.map)
    maps = {"map": outcome.map} if outcome.solution is None else {"final_map": outcome.solution.map, "map": outcome.map}
    known = [(prefix, landmarks.cov) for prefix, landmarks in maps.items() if landmarks.cov is not None]
    if known and len(known[0][1]) <= 2 * JOINT_MOST:
        arrays[f"{known[0][0]}_joint"] = upper(known[0][1][None])[:, 0]
    return arrays


def _map_arrays(prefix: str, landmarks: Map) -> dict[str, Array | Ints]:
    n = len(landmarks.ids)
    arrays: dict[str, Array | Ints] = {f"{prefix}_ids": landmarks.ids, f"{prefix}_xy": landmarks.xy}
    if landmarks.cov is not None:
        blocks = landmarks.cov.reshape(n, 2, n, 2)
        arrays[f"{prefix}_cov"] = blocks[np.arange(n), :, np.arange(n)]
    return arrays
