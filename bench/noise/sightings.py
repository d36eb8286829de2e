"""Errors of sightings by the true path, whole ones and ranges or bearings alone, as chains of one landmark each."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints
from ...core.truth.errors import named, partial_errors, rows_of, sighting_errors
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

    def part(self, axis: int) -> "Part":
        """The errors of range (0) or bearing (1)."""
        chains = Chains(self.error[:, axis], self.stated[:, axis], self.reach, self.gap)
        return Part(self.t, self.ids, self.step, chains)


class Part(NamedTuple):
    """Errors of ranges, or of bearings, sorted likewise."""

    t: Array  # (n,) s since the log's start
    ids: Ints  # (n,)
    step: Ints  # (n,) of the log
    chains: Chains


def alone(log: Log, truth: Truth, kind: int) -> Part:
    """The errors of ranges, or of bearings, alone; of landmarks whose true place is known."""
    log = named(log, truth)
    row, error = partial_errors(log, truth)
    table = log.partial
    mine = np.zeros(0, np.int64) if table is None else np.flatnonzero(table.kind[row] == kind)
    if table is None or truth.map is None or not len(mine):
        nothing = np.zeros(0)
        return Part(nothing, row[:0], row[:0], Chains(nothing, nothing, nothing, nothing))
    row, error = row[mine], error[mine]
    order = in_chains(table.ids[row], table.step[row])
    row, error = row[order], error[order]
    step, ids = table.step[row], table.ids[row]
    t = log.t[step]
    away = truth.map.xy[rows_of(truth.map.ids, ids)] - truth.poses[rows_of(truth.t, t), :2]
    reach = np.maximum(np.hypot(*away.T), NEAREST)
    return Part(t - log.t[0], ids, step, Chains(error, np.sqrt(table.var[row]), reach, gaps(ids, t)))


def joined(parts: Sequence[Part]) -> Part:
    """The errors of several parts of a log, one after another."""
    chains = Chains(*map(np.concatenate, zip(*(one.chains for one in parts), strict=True)))
    t, ids, step, _ = zip(*parts, strict=True)
    return Part(np.concatenate(t), np.concatenate(ids), np.concatenate(step), chains)


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
