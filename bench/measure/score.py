"""Scores a cell: errors against ground truth, fit to the factors, CPU time."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...backends.api import Diverged
from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Array, Ints
from ...core.small_matrices import upper
from .accuracy import consistency_columns, map_accuracy, path_accuracy, stretches
from .association import association_columns, by_true_ids
from .cpu_time import step_cost
from .drive import Outcome
from .growth import mapped
from .locating import from_the_fix_on, locating
from .metrics import covariances, nees, not_covariances
from .misfit import Misfit, misfit
from .misstated import misstated
from .moved import moved_columns, moved_remarks
from .relations import counted_relations, relation_columns
from .times import length

FEW = 0.9  # truth at a smaller share of the steps is remarked on
JOINT_MOST = 1_000  # landmarks up to which a map's joint covariance is kept: 16 MB then; 0.4 MB for 150 of them

TRANSLATION_ONLY = "aligned by translation only: the path is straight or standing"


class Score(NamedTuple):
    """A row's values by column name, arrays by name, and a remark for the row's reason ("" for none)."""

    row: dict[str, Any]
    arrays: dict[str, Array | Ints]
    remark: str


def score(log: Log, outcome: Outcome, truth: Truth | None) -> Score:
    """Scores an outcome. Online and final are never mixed; a value that does not exist is absent from the row."""
    row: dict[str, Any] = {}
    arrays = _kept(log, outcome)
    remarks = _remarks(log, outcome, truth) + moved_remarks(outcome, truth)
    row |= moved_columns(log, outcome, truth)
    ends = _ends(outcome)
    if outcome.assigned is not None and truth is not None and truth.assigned is not None:
        for prefix, assigned in _assigned(outcome):
            row |= _prefixed(prefix, association_columns(assigned, truth.assigned))
            ends[prefix] = ends[prefix]._replace(map=by_true_ids(ends[prefix].map, assigned, truth.assigned))
    for prefix, end in ends.items():
        found = _not_covariances(log, end)
        row |= _prefixed(prefix, {name: wrong for name, (wrong, _) in found.items()})
        remarks += [_none(prefix, name, *counts) for name, counts in found.items() if counts[0]]
        if truth is not None and truth.map is not None:
            row |= _prefixed(prefix, map_accuracy(log, truth, truth.map, end.map))
    truth = None if truth is None else from_the_fix_on(log, outcome, truth)
    if truth is not None and len(truth.t):
        at = np.searchsorted(log.t, truth.t)  # truth's times are a subset of the log's
        over = stretches(truth, timed=length(log.t) is not None)
        for prefix, end in ends.items():
            if end.path is None:
                continue
            found = path_accuracy(truth, end.path[at], end.map, over)
            row |= _prefixed(prefix, found.row)
            arrays |= {"at": at, f"{prefix}aligned": found.path, f"{prefix}alignment": found.alignment.motion}
            if truth.exact and end.cov is not None:
                values = nees(end.path[at], end.cov[at], truth.poses)
                arrays[f"{prefix}nees"] = values
                row |= _prefixed(prefix, consistency_columns("nees", values, 3))
            remarks += [TRANSLATION_ONLY] * (found.alignment.translation_only and TRANSLATION_ONLY not in remarks)
    if truth is not None and truth.relations is not None:
        row |= counted_relations(truth.relations)
        for prefix, end in ends.items():
            row |= {} if end.path is None else _prefixed(prefix, relation_columns(truth.relations, end.path))
    if truth is not None and truth.exact:
        remarks += misstated(log, truth, row)
    named = log if outcome.assigned is None else replace(log, ids=_assigned(outcome)[-1][1])
    dof = int(outcome.nis_dof.sum())
    if dof:
        row["nis"] = float(np.nansum(outcome.nis)) / dof
    fit = _fit(named, outcome)
    if fit is not None:
        row |= {"cost_j": fit.total, "j_online" if outcome.solution is None else "j_final": fit.total}
        row |= {f"j_{name}": term for name, term in fit._asdict().items() if name != "loops" or term}
        arrays["cost_terms"] = np.array(fit)
    row["landmarks"] = len((outcome.solution or outcome).map.ids)
    row |= _measured_from(truth)
    row |= locating(log, outcome, truth)
    return Score(row | _inner(log, outcome) | step_cost(named, outcome), arrays, "; ".join(remarks))


def _assigned(outcome: Outcome) -> list[tuple[str, Ints]]:
    """The landmark of every sighting by column prefix: online, and final where there is a final path."""
    found = [("", outcome.assigned)] * (outcome.solution is None or outcome.online is not None)
    found += [("final_", outcome.final_assigned)] * (outcome.solution is not None)
    return [(prefix, assigned) for prefix, assigned in found if assigned is not None]


class _End(NamedTuple):
    path: Array | None  # (n, 3)
    cov: Array | None  # (n, 3, 3)
    map: Map


def _ends(outcome: Outcome) -> dict[str, _End]:
    solution = outcome.solution
    ends = {} if solution is None else {"final_": _End(solution.path, solution.cov, solution.map)}
    if solution is None or outcome.online is not None:  # a batch method has nothing online
        ends[""] = _End(outcome.online, outcome.cov, outcome.map)
    return ends


def _not_covariances(log: Log, end: _End) -> dict[str, tuple[int, int]]:
    """Counts by column the covariances of poses and landmarks that are none, and all that are known."""
    found: dict[str, tuple[int, int]] = {}
    known = 0 if end.cov is None else int(np.isfinite(end.cov).all(axis=(1, 2)).sum())
    if known and end.cov is not None and end.path is not None:
        found["nees_void"] = not_covariances(end.cov, end.path), known
    if end.map.cov is not None:
        given = log.prior.map
        drawn = np.isin(end.map.ids, given.ids, invert=True) if given is not None and given.cov is None else slice(None)
        blocks = covariances(end.map.cov)[drawn]
        found["landmark_nees_void"] = not_covariances(blocks, end.map.xy[drawn]), len(blocks)
    return found


def _none(prefix: str, column: str, wrong: int, known: int) -> str:
    what, each = ("landmark NEES", "landmark") if column.startswith("landmark") else ("NEES", "step")
    return f"{prefix.replace('_', ' ')}{what}: not a covariance at {wrong} of {known} {each}{'s' * (known != 1)}"


def _prefixed(prefix: str, row: dict[str, Any]) -> dict[str, Any]:
    return {prefix + name: value for name, value in row.items()}


def _remarks(log: Log, outcome: Outcome, truth: Truth | None) -> list[str]:
    said: list[str] = []
    given = log.prior.map
    if given is not None and not (np.isin(given.ids, log.ids).any() or (log.ids == UNKNOWN).any()):
        said.append(f"none of the {len(given.ids)} landmarks of the given map is sighted")
    if not outcome.located.any():
        of = ", which is another world's" if log.notes.get("given map") == "foreign" else ""
        said.append(f"the robot was not found on the given map{of}: no path, map or time of a fix is judged")
    unknown = int((log.ids == UNKNOWN).sum())
    if unknown and outcome.assigned is None:
        said.append(f"{unknown} of {len(log.ids)} sightings have no id")
    if truth is not None and truth.kind != "relations" and len(truth.t) < FEW * len(log):
        said.append(f"truth is known at {len(truth.t)} of {len(log)} steps")
    return said


def _measured_from(truth: Truth | None) -> dict[str, Any]:
    """Returns the columns surveyed and reference; the latter is absent where that is the plain batch optimum."""
    surveyed = truth is not None and truth.kind == "reference" and truth.map is not None and truth.places == "truth"
    return {"surveyed": int(surveyed)} | ({"reference": truth.words} if truth is not None and truth.words else {})


def _inner(log: Log, outcome: Outcome) -> dict[str, Any]:
    row: dict[str, Any] = {}
    effective, ancestors = (values[np.isfinite(values)] for values in (outcome.n_eff, outcome.ancestors))
    if len(effective):
        row["n_eff_least"] = float(effective.min())
    if len(ancestors):
        row["ancestors_left"] = float(ancestors[-1])
    if outcome.associate_ns is not None and outcome.tried is not None and outcome.tried.any():
        us = outcome.associate_ns[outcome.tried > 0] / 1e3
        row["associate_us_p50"], row["associate_us_p99"] = np.percentile(us, (50, 99)).tolist()
        row["nodes_max"] = int(outcome.tried.max())
    refused = int(outcome.refused.sum())
    if refused:
        row["refused_share"] = refused / (len(log.ids) + len(log.loop_to))
    return row


def _fit(log: Log, outcome: Outcome) -> Misfit | None:
    """Computes J of the final, else the online, path and map; None where it is not defined."""
    path, landmarks = outcome.online, outcome.map
    if outcome.solution is not None:
        path, landmarks = outcome.solution.path, outcome.solution.map
    try:
        return None if path is None else misfit(log, path, landmarks)
    except Diverged:  # a landmark at a robot's very place has no bearing
        return None


def _kept(log: Log, outcome: Outcome) -> dict[str, Array | Ints]:
    """Returns the arrays that a record keeps.

    Of each map's covariance the diagonal blocks (n, 2, 2), and once, of the final map's if known, the whole upper
    triangle row by row: another run can start from it.
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
        "mapped": mapped(log),
        "wall_ns": outcome.wall_ns,
        "belief_ns": outcome.belief_ns,
        "other_ns": np.array((outcome.map_ns, outcome.setup_ns, outcome.finish_ns, outcome.clock_ns)),
    }
    for prefix, assigned in _assigned(outcome):
        arrays[f"{prefix}assigned"] = assigned
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
    arrays: dict[str, Array | Ints] = {f"{prefix}_ids": landmarks.ids, f"{prefix}_xy": landmarks.xy}
    if landmarks.cov is not None:
        arrays[f"{prefix}_cov"] = covariances(landmarks.cov)
    return arrays
