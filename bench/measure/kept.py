"""Chooses the arrays of an outcome that a record keeps."""

from dataclasses import replace

import numpy as np

from ...backends.api import Constant
from ...backends.constant_errors import fitted, partial_residuals
from ...core.factors import Log, Map
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ...core.small_matrices import upper
from .drive import Outcome
from .growth import mapped
from .nees import covariances

JOINT_MOST = 1_000  # landmarks up to which a map's joint covariance is kept: 16 MB then; 0.4 MB for 150 of them


def kept(log: Log, outcome: Outcome) -> dict[str, Array | Ints]:
    """The arrays that a record keeps, by name.

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
    solution, maps = outcome.solution, {"map": outcome.map}
    found: dict[str, Array | Ints | None] = {"online": outcome.online}
    if solution is None or outcome.online is not None:
        found["assigned"] = outcome.assigned
    if solution is not None:
        maps = {"final_map": solution.map, "map": outcome.map}
        found |= {"final": solution.path, "final_assigned": outcome.final_assigned}
    arrays |= {name: values for name, values in found.items() if values is not None}
    joint: dict[str, Array] = {}
    for name, landmarks in maps.items():
        arrays |= {f"{name}_ids": landmarks.ids, f"{name}_xy": landmarks.xy}
        if landmarks.cov is not None:
            joint[name] = landmarks.cov
            arrays[f"{name}_cov"] = covariances(landmarks.cov)
    name = next(iter(joint), "")
    if name and len(joint[name]) <= 2 * JOINT_MOST:
        arrays[f"{name}_joint"] = upper(joint[name][None])[:, 0]
    last = solution or outcome
    path = outcome.online if solution is None else solution.path
    if path is not None:
        arrays |= _range_residuals(log, path, last.map, None if solution is None else solution.constant)
    return arrays


def _range_residuals(log: Log, path: Array, landmarks: Map, constant: Constant | None) -> dict[str, Array | Ints]:
    """Steps and residuals (k,), m, of the ranges alone to landmarks of a map, seen from a path; none without any.

    A residual is measured less expected, constant errors taken out: those that fit best where they are not given.
    """
    if log.partial is None:
        return {}
    there = (log.partial.kind == RANGE) & np.isin(log.partial.ids, landmarks.ids)
    log = replace(log, partial=log.partial.rows(there))
    if log.partial is None:
        return {}
    with np.errstate(all="ignore"):  # the numbers of a backend may have any size
        off = partial_residuals(log, path, landmarks, fitted(log, path, landmarks) if constant is None else constant)
    return {} if off is None else {"range_step": log.partial.step, "range_off": -off}
