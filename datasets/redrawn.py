"""Draws the noise of a log anew around its ground truth, as an option of pose graphs whose truth is known.

A published graph is one draw of its noise, from which no verdict can be had. Steps, loops, sightings and covariances
stay; what was measured is the true value with errors drawn from the covariance that the log states. It is not the
published log: its numbers are others, and where the published noise is not as stated, the drawn noise is.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import InputError
from ..core.factors import UNKNOWN, Dataset, Log, Truth
from ..core.options import option
from ..core.se2 import Array, between, wrap
from ..core.small_matrices import cholesky, product
from ..core.truth.errors import rows_of, sighted_from

DRAWN = "draw=true"  # as on the command line
DRAWN_NOTE = "noise drawn anew"  # the key of what was drawn, among the log's notes


@dataclass(frozen=True)
class Drawn:
    """Noise of the file's or of each seed's; a dataset's options inherit it."""

    draw: bool = option(False, "draw the noise anew for every seed, around the truth: not the published log")


def draws(options: object) -> bool:
    """Tells if the options are of a log whose noise is drawn anew."""
    return isinstance(options, Drawn) and options.draw


def redrawn(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """The log with other errors: of the prior, the motions, the loops that are not false, and the sightings.

    InputError where a step or a sighted landmark has no true place, for a range that an error takes below zero, and for
    a log with measurements of a part alone.
    """
    log, truth = dataset
    if log.partial is not None or log.fixes is not None or log.gyro is not None:
        raise InputError(
            f"option draw=true: {log.name} has ranges or bearings alone, fixes or a gyro, "
            "expected whole sightings and loops."
        )
    starting, moving, closing, seeing = rng.spawn(4)
    path = _true_path(log, truth)
    assert truth is not None
    pose = _with_errors(path[:1], log.prior.cov[None], starting)[0]
    delta = np.full_like(log.delta, np.nan)
    delta[1:] = _with_errors(between(path[:-1], path[1:]), log.delta_cov[1:], moving)
    loops = _with_errors(between(path[log.loop_to], path[log.loop_step]), log.loop_cov, closing)
    if truth.false_loops is not None:
        loops[truth.false_loops] = log.loop_delta[truth.false_loops]
    z = _with_errors(_true_sightings(log, truth, path), log.z_cov, seeing)
    for row in np.flatnonzero(z[:, 0] <= 0):
        raise InputError(
            f"option draw=true: {log.name}: an error takes the range of sighting {row} to {z[row, 0]:.3g} m, expected "
            "noise that is small against the ranges."
        )
    for column in (pose, delta, loops, z):
        column.flags.writeable = False
    known = log.prior
    return dataset._replace(
        log=replace(
            log,
            prior=known._replace(pose=pose),
            delta=delta,
            loop_delta=loops,
            z=z,
            notes={**log.notes, DRAWN_NOTE: "around the truth, from the covariances: not the published log"},
        )
    )


def _true_path(log: Log, truth: Truth | None) -> Array:
    """(n, 3) the true poses of all steps."""
    rows = np.full(len(log), -1) if truth is None or not truth.exact else rows_of(truth.t, log.t)
    for step in np.flatnonzero(rows < 0):
        raise InputError(f"option draw=true: {log.name} has no true pose of step {step}, expected that of every step.")
    assert truth is not None
    return truth.poses[rows]


def _true_sightings(log: Log, truth: Truth, path: Array) -> Array:
    """(s, 2) true range and bearing of every sighting."""
    if not len(log.ids):
        return np.zeros((0, 2))
    ids = log.ids if truth.assigned is None else truth.assigned
    rows = np.full(len(ids), -1) if truth.map is None else rows_of(truth.map.ids, ids)
    for row in np.flatnonzero((rows < 0) | (ids == UNKNOWN)):
        whose = "whose" if ids[row] == UNKNOWN else f"of landmark {ids[row]}, whose"
        raise InputError(f"option draw=true: {log.name} has sighting {row} {whose} true place is not known.")
    assert truth.map is not None
    return sighted_from(path[log.sighting_step], truth.map.xy[rows])


def _with_errors(right: Array, cov: Array, rng: np.random.Generator) -> Array:
    """`right` (m, k), whose last column is an angle, plus errors drawn from the covariances (m, k, k)."""
    if not len(right):
        return right.copy()
    found = right + product(cholesky(cov), rng.standard_normal((*right.shape, 1)))[..., 0]
    found[:, -1] = wrap(found[:, -1])
    return found
