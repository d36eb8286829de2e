"""Logs with partial sightings and fixes, for tests of reading, writing and checking them."""

from dataclasses import replace

import numpy as np

from slamduel.core.factors import UNKNOWN, Log, Systematic
from slamduel.core.fixes import FixTable
from slamduel.core.partial import BEARING, RANGE, PartialTable
from small_log import small_log

NAN = np.nan


def partial_log(seed: int = 1) -> Log:
    """`small_log` with ranges and bearings alone, positions, a heading, a whole pose, and constant errors."""
    log, rng = small_log(seed), np.random.default_rng(seed + 7)
    partial = PartialTable.from_arrays(
        len(log),
        np.array([0, 1, 1, 4, 5]),
        np.array([3, 12, 12, UNKNOWN, 7]),
        np.array([RANGE, RANGE, BEARING, BEARING, RANGE]),
        np.array([1.5, 2.0, -0.4, 3.0, 0.7]),
        rng.uniform(0.01, 0.1, 5),
    )
    z = np.array([[1.0, 2.0, NAN], [NAN, NAN, 0.3], [0.5, -1.0, -2.0], [NAN, 4.0, NAN]])
    cov = np.where(np.isnan(z)[:, :, None] | np.isnan(z)[:, None, :], NAN, np.diag([0.1, 0.2, 0.05]))
    cov[2, 0, 1] = cov[2, 1, 0] = 0.02
    fixes = FixTable.from_arrays(len(log), np.array([0, 2, 2, 5]), z, cov, rng.normal(size=(4, 2)))
    prior = log.prior._replace(systematic=Systematic(range_scale=0.1, heading_offset=0.2))
    return replace(log, prior=prior, partial=partial, fixes=fixes)
