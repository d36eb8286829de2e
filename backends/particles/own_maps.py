"""The maps of particles that number their landmarks by themselves.

Each particle has rows of its own: it may have taken for two landmarks what is one to another. Resampling copies the
landmarks of a particle only where it has more than one descendant.
"""

import numpy as np

from ...core.factors import Map
from ...core.se2 import Array, Ints
from ._own_maps import Landmarks, inherit

RESERVED = 8  # landmarks of a particle that space is reserved for at first; doubled when exhausted


class OwnMaps:
    """Up to N landmarks in each of M particles, 48 bytes each."""

    def __init__(self, particles: int) -> None:
        self.landmarks = Landmarks(
            np.zeros((particles, 5, RESERVED)),
            np.zeros((particles, RESERVED), np.int64),
            np.zeros(particles, np.int64),
            np.arange(particles),
        )

    def adopt(self, known: Map) -> None:
        """Gives every particle the same map: its covariance's diagonal blocks; held fixed without one."""
        n = len(known.ids)
        self.reserve(n)
        i = 2 * np.arange(n)
        filters, names, counts, _ = self.landmarks
        names[:, :n] = known.ids
        filters[:, :2, :n] = known.xy.T
        if known.cov is not None:
            filters[:, 2:, :n] = known.cov[i, i], known.cov[i, i + 1], known.cov[i + 1, i + 1]
        counts[:] = n

    def reserve(self, more: int) -> None:
        """Makes space for that many more landmarks in every particle."""
        filters, names, counts, homes = self.landmarks
        before, needed = names.shape[1], int(counts.max()) + more
        if needed <= before:
            return
        added = before
        while before + added < needed:
            added *= 2
        filters = np.concatenate((filters, np.zeros((len(homes), 5, added))), axis=2)
        names = np.concatenate((names, np.zeros((len(homes), added), np.int64)), axis=1)
        self.landmarks = Landmarks(filters, names, counts, homes)

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]; `ancestors` are sorted."""
        self.landmarks = self.landmarks._replace(homes=inherit(self.landmarks, ancestors))

    def of(self, particle: int) -> tuple[Ints, Array]:
        """Ids (n,) and filters (n, 5) of a particle's landmarks: copies."""
        filters, names, counts, homes = self.landmarks
        home = homes[particle]
        n = counts[home]
        return names[home, :n].copy(), filters[home, :, :n].T.copy()
