"""States a noise in a log: scaled covariances, and for correlated errors less information per sighting."""

from dataclasses import replace

import numpy as np

from ...frontend.factors import UNKNOWN, Log
from ...frontend.se2 import Array, Ints
from ._gauss_markov import information
from .model import Model, SightingModel
from .motions import scaled
from .noise_file import noted
from .sightings import gaps, in_chains

WEAKEST = 1e4
"""Largest factor on a variance for correlation: a sighting that adds less than this share of information adds none."""


def stated(log: Log, model: Model) -> Log:
    """The log with covariances that hold under `model`; values, times and ids stay.

    Where errors are correlated in time, a sighting's information is what it adds to that of the landmark's earlier
    ones. The total of sightings in a row is then the information 1' C^-1 1 that they have together, C being the
    covariance of their errors. Of landmarks sighted at one step, each has its share of what all of them say about the
    robot's pose: n errors with the correlation c have the information of n / (1 + (n - 1) c).
    """
    size = np.ones((len(log.ids), 2))
    for axis, one in enumerate((model.range, model.bearing)):
        if one is not None:
            size[:, axis] = np.sqrt(factors(log, one, axis))
    z_cov = log.z_cov * size[:, :, None] * size[:, None, :]
    delta_cov = log.delta_cov if model.odometry is None else scaled(log.delta_cov, np.array(model.odometry))
    for array in (z_cov, delta_cov):
        array.flags.writeable = False
    return replace(log, z_cov=z_cov, delta_cov=delta_cov, notes={**log.notes, "noise": noted(model)})


def factors(log: Log, one: SightingModel, axis: int) -> Array:
    """Factors (s,) on the stated variances of range (0) or bearing (1) of every sighting.

    Sightings without data association are in no chain: they get the median correlation of the others.
    """
    sd = np.sqrt(log.z_cov[:, axis, axis])
    spread = one.spread(sd, log.z[:, 0])
    own = spread**2 + one.bias**2
    known = log.ids != UNKNOWN
    order = in_chains(log.ids, log.sighting_step)
    order = order[known[order]]
    weaker = np.ones(len(sd))
    if len(order):
        gap = gaps(log.ids[order], log.t[log.sighting_step[order]])
        added = information(spread[order], gap, one.share, one.time, one.bias)
        weaker[order] = 1 / np.clip(added * own[order], 1 / WEAKEST, None)
        weaker[~known] = np.median(weaker[order])
    return own / sd**2 * weaker * (1 + (_beside(log.sighting_step) - 1) * one.together)


def _beside(step: Ints) -> Array:
    """Number (s,) of sightings at the step of each."""
    return np.bincount(step)[step].astype(float) if len(step) else np.zeros(0)
