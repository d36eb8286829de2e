"""Logs of a drive along known landmarks with errors of known size, growth, bias and correlation in time."""

from typing import NamedTuple

import numpy as np

from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log
from slamduel.core.se2 import Array, between, wrap
from slamduel.core.truth.errors import rows_of, sighted_from


class Slow(NamedTuple):
    """The errors of ranges, or of bearings."""

    scale: float = 1.0  # times the stated standard deviation, at 3 m
    power: float = 0.0
    share: float = 0.0
    time: float = 1.0  # s
    bias: float = 0.0  # m or rad
    together: float = 0.0  # share of the white part that all sightings of a step have in common


REACH = 3.0
"""m, the distance of the scale."""

PLAIN = Slow()
"""Errors as stated."""


def noisy(
    world: str, seed: int, range_: Slow = PLAIN, bearing: Slow = PLAIN, odometry: tuple[float, float, float] = (1, 1, 1)
) -> Dataset:
    """The world's log with other errors, drawn from `seed`; what it states stays."""
    log, truth = load(world, seed)
    rng = np.random.default_rng([seed, 1])
    right = sighted_from(truth.poses[log.sighting_step], truth.map.xy[rows_of(truth.map.ids, log.ids)])
    z = right + np.stack([_errors(log, right[:, 0], one, k, rng) for k, one in enumerate((range_, bearing))], axis=-1)
    z[:, 1] = wrap(z[:, 1])
    delta = log.delta.copy()
    true = between(truth.poses[:-1], truth.poses[1:])
    drawn = np.linalg.cholesky(log.delta_cov[1:]) @ rng.standard_normal((len(log) - 1, 3, 1))
    delta[1:] = true + np.array(odometry) * drawn[..., 0]
    delta[:, 2] = wrap(delta[:, 2])
    changed = Log.from_arrays("noisy", log.prior, log.t, delta, log.delta_cov, log.sighting_step, log.ids, z, log.z_cov)
    return Dataset(changed, truth)


def _errors(log: Log, reach: Array, one: Slow, axis: int, rng: np.random.Generator) -> Array:
    """Errors (s,), drawn step by step, landmark by landmark."""
    sd = one.scale * np.sqrt(log.z_cov[:, axis, axis]) * (reach / REACH) ** one.power
    t, common = log.t[log.sighting_step], rng.standard_normal(len(log))[log.sighting_step]
    errors = np.zeros(len(log.ids))
    for landmark in np.unique(log.ids):
        rows = np.flatnonzero(log.ids == landmark)
        slow = rng.standard_normal(len(rows))
        for k in range(1, len(rows)):
            r = np.exp(-(t[rows[k]] - t[rows[k - 1]]) / one.time)
            slow[k] = r * slow[k - 1] + np.sqrt(1 - r * r) * slow[k]
        white = np.sqrt(1 - one.together) * rng.standard_normal(len(rows)) + np.sqrt(one.together) * common[rows]
        mixed = np.sqrt(one.share) * slow + np.sqrt(1 - one.share) * white
        errors[rows] = sd[rows] * mixed + one.bias * rng.standard_normal()
    return errors
