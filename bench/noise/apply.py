"""States a noise in a log: scaled covariances, and for correlated errors less information per sighting."""

from dataclasses import replace

import numpy as np

from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array, Ints
from ...datasets._information import FIRST, kept
from ..systematic.errors import corrected
from .model import Model, SightingModel
from .motions import scaled
from .noise_file import noted
from .sightings import gaps, in_chains

MOST = 0.9
"""Largest share that `backends` names. Ranges whose errors hardly change from one sighting to the next would tell
motion to the millimetre, if the process were exactly the fitted one."""


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


RECOMMENDED = ("ekf[gate=0.999,jacobians=first-estimates]", "isam2[loss=cauchy]")
"""Backends whose NEES holds on a log that is stated so. With the standard Jacobians the EKF stays overconfident: what
remains is its linearisation. Gate and loss are for tails heavier than normal ones."""


def backends(model: Model, *, own: bool = False) -> tuple[str, ...]:
    """Names backends for a log stated under `model`, with their options.

    With `own`, that is the one that estimates the correlated part of sightings.
    """
    if not own:
        return RECOMMENDED
    options = [
        f"{name}_{key}={value:.3g}"
        for name, one in (("range", model.range), ("bearing", model.bearing))
        if one is not None and one.share > 0
        for key, value in (("share", min(one.share, MOST)), ("time", one.time))
    ]
    return (f"bias-ekf[{','.join([*options, 'gate=0.999'])}]",)


def unstated(log: Log, model: Model) -> str:
    """Says what of the noise `stated` cannot state in the log; "" where that is nothing."""
    slow = any(one is not None and one.share > 0 for one in (model.range, model.bearing))
    if not slow or not len(log.ids) or (log.ids != UNKNOWN).any():
        return ""
    return "no sighting has an id, so none is known to follow another of its landmark: their correlation is not stated"


def _beside(step: Ints) -> Array:
    """Number (s,) of sightings at the step of each."""
    return np.bincount(step)[step].astype(float) if len(step) else np.zeros(0)
