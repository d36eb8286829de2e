"""The maps of particles that number their landmarks by themselves.

Each particle has rows of its own: it may have taken for two landmarks what is one to another. Resampling copies the
landmarks of a particle only where it has more than one descendant.
"""

import numpy as np

from ...core.factors import Map
from ...core.se2 import Array, Ints
from ._own_maps import inherit

RESERVED = 8
"""Landmarks of a particle that space is reserved for at first; doubled when exhausted."""


class OwnMaps:
    """Up to N landmarks in each of M particles, 48 bytes each. Particle m has those of row homes[m]."""

    def __init__(self, particles: int) -> None:
        self.landmarks = np.zeros((particles, 5, RESERVED))  # mean x, y (m), covariance xx, xy, yy (m^2)
        self.names = np.zeros((particles, RESERVED), np.int64)  # their ids
        self.counts = np.zeros(particles, np.int64)
        self.homes = np.arange(particles)

    def adopt(self, known: Map) -> None:
        """Gives every particle the same map: its covariance's diagonal blocks; held fixed without one."""
        n = len(known.ids)
        self.reserve(n)
        i = 2 * np.arange(n)
        self.names[:, :n] = known.ids
        self.landmarks[:, :2, :n] = known.xy.T
        if known.cov is not None:
            self.landmarks[:, 2:, :n] = known.cov[i, i], known.cov[i, i + 1], known.cov[i + 1, i + 1]
        self.counts[:] = n

    def reserve(self, more: int) -> None:
        """Makes space for that many more landmarks in every particle."""
        before, needed = self.names.shape[1], int(self.counts.max()) + more
        if needed <= before:
            return
        added = before
        while before + added < needed:
            added *= 2
        particles = len(self.homes)
        self.landmarks = np.concatenate((self.landmarks, np.zeros((particles, 5, added))), axis=2)
        self.names = np.concatenate((self.names, np.zeros((particles, added), np.int64)), axis=1)

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]; `ancestors` are sorted."""
        self.homes = inherit(self.landmarks, self.names, self.counts, self.homes, ancestors)

    def of(self, particle: int) -> tuple[Ints, Array]:
        """Ids (n,) and filters (n, 5) of a particle's landmarks: copies."""
        home = self.homes[particle]
        n = self.counts[home]
        return self.names[home, :n].copy(), self.landmarks[home, :, :n].T.copy()
