"""Scores a cell: errors against ground truth, fit to the factors, CPU time."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...backends.api import Constant, Diverged, Solution
from ...core.arrays import length
from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Array, Ints
from ...core.truth.doubts import headings_known, judges, never_turns, other_headings, other_ways
from ...core.truth.errors import standing
from ..bound.bound import Bound, no_bound
from .accuracy import Alignment, has_shape, map_accuracy, map_rmse, own_map_rmse, path_accuracy, stretches
from .association import association_columns, by_true_ids, moved
from .constants import constants
from .cpu_time import step_cost
from .drive import Outcome
from .kept import kept
from .locating import from_the_fix_on, locating
from .misfit import Misfit, lowest_near, misfit
from .misplaced import misplaced, put_right, told
from .nees import nees, nees_columns, not_covariances
from .rejected_loops import rejected_loops
from .relations import counted_relations, relation_columns
from .stated_noise import misstated

FEW = 0.9  # truth at a smaller share of the steps is remarked on

FAR_ABOVE = 1.1
"""J of a smoother over the least one near it from which on the smoother has failed.

Incremental ones that end within their threshold are up to 5 % above it, on Huang's circle.
"""

NO_MORE = 0.1  # J; an estimate that is above the least one by that is a third of a standard deviation off

NOT_CONVERGED = "the smoothing ended without converging"  # the remark on a cell whose backend says so

TRANSLATION_ONLY = "aligned by translation only: the path is straight or standing"
SHAPELESS = "ATE takes a truth of 3 steps in several places"
UNTURNED = "the truth's heading never turns, but its path does: no heading and no NEES is judged"
MISTAKEN = "a remark names a mistake in the log: what its measurements are off by is not judged as noise"
OTHER_HEADINGS = "the truth's headings are others than those of path and odometry: no heading and no NEES is judged"
OTHER_WAYS = "the ways of truth and odometry differ as by a unit: no NEES is judged"


class Score(NamedTuple):
    """A row's values by column name, arrays by name, a remark for the row's reason, and why it is no answer, or ""."""

    row: dict[str, Any]
    arrays: dict[str, Array | Ints]
    remark: str
    failed: str


class _End(NamedTuple):
    """An estimate, online or final, and its columns so far, without their prefix."""

    path: Array | None  # (n, 3)
    cov: Array | None  # (n, 3, 3)
    map: Map
    assigned: Ints | None  # (s,) the landmark of every sighting
    row: dict[str, Any]
    partial: Ints | None = None  # (p,) that of every partial sighting, where it has decided on some


def score(
    log: Log,
    outcome: Outcome,
    truth: Truth | None,
    *,
    sightings: bool = True,
    loops: bool = True,
    minimised: Log | None = None,
    mistaken: bool = False,
    least: Bound | None = None,
) -> Score:
    """Scores the outcome of a backend that uses `sightings` and `loops`, or does not.

    `minimised` is the log whose J it minimises, if it does: the factors that it was given. A `mistaken` log is one with
    a mistake, so that no noise is blamed. `least` are the errors that the log allows.

    Online and final are never mixed; a value that does not exist is absent from the row.
    """
    given, whole_truth = log, truth
    ends = _ends(log, outcome, truth)
    row, taken_out = moved(log, outcome, truth)
    if loops and outcome.solution is not None:
        row |= rejected_loops(log, truth, outcome.solution.path)
    remarks = [*_remarks(log, outcome, truth), *taken_out]
    for prefix, end in ends.items():
        columns, void = not_covariances(log, end.path, end.cov, end.map)
        end.row.update(columns)
        remarks += [prefix.replace("_", " ") + one for one in void]
        if truth is not None and truth.map is not None:
            end.row.update(map_accuracy(log, truth, truth.map, end.map))
    arrays = kept(log, outcome)
    headings = truth is not None and headings_known(log, truth)
    exact = truth is not None and judges(log, truth)
    if truth is not None:
        truth = from_the_fix_on(log, outcome, truth)
        if len(truth.t):
            remarks += _score_paths(log, truth, ends, arrays, headings=headings, exact=exact)
        if truth.relations is not None:
            row |= counted_relations(truth.relations)
            for end in ends.values():
                end.row.update({} if end.path is None else relation_columns(truth.relations, end.path))
    row |= {prefix + name: value for prefix, end in ends.items() for name, value in end.row.items()}
    row |= _over_bound(row, least)
    if least is None and exact and any(f"{prefix}ate_m" in row for prefix in ends):
        reason = no_bound(given, whole_truth)
        row |= {"no_bound": reason} if reason else {}
    remarks += _places(log, truth, ends, arrays)
    if truth is not None and exact:
        remarks += [MISTAKEN] if mistaken else misstated(log, truth, row, sightings=sightings)
    if outcome.assigned is not None:  # the final ones, if any
        end = next(end for end in ends.values() if end.assigned is not None)
        log, minimised = _named(log, end), None if minimised is None else _named(minimised, end)
    last = outcome.solution or outcome
    path = outcome.online if outcome.solution is None else outcome.solution.path
    constant = None if outcome.solution is None else outcome.solution.constant
    fit = None if path is None else _fit(log, path, last.map, constant)
    if fit is not None:
        row |= {"cost_j": fit.total, "j_online" if outcome.solution is None else "j_final": fit.total}
        row |= {f"j_{name}": term for name, term in fit._asdict().items() if name != "loops" or term}
        arrays["cost_terms"] = np.array(fit)
    estimated, columns = constants(given, outcome, whole_truth)
    row, arrays = row | estimated, arrays | columns
    row |= _measured_from(truth) | _inner(log, outcome) | {"landmarks": len(last.map.ids)}
    row |= locating(log, outcome, truth if headings else None) | step_cost(log, outcome)
    failed = "" if outcome.solution is None else _failed(minimised, outcome.solution, truth)
    if outcome.solution is not None and outcome.solution.converged is False:
        remarks.insert(0, NOT_CONVERGED)
    return Score(row, arrays, "; ".join(remarks), failed)


def _failed(log: Log | None, solution: Solution, truth: Truth | None) -> str:
    """Says why a smoother's solution, whose misfit to `log` should be the least, is none; "" if it is one.

    One that has converged may be at another minimum: then J of a plain batch optimum tells, where there is one.
    """
    fit = None if log is None else _fit(log, solution.path, solution.map, solution.constant)
    if log is None or fit is None or log.prior.start != "known":
        return NOT_CONVERGED if solution.converged is False else ""
    found = [lowest_near(log, solution.path, solution.map, solution.constant)]
    if truth is not None and truth.kind == "reference" and not truth.words and truth.places == "reference":
        other = None if truth.map is None else _fit(log, truth.poses, truth.map)
        found.append(None if other is None else other.total)
    least = min((J for J in found if J is not None), default=fit.total)
    if fit.total <= FAR_ABOVE * least + NO_MORE:
        return ""
    return f"the smoothing ended at a J of {fit.total:.4g}, where one of {least:.4g} is in reach: no optimum"


def _named(log: Log, end: _End) -> Log:
    """The log with the ids that its sightings were assigned."""
    assert end.assigned is not None
    log = replace(log, ids=end.assigned)
    return (
        log
        if end.partial is None or log.partial is None
        else replace(log, partial=replace(log.partial, ids=end.partial))
    )


def _ends(log: Log, outcome: Outcome, truth: Truth | None) -> dict[str, _End]:
    """The estimates by the prefix of their columns, maps by true ids where sightings were assigned."""
    solution = outcome.solution
    decided = log.partial is not None and bool((log.partial.ids == UNKNOWN).any())
    ends: dict[str, _End] = {}
    if solution is not None:
        of_parts = outcome.final_assigned_partial if decided else None
        ends["final_"] = _End(solution.path, solution.cov, solution.map, outcome.final_assigned, {}, of_parts)
    if solution is None or outcome.online is not None:  # a batch method has nothing online
        of_parts = outcome.assigned_partial if decided else None
        ends[""] = _End(outcome.online, outcome.cov, outcome.map, outcome.assigned, {}, of_parts)
    if outcome.assigned is not None and truth is not None and truth.assigned is not None:
        for prefix, end in ends.items():
            if end.assigned is not None:
                found, true = end.assigned, truth.assigned
                if end.partial is not None and truth.assigned_partial is not None:
                    found = np.concatenate((found, end.partial))
                    true = np.concatenate((true, truth.assigned_partial))
                end.row.update(association_columns(found, true))
                ends[prefix] = end._replace(map=by_true_ids(end.map, found, true))
    return ends


def _score_paths(
    log: Log, truth: Truth, ends: dict[str, _End], arrays: dict[str, Array | Ints], *, headings: bool, exact: bool
) -> list[str]:
    """Adds the errors of each path at the truth's times, and returns remarks on what these cannot be.

    Errors of headings and motions need true `headings`, NEES an `exact` truth of the log.
    """
    at = np.searchsorted(log.t, truth.t)  # truth's times are a subset of the log's
    over = stretches(truth, timed=length(log.t) is not None, headings=headings)
    straight = False
    for prefix, end in ends.items():
        if end.path is None:
            continue
        found = path_accuracy(truth, end.path[at], end.map, over, headings=headings)
        end.row.update(found.row)
        arrays |= {"at": at, f"{prefix}aligned": found.path, f"{prefix}alignment": found.alignment.motion}
        straight |= found.alignment.translation_only
        if exact and end.cov is not None:
            values = nees(end.path[at], end.cov[at], truth.poses)
            arrays[f"{prefix}nees"] = values
            end.row.update(nees_columns("nees", values, 3))
    if not has_shape(truth):
        return [SHAPELESS]
    return [TRANSLATION_ONLY] * straight


def _places(log: Log, truth: Truth | None, ends: dict[str, _End], arrays: dict[str, Array | Ints]) -> Iterator[str]:
    """Yields remarks on landmarks of the final map, else of the online one, that are not at their true places."""
    known = None if truth is None or truth.places != "truth" else standing(truth)
    if truth is None or known is None:
        return
    prefix, end = next(iter(ends.items()))
    seen = log if truth.assigned is None else replace(log, ids=truth.assigned)
    with np.errstate(all="ignore"):  # the numbers of a backend may have any size
        found = misplaced(end.map, known, told(seen, end.map.ids))
    if found.exchanged is not None and "map_rmse_m" in end.row:
        right, motion = put_right(known, found.exchanged), arrays.get(f"{prefix}alignment")
        if motion is None or truth.places != truth.kind or not has_shape(truth):
            after = own_map_rmse(end.map, right)
        else:
            after = map_rmse(end.map, right, Alignment(np.asarray(motion, np.float64), False))
        cycles = " and ".join(", ".join(map(str, cycle)) for cycle in found.exchanged.ids)
        yield (
            f"the map's error is {after or 0.0:.3g} m, not {end.row['map_rmse_m']:.3g} m, with the true places of "
            f"landmarks {cycles} exchanged"
        )
    if found.astray is not None:
        ids, errors, others, typical, most = found.astray
        ends_of = f"{errors[0]:.3g} m" if len(ids) == 1 else f"{errors[-1]:.3g} to {errors[0]:.3g} m"
        yield (
            f"landmark{'s' * (len(ids) > 1)} {', '.join(map(str, ids))} {'are' if len(ids) > 1 else 'is'} {ends_of} "
            f"off in the map, where the other {others} are {typical:.3g} m off (median), {most:.3g} m at most"
        )


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
    if log.partial is not None and outcome.assigned_partial is not None:
        open_ = log.partial.ids == UNKNOWN
        named = outcome.assigned_partial if outcome.final_assigned_partial is None else outcome.final_assigned_partial
        left = int((open_ & (named == UNKNOWN)).sum())
        of = f"{int(open_.sum())} partial sightings without an id"
        said += [f"{left} of {of} fit no landmark clearly, and {'is' if left == 1 else 'are'} left out"] * bool(left)
    if truth is not None and truth.kind != "relations" and len(truth.t) < FEW * len(log):
        said.append(f"truth is known at {len(truth.t)} of {len(log)} steps")
    if truth is not None:
        said += [UNTURNED] * never_turns(log, truth) + [OTHER_HEADINGS] * other_headings(log, truth)
        said += [OTHER_WAYS] * other_ways(log, truth)
    return said


def _measured_from(truth: Truth | None) -> dict[str, Any]:
    """The columns surveyed and reference; the latter is absent where that is the plain batch optimum."""
    surveyed = truth is not None and truth.kind == "reference" and truth.map is not None and truth.places == "truth"
    return {"surveyed": int(surveyed)} | ({"reference": truth.words} if truth is not None and truth.words else {})


def _over_bound(row: dict[str, Any], least: Bound | None) -> dict[str, Any]:
    """The bounds of errors, and how many times as large these are, of the paths that have any."""
    if least is None:
        return {}
    found: dict[str, Any] = {}
    for prefix, aligned, origin in (
        ("", least.online, least.online_origin),
        ("final_", least.final, least.final_origin),
    ):
        if f"{prefix}ate_m" in row:
            found |= {f"{prefix}bound_m": aligned, f"{prefix}over_bound": row[f"{prefix}ate_m"] / aligned}
        if f"{prefix}ate_origin_m" in row:
            found[f"{prefix}bound_origin_m"] = origin
    return found


def _inner(log: Log, outcome: Outcome) -> dict[str, Any]:
    """Sums up the backend's own account: NIS, particles, data association, refused measurements."""
    row: dict[str, Any] = {}
    dof = int(outcome.nis_dof.sum())
    if dof:
        row["nis"] = float(np.nansum(outcome.nis)) / dof
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
        row["refused_share"] = refused / (log.sighted + len(log.loop_to) + (0 if log.fixes is None else len(log.fixes)))
    return row


def _fit(log: Log, path: Array, landmarks: Map, constant: Constant | None = None) -> Misfit | None:
    """Computes J; None where it is not defined."""
    try:
        return misfit(log, path, landmarks, constant)
    except Diverged:  # a landmark at a robot's very place has no bearing
        return None
