"""States a noise in a log: scaled covariances, and for correlated errors less information per sighting."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.arrays import frozen
from ...core.factors import UNKNOWN, Log
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from .._information import FIRST, kept
from .chains import gaps, in_chains
from .model import Model, SightingModel
from .noise_file import noted
from .systematic import corrected


def stated(log: Log, model: Model, *, own: bool = False) -> Log:
    """The log with covariances that hold under `model`; values, times and ids stay, but for errors that it corrects.

    Where errors are correlated in time, each sighting is stated with the share of its information that it adds to the
    landmark's earlier ones on average. The first of them are stated no surer than the others: an estimate that leans on
    them is worse. A landmark's bias goes into its place on the map, and takes nothing away. With `own`, each is stated
    with its own covariance, whatever earlier ones tell: for a backend that knows of the correlation.

    Ranges of landmarks sighted at one step share what they tell; n errors with the correlation c have the information
    of n / (1 + (n - 1) c). Bearings do not: what theirs have in common is an error of heading, and the differences
    between landmarks, which make map and path, are without it.
    """
    log = corrected(log, model.systematic)
    size = np.ones((len(log.ids), 2))
    for axis, one in enumerate((model.range, model.bearing)):
        if one is not None:
            size[:, axis] = np.sqrt(factors(log, one, axis, own=own))
    z_cov = log.z_cov * size[:, :, None] * size[:, None, :]
    delta_cov = log.delta_cov if model.odometry is None else scaled(log.delta_cov, np.array(model.odometry))
    for array in (z_cov, delta_cov):
        array.flags.writeable = False
    partial = None if log.partial is None else _alone(log, log.partial, model, own=own)
    gyro = log.gyro
    if gyro is not None and model.odometry is not None:  # whose turns were measured together with the odometry's
        gyro = replace(gyro, var=frozen(gyro.var * model.odometry[2] ** 2))
    notes = {**log.notes, "noise": noted(model)}
    return replace(log, z_cov=z_cov, delta_cov=delta_cov, partial=partial, gyro=gyro, notes=notes)


def factors(log: Log, one: SightingModel, axis: int, *, own: bool = False) -> Array:
    """Factors (s,) on the stated variances of range (0) or bearing (1) of every sighting."""
    var, step = log.z_cov[:, axis, axis], log.sighting_step
    return _factors(one, _Seen(log.ids, step, log.t[step], var, log.z[:, 0]), beside=axis == 0, own=own)


class _Seen(NamedTuple):
    """Ranges, or bearings, in order of step."""

    ids: Ints  # (s,)
    step: Ints  # (s,)
    t: Array  # (s,) s
    var: Array  # (s,) as stated
    reach: Array  # (s,) m


def _factors(one: SightingModel, seen: _Seen, *, beside: bool, own: bool) -> Array:
    spread = one.spread(np.sqrt(seen.var), seen.reach)
    whole = (spread**2 + one.bias**2) / seen.var
    if own:
        return whole
    order = in_chains(seen.ids, seen.step)
    order = order[seen.ids[order] != UNKNOWN]
    if len(order):
        gap = gaps(seen.ids[order], seen.t[order])
        whole /= kept(np.where(np.isinf(gap), FIRST, np.exp(-gap / one.time)), one.share)
    return whole * (1 + (_beside(seen.step) - 1) * one.together) if beside else whole


def _alone(log: Log, table: PartialTable, model: Model, *, own: bool) -> PartialTable:
    """Ranges and bearings alone, likewise; a bearing tells no distance, and has the noise at the typical one."""
    var = table.var.copy()
    for kind, one in ((RANGE, model.range), (BEARING, model.bearing)):
        mine = np.flatnonzero(table.kind == kind)
        if one is not None and len(mine):
            step = table.step[mine]
            reach = table.z[mine] if kind == RANGE else np.full(len(mine), one.reach)
            seen = _Seen(table.ids[mine], step, log.t[step], table.var[mine], reach)
            var[mine] *= _factors(one, seen, beside=kind == RANGE, own=own)
    var.flags.writeable = False
    return replace(table, var=var)


def scaled(cov: Array, scales: Array) -> Array:
    """Covariances (n, 3, 3) with the standard deviations of their axes times `scales` (3,)."""
    return cov * np.outer(scales, scales)


def _beside(step: Ints) -> Array:
    """Number (s,) of sightings at the step of each."""
    return np.bincount(step)[step].astype(float) if len(step) else np.zeros(0)
