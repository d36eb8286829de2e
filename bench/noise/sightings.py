"""Errors of sightings by the true path, as chains of one landmark each."""

from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints
from ...core.truth.errors import named, sighting_errors
from ...datasets.noise.chains import gaps, in_chains
from ..measure.landmark_places import comparable
from .gauss_markov import Chains

NEAREST = 1e-3  # m, the least distance of a landmark


class Sighted(NamedTuple):
    """Sightings with known errors, sorted by landmark, then by time."""

    row: Ints  # (n,) of the log
    t: Array  # (n,) s since the log's start
    ids: Ints  # (n,)
    step: Ints  # (n,) of the log
    error: Array  # (n, 2) m, rad
    stated: Array  # (n, 2) standard deviations
    reach: Array  # (n,) m, the true distance
    gap: Array  # (n,) s since the landmark's last one; inf for its first

    def chains(self, axis: int) -> Chains:
        """The errors of range (0) or bearing (1)."""
        return Chains(self.error[:, axis], self.stated[:, axis], self.reach, self.gap)


def sighted(log: Log, truth: Truth) -> Sighted:
    """Sightings whose error the truth tells; landmarks without a true place are at the median of their sightings."""
    log = named(log, truth)
    row, error = sighting_errors(log, comparable(log, truth))
    ids = log.ids[row]
    order = in_chains(ids, log.sighting_step[row])
    row, error = row[order], error[order]
    t = log.t[log.sighting_step[row]]
    stated = np.sqrt(np.stack((log.z_cov[row, 0, 0], log.z_cov[row, 1, 1]), axis=-1))
    reach = np.maximum(log.z[row, 0] - error[:, 0], NEAREST)
    return Sighted(row, t - log.t[0], ids[order], log.sighting_step[row], error, stated, reach, gaps(ids[order], t))
