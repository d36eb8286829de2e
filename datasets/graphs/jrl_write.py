"""Writes a log, and its truth, as a JSON Robot Log; it reads back with the same factors, up to rounding.

What the format cannot represent is left out: the notes, constant errors, times (a stamp is the number of its step), and
sightings whose landmark is unknown. Bearings alone, and fixes that are not of a whole pose, are refused.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...core.coordinates import after_motion
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Truth
from ...core.factors.check import check
from ...core.files import replaced
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ...core.truth.errors import rows_of
from ..formats.graph_parts import check_parts
from ..formats.symbols import BITS
from .jrl_rows import BETWEEN, POINT, POSE, PRIOR, RANGES, SIGHTING

ROBOT = "a"
POSES, LANDMARKS = ord(ROBOT) << BITS, ord("l") << BITS


def write_jrl(path: Path, dataset: Dataset) -> int:
    """Writes the log and its truth to `path` atomically; returns the number of sightings left out.

    Initial values are the dead-reckoned poses. Loop closures are potential outliers; those that the truth marks as
    false are outliers. InputError for a given map.
    """
    log, truth = dataset
    check(log, where=f"log {log.name}")
    if log.prior.map is not None:
        raise InputError(f"{path}: log {log.name} has a given map, which a JSON Robot Log cannot represent.")
    check_parts(path, log, "JSON Robot Log", RANGE)
    left_out, log = log.unknown, log.identified()
    entries, loops = _entries(log)
    content: dict[str, Any] = {"name": log.name, "robots": [ROBOT], "measurements": {ROBOT: entries}}
    content["initialization"] = {ROBOT: _poses(np.arange(len(log)), log.dead_reckoned())}
    if truth is not None and truth.kind == "truth":
        content["groundtruth"] = {ROBOT: _known(log, truth)}
    content["potential_outlier_factors"] = {ROBOT: loops}
    if truth is not None and truth.false_loops is not None:
        content["outlier_factors"] = {ROBOT: [loops[row] for row in truth.false_loops.tolist()]}
    try:
        with replaced(path) as part:
            part.write_text(f"{json.dumps(content)}\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from error
    return left_out


def _entries(log: Log) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """An entry for each step, and where its loop closures are: entry and measurement."""
    measurements = [list[dict[str, Any]]() for _ in range(len(log))]
    pose, cov = log.prior.pose[None], log.prior.cov[None]
    start = {"type": PRIOR, "key": POSES, "prior": _pose(pose[0]), "covariance": _all(after_motion(pose, cov)[0])}
    measurements[0].append(start)
    steps = np.arange(len(log))
    for k, one in enumerate(_between(steps[:-1], steps[1:], log.delta[1:], log.delta_cov[1:]), start=1):
        measurements[k].append(one)
    loops = list[list[int]]()
    closures = _between(log.loop_to, log.loop_step, log.loop_delta, log.loop_cov)
    for k, one in zip(log.loop_step.tolist(), closures, strict=True):
        loops.append([k, len(measurements[k])])
        measurements[k].append(one)
    for k, name, z, cov in zip(log.sighting_step.tolist(), log.ids.tolist(), log.z.tolist(), log.z_cov, strict=True):
        seen = {
            "type": "BearingRange",
            "bearing": {"type": "Rot2", "theta": z[1]},
            "range": {"type": "Scalar", "value": z[0]},
        }
        keys = {"key1": POSES + k, "key2": LANDMARKS + name}
        measurements[k].append({"type": SIGHTING, **keys, "measurement": seen, "covariance": _all(cov[::-1, ::-1])})
    for k, one in _parts(log):
        measurements[k].append(one)
    return [{"stamp": k, "measurements": found} for k, found in enumerate(measurements)], loops


def _parts(log: Log) -> Iterator[tuple[int, dict[str, Any]]]:
    """The step and the factor of each range alone and each fix."""
    if (one := log.partial) is not None:
        for k, name, z, var in zip(*(c.tolist() for c in (one.step, one.ids, one.z, one.var)), strict=True):
            keys = {"key1": POSES + k, "key2": LANDMARKS + name}
            yield k, {"type": RANGES, **keys, "measurement": {"type": "Scalar", "value": z}, "covariance": [var]}
    if (fixes := log.fixes) is not None:
        for k, z, cov in zip(fixes.step.tolist(), fixes.z, after_motion(fixes.z, fixes.cov), strict=True):
            yield k, {"type": PRIOR, "key": POSES + k, "prior": _pose(z), "covariance": _all(cov)}


def _between(first: Ints, last: Ints, delta: Array, cov: Array) -> Iterator[dict[str, Any]]:
    rows = zip(first.tolist(), last.tolist(), delta, after_motion(delta, cov), strict=True)
    for i, j, motion, around in rows:
        keys = {"key1": POSES + i, "key2": POSES + j}
        yield {"type": BETWEEN, **keys, "measurement": _pose(motion), "covariance": _all(around)}


def _known(log: Log, truth: Truth) -> list[dict[str, Any]]:
    """The true poses of steps, and the true landmarks."""
    step = rows_of(log.t, truth.t)
    values = _poses(step[step >= 0], truth.poses[step >= 0])
    if truth.map is not None:
        rows = zip(truth.map.ids.tolist(), truth.map.xy.tolist(), strict=True)
        values += [{"key": LANDMARKS + name, "type": POINT, "x": x, "y": y} for name, (x, y) in rows]
    return values


def _poses(steps: Ints, poses: Array) -> list[dict[str, Any]]:
    return [{"key": POSES + k, **_pose(pose)} for k, pose in zip(steps.tolist(), poses, strict=True)]


def _pose(pose: Array) -> dict[str, Any]:
    x, y, theta = pose.tolist()
    return {"type": POSE, "x": x, "y": y, "theta": theta}


def _all(cov: Array) -> list[float]:
    """All entries of a symmetric matrix."""
    return ((cov + cov.T) / 2).ravel().tolist()
