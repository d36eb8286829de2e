"""States a noise in a log: scaled covariances, and for correlated errors less information per sighting."""

from dataclasses import replace

import numpy as np

from ...core.factors import UNKNOWN, Log
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
    return replace(log, z_cov=z_cov, delta_cov=delta_cov, notes={**log.notes, "noise": noted(model)})


def factors(log: Log, one: SightingModel, axis: int, *, own: bool = False) -> Array:
    """Factors (s,) on the stated variances of range (0) or bearing (1) of every sighting."""
    spread = one.spread(np.sqrt(log.z_cov[:, axis, axis]), log.z[:, 0])
    whole = (spread**2 + one.bias**2) / log.z_cov[:, axis, axis]
    if own:
        return whole
    order = in_chains(log.ids, log.sighting_step)
    order = order[log.ids[order] != UNKNOWN]
    if len(order):
        gap = gaps(log.ids[order], log.t[log.sighting_step[order]])
        whole /= kept(np.where(np.isinf(gap), FIRST, np.exp(-gap / one.time)), one.share)
    return whole * (1 + (_beside(log.sighting_step) - 1) * one.together) if axis == 0 else whole


def scaled(cov: Array, scales: Array) -> Array:
    """Covariances (n, 3, 3) with the standard deviations of their axes times `scales` (3,)."""
    return cov * np.outer(scales, scales)


def _beside(step: Ints) -> Array:
    """Number (s,) of sightings at the step of each."""
    return np.bincount(step)[step].astype(float) if len(step) else np.zeros(0)
