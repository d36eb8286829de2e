"""Gives a simulated log sightings whose errors are correlated in time."""

from dataclasses import replace

import numpy as np

from ...core.elementary import exp
from ...core.factors import Log, Truth
from ...core.se2 import Array, wrap
from ...core.truth.errors import difference, rows_of, sighted_from
from .._information import FIRST, information, kept

WEAKEST = 1e-4  # least information that a thinned sighting is stated with, as a share of its own


def slowed(log: Log, truth: Truth, share: float, time: float, stated: str, rng: np.random.Generator) -> Log:
    """The log with sightings whose errors have a part that stays, `share` of their variance.

    That part is a first-order Gauss-Markov process per landmark for its ranges and one for its bearings, with the
    correlation exp(-dt / `time`). The errors' variance stays; `stated` is each sighting's "own", or "thinned" to the
    information that it adds to the landmark's earlier ones, or "even": with the mean share that they add, all alike.
    Every landmark has a true place, every step a pose.
    """
    assert truth.map is not None
    ids = log.ids if truth.assigned is None else truth.assigned
    step = log.sighting_step
    right = sighted_from(truth.poses[step], truth.map.xy[rows_of(truth.map.ids, ids)])
    sd = np.sqrt(np.stack((log.z_cov[:, 0, 0], log.z_cov[:, 1, 1]), axis=-1))
    order = np.lexsort((step, ids))
    keep = np.full(len(ids), FIRST)
    again = np.flatnonzero(np.diff(ids[order]) == 0) + 1
    keep[again] = exp(-np.diff(log.t[step[order]])[again - 1] / time)
    slow = np.empty((len(ids), 2))
    slow[order] = _gauss_markov(rng.standard_normal((len(ids), 2))[order], keep)
    z = right + np.sqrt(1 - share) * difference(log.z, right) + np.sqrt(share) * sd * slow
    z[:, 1] = wrap(z[:, 1])
    cov = log.z_cov
    if stated == "even":
        cov = cov / kept(keep, share)
    if stated == "thinned":
        weaker = np.empty((len(ids), 2))
        for axis in range(2):
            own = sd[order, axis]
            weaker[order, axis] = 1 / np.sqrt(np.maximum(information(own, keep, share) * own**2, WEAKEST))
        cov = cov * weaker[:, :, None] * weaker[:, None, :]
    for array in (z, cov):
        array.flags.writeable = False
    return replace(log, z=z, z_cov=cov)


def _gauss_markov(draws: Array, keep: Array) -> Array:
    """Processes (n, 2) of unit variance from independent normal `draws` (n, 2), each correlated with the one before."""
    found = draws.copy()
    fresh = np.sqrt(1 - keep**2).tolist()
    for i, (old, new) in enumerate(zip(keep.tolist(), fresh, strict=True)):
        if old != FIRST:
            found[i] = old * found[i - 1] + new * draws[i]
    return found
